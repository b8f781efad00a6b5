"""Writes the files of ``hardware/made``."""

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from eitskin.errors import EitskinError, UsageError
from eitskin.skin.skin import load_skin, paper_skin
from eitskin_hardware.circuit.instrument import instrument
from eitskin_hardware.circuit.lists import parts_csv, parts_page, wiring_page
from eitskin_hardware.circuit.netlist import Checked, check
from eitskin_hardware.container.container import container_of, make_stl, triangles, write_scad
from eitskin_hardware.container.drawing import draw_measures, draw_picture, draw_wires
from eitskin_hardware.schematic.write import write_schematic
from eitskin_hardware.spice.bench import Bench
from eitskin_hardware.spice.measure import Numbers, measure_all
from eitskin_hardware.spice.promises import table
from eitskin_hardware.spice.skins import skin_load
from eitskin_hardware.spice.stages import stage_table

RECTANGLE = Path(__file__).resolve().parent / "container" / "rectangle.toml"  # an example


class RulesError(EitskinError):
    """The circuit breaks an electrical rule."""


def texts() -> dict[str, str]:
    """Return the files that need no simulation, by name."""
    design = instrument()
    checked = check()
    refuse_broken(checked)
    return {
        "instrument.net": checked.netlist,
        "parts.csv": parts_csv(design),
        "parts.md": parts_page(design),
        "wiring.md": wiring_page(design),
        "instrument.cir": deck(),
    }


def refuse_broken(checked: Checked) -> None:
    """Reject a circuit that breaks an electrical rule.

    Raises:
        RulesError: names the first broken rules.
    """
    if checked.messages:
        raise RulesError(
            f"electrical rules: {'; '.join(checked.messages[:5])}; change circuit/instrument.py"
        )


def deck() -> str:
    """Return the deck that is shipped: the paper's skin, one row, which prints what is measured
    first."""
    bench = Bench(instrument(), skin_load(), (0, 1, 2, 3))
    names = (
        "sine",
        "smooth",
        "drive_v",
        "source",
        "drive",
        "return",
        "vplus",
        "vminus",
        "received",
        "converter",
    )
    return bench.deck(["ac lin 1 50k 50k", *(f"print vm({name})" for name in names)], linear=True)


def results_text(numbers: Numbers) -> str:
    """Return the results file."""
    return json.dumps(numbers, indent=1) + "\n"


def make_all(folder: Path) -> Iterator[str]:
    """Write all files into ``folder`` and yield their names.

    Raises:
        UsageError: the folder is not there.
        RulesError: the circuit breaks an electrical rule.
        SpiceError: ngspice is missing or fails.
    """
    if not folder.is_dir():
        raise UsageError(f"-o {folder}: no such folder; run this in a checkout, or make the folder")
    for name, text in texts().items():
        (folder / name).write_text(text, encoding="utf-8")
        yield name
    for name in write_schematic(instrument(), folder / "schematic"):
        yield f"schematic/{name}"
    yield from draw_containers(folder)
    numbers = measure_all()
    simulated = {
        "results.json": results_text(numbers),
        "promises.md": table(numbers),
        "bring-up.md": stage_table(),
    }
    for name, text in simulated.items():
        (folder / name).write_text(text, encoding="utf-8")
        yield name


def draw_containers(folder: Path) -> Iterator[str]:
    """Draw the paper's dish and a rectangular one, and a picture of the paper's with its posts."""
    (folder / "container").mkdir(exist_ok=True)
    round_one = container_of(paper_skin())
    rectangle = container_of(load_skin(RECTANGLE)[0])
    for name, container in (("paper", round_one), ("rectangle", rectangle)):
        draw_measures(container, folder / f"container/{name}.svg")
        yield f"container/{name}.svg"
    draw_wires(round_one, folder / "container/wires.svg")
    yield "container/wires.svg"
    with tempfile.TemporaryDirectory() as made:
        write_scad(round_one, Path(made))
        faces = triangles(make_stl(Path(made), "all"))
    draw_picture(faces, folder / "container/paper.png", "the paper's dish with its posts")
    yield "container/paper.png"
