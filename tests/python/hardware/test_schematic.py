"""The schematic joins what the netlist joins: read from the drawing's own points."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from eitskin_hardware.circuit.instrument import instrument
from eitskin_hardware.schematic.sheet import Sheet, differences
from eitskin_hardware.schematic.write import sheets, write_schematic

MADE = Path(__file__).resolve().parents[3] / "hardware" / "made" / "schematic"


@pytest.fixture(scope="module")
def drawn() -> dict[str, Sheet]:
    return sheets(instrument())


def test_each_pin_is_drawn_once_and_joined_as_in_the_netlist(drawn):
    assert differences(instrument(), drawn.values()) == []


CHANGES = {
    "another end of a resistor": (lambda d: d.rewired("R10", **{"2": "SMOOTH"}), "SOURCE_OUT"),
    "another end of a capacitor": (lambda d: d.rewired("C14", **{"2": "RETURN"}), "DRIVE"),
    "a part that is not drawn": (lambda d: d.changed(replace(d["R2"], ref="R99")), "R99"),
}


@pytest.mark.parametrize(("change", "named"), CHANGES.values(), ids=CHANGES)
def test_a_drawing_that_differs_from_the_netlist_is_found(drawn, change, named):
    found = differences(change(instrument()), drawn.values())
    assert any(named in line for line in found), found


def test_the_kept_pages_are_what_the_code_draws(tmp_path):
    """By their texts: positions may differ in the last digit between versions of matplotlib."""
    names = list(write_schematic(instrument(), tmp_path))
    assert {path.name for path in MADE.iterdir()} == set(names)
    for name in names:
        if name.endswith(".svg"):
            kept, now = (
                sorted(
                    re.findall(
                        r">([^<>\\s][^<>]*)</text>", (folder / name).read_text(encoding="utf-8")
                    )
                )
                for folder in (MADE, tmp_path)
            )
            assert kept == now and len(now) > 5, name
    assert (tmp_path / "schematic.pdf").read_bytes()[:5] == b"%PDF-"
    text = (tmp_path / "source.svg").read_text(encoding="utf-8")
    assert all(f">{ref}" in text for ref in ("R8", "R13", "C14", "U13"))
