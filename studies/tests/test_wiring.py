"""The drawing of the wiring: of the pins of docs/guide/hardware.md, and the same in every run."""

from pathlib import Path

from eitskin_hardware.circuit.nucleo import MULTIPLEXERS, WIRES, Wire
from eitskin_studies.pictures.wiring_picture import draw_wiring

ROOT = Path(__file__).resolve().parents[2]


def place(wire: Wire) -> str:
    return ", ".join(filter(None, (wire.pin, wire.zio, wire.morpho)))


def test_the_page_has_both_tables():
    page = (ROOT / "docs" / "guide" / "hardware.md").read_text(encoding="utf-8")
    at = {wire.to: place(wire) for wire in WIRES}
    table = ["| ADG1206 | A0 | A1 | A2 | A3 | EN |", f"|{6 * '---|'}"]
    for name in MULTIPLEXERS:
        cells = [at[f"ADG1206 {name} {line}"] for line in ("A0", "A1", "A2", "A3", "EN")]
        table.append(f"| {' | '.join([name, *cells])} |")
    assert "\n".join(table) + "\n\n" in page
    table = ["| pin | firmware | wire to |", "|---|---|---|"]
    others = [wire for wire in WIRES if not wire.to.startswith("ADG1206")]
    table += [f"| {place(wire)} | {wire.function} | {wire.to} |" for wire in others]
    assert "\n".join(table) + "\n\n" in page


def test_it_repeats_byte_for_byte(tmp_path):
    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for file in files:
        draw_wiring(file)
    assert files[0].read_bytes() == files[1].read_bytes()
