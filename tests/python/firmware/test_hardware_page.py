"""The pins of docs/guide/hardware.md, of its drawing and of the firmware are the same."""

import re
from pathlib import Path

from eitskin_studies.pictures.wiring import MULTIPLEXERS, WIRES, Wire

ROOT = Path(__file__).resolve().parents[3]
BOARD = ROOT / "firmware" / "boards" / "nucleo_f767zi"
PAGE = (ROOT / "docs" / "guide" / "hardware.md").read_text(encoding="utf-8")
MODES = {
    "MCO1": ("PIN_ALTERNATE", 0),
    "SPI3": ("PIN_ALTERNATE", 6),
    "USART3": ("PIN_ALTERNATE", 7),
    "ADC1": ("PIN_ANALOG", 0),
    "ADC2": ("PIN_ANALOG", 0),
    "input": ("PIN_INPUT", 0),
}
CONSTANTS = {"BUTTON": 13, "FSYNC": 2, "LED_GREEN": 0, "LED_BLUE": 7, "LED_RED": 14}


def firmware_pins() -> dict[str, tuple[str, int]]:
    """Mode and alternate function of each pin that the firmware sets up."""
    program = "".join(path.read_text(encoding="utf-8") for path in sorted(BOARD.glob("*.c")))
    call = re.compile(r"nucleo_pin\(GPIO([A-F])_BASE, ([\w +]+), (PIN_\w+), (\d+),")
    pins: dict[str, tuple[str, int]] = {}
    enables = int(re.findall(r"ENABLE_PIN = (\d+)", program)[0])
    for port, pin, mode, alternate in call.findall(program):
        if pin == "line":
            numbers = list(range(16))
        elif pin == "ENABLE_PIN + line":
            numbers = list(range(enables, enables + 4))
        else:
            numbers = [CONSTANTS[pin] if pin in CONSTANTS else int(pin)]
        for number in numbers:
            pins[f"P{port}{number}"] = (mode, int(alternate))
    return pins


def place(wire: Wire) -> str:
    return ", ".join(filter(None, (wire.pin, wire.zio, wire.morpho)))


def test_the_page_has_both_tables():
    at = {wire.to: place(wire) for wire in WIRES}
    table = ["| ADG1206 | A0 | A1 | A2 | A3 | EN |", f"|{6 * '---|'}"]
    for name in MULTIPLEXERS:
        cells = [at[f"ADG1206 {name} {line}"] for line in ("A0", "A1", "A2", "A3", "EN")]
        table.append(f"| {' | '.join([name, *cells])} |")
    assert "\n".join(table) + "\n\n" in PAGE
    table = ["| pin | firmware | wire to |", "|---|---|---|"]
    others = [wire for wire in WIRES if not wire.to.startswith("ADG1206")]
    table += [f"| {place(wire)} | {wire.function} | {wire.to} |" for wire in others]
    assert "\n".join(table) + "\n\n" in PAGE


def test_the_firmware_uses_these_pins_and_no_others():
    expected = {
        wire.pin: MODES.get(wire.function.split(",")[0].split()[0], ("PIN_OUTPUT", 0))
        for wire in WIRES
    }
    assert firmware_pins() == expected


def test_the_lines_are_in_the_order_of_the_hal():
    """Lines 0-3 are A0..A3 of I+, 4-7 of I-, 8-11 of V+, 12-15 of V-; 16..19 enable I+, I-, V+, V-
    (firmware/hal/hal.h)."""
    to = {wire.pin: wire.to for wire in WIRES}
    for number, name in enumerate(MULTIPLEXERS):
        assert to[f"PF{12 + number}"] == f"ADG1206 {name} EN"
        for address in range(4):
            assert to[f"PE{4 * number + address}"] == f"ADG1206 {name} A{address}"


def test_no_place_is_taken_twice():
    for kind in ("pin", "zio", "morpho"):
        places = [place for wire in WIRES if (place := getattr(wire, kind))]
        assert len(places) == len(set(places))


def test_the_flash_map_is_the_linkers_and_the_stores():
    script = (BOARD / "nucleo_f767zi.ld").read_text(encoding="utf-8")
    store = (BOARD / "store.c").read_text(encoding="utf-8")
    assert "ORIGIN = 0x08000000, LENGTH = 256K" in script and "| 0x08000000 | 256 KB" in PAGE
    assert re.search(r"#define BANKS_START +0x08040000u", store)
    assert "| 0x08040000 | 512 KB" in PAGE and "| 0x080C0000 | 512 KB" in PAGE


def test_the_drawing_repeats_byte_for_byte(tmp_path):
    from eitskin_studies.pictures.wiring_picture import draw_wiring

    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for file in files:
        draw_wiring(file)
    assert files[0].read_bytes() == files[1].read_bytes()
