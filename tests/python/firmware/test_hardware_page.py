"""The pins of docs/guide/hardware.md and of the firmware are the same."""

import re
from dataclasses import dataclass
from pathlib import Path

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
MULTIPLEXERS = ("I+", "I-", "V+", "V-")
CONSTANTS = {
    "BUTTON": 13,
    "SUPPLY_GOOD": 11,
    "MORE_FITTED_PIN": 7,
    "FSYNC": 2,
    "LED_GREEN": 0,
    "LED_BLUE": 7,
    "LED_RED": 14,
}


def firmware_pins() -> dict[str, tuple[str, int]]:
    """Mode and alternate function of each pin that the firmware sets up."""
    program = "".join(path.read_text(encoding="utf-8") for path in sorted(BOARD.glob("*.c")))
    call = re.compile(r"nucleo_pin\(GPIO([A-F])_BASE, ([\w +]+), (PIN_\w+), (\d+),")
    pins: dict[str, tuple[str, int]] = {}
    first = {name: int(pin) for name, pin in re.findall(r"(\w*ENABLE_PIN) = (\d+)", program)}
    for port, pin, mode, alternate in call.findall(program):
        if pin == "line":
            numbers = list(range(16))
        elif pin.endswith("ENABLE_PIN + line"):
            start = first[pin.split()[0]]
            numbers = list(range(start, start + 4))
        else:
            numbers = [CONSTANTS[pin] if pin in CONSTANTS else int(pin)]
        for number in numbers:
            pins[f"P{port}{number}"] = (mode, int(alternate))
    return pins


@dataclass(frozen=True)
class Wire:
    """A row of the page's tables: a pin, where the board has it, what the firmware does with it,
    and its other end."""

    pin: str
    places: tuple[str, ...]  # on the Zio and the morpho connectors
    function: str
    to: str


def cells(first: str) -> list[list[str]]:
    """The rows of all tables whose head begins with ``first``, the head first."""
    found = []
    for table in re.findall(rf"^\| {first} \|.*\n(?:\|.*\n)+", PAGE, re.MULTILINE):
        lines = table.splitlines()
        rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
        found += [*rows[2:]] if found else [rows[0], *rows[2:]]
    return found


def wires() -> list[Wire]:
    (_, *lines), *multiplexers = cells("ADG1206")
    found = [
        (cell, "output", f"ADG1206 {name} {line}")
        for name, *row in multiplexers
        for line, cell in zip(lines, row, strict=True)
    ]
    found += [(cell, function, to) for cell, function, to in cells("pin")[1:]]
    made = []
    for cell, function, to in found:
        pin, *places = cell.split(", ")
        made.append(Wire(pin, tuple(places), function, to))
    return made


WIRES = wires()


def test_the_firmware_uses_these_pins_and_no_others():
    expected = {
        wire.pin: MODES.get(wire.function.split(",")[0].split()[0], ("PIN_OUTPUT", 0))
        for wire in WIRES
    }
    assert firmware_pins() == expected


def test_the_lines_are_in_the_order_of_the_hal():
    """Lines 0-3 are A0..A3 of I+, 4-7 of I-, 8-11 of V+, 12-15 of V-; 16..19 enable I+, I-, V+, V-,
    and 20..23 those of electrodes 16 to 31 (firmware/drivers/adg1206.h)."""
    to = {wire.pin: wire.to for wire in WIRES}
    for number, name in enumerate(MULTIPLEXERS):
        assert to[f"PF{12 + number}"] == f"ADG1206 {name} EN"
        assert to[f"PF{8 + number}"] == f"EN of {name} of electrodes 16 to 31"
        for address in range(4):
            assert to[f"PE{4 * number + address}"] == f"ADG1206 {name} A{address}"


def test_no_place_is_taken_twice():
    places = [place for wire in WIRES for place in (wire.pin, *wire.places)]
    assert len(places) == len(set(places)) > len(WIRES) == 38


def test_the_flash_map_is_the_linkers_and_the_stores():
    script = (BOARD / "nucleo_f767zi.ld").read_text(encoding="utf-8")
    store = (BOARD / "store.c").read_text(encoding="utf-8")
    assert "ORIGIN = 0x08000000, LENGTH = 256K" in script and "| 0x08000000 | 256 KB" in PAGE
    assert re.search(r"#define BANKS_START +0x08040000u", store)
    assert "| 0x08040000 | 512 KB" in PAGE and "| 0x080C0000 | 512 KB" in PAGE
    assert "0x08140000 (9) and 0x08180000 (10), 256 KB each" in store
    assert "| 0x08140000 | 256 KB" in PAGE and "| 0x08180000 | 256 KB" in PAGE


def test_the_map_of_the_ram_is_the_linkers():
    script = (BOARD / "nucleo_f767zi.ld").read_text(encoding="utf-8")
    regions = re.findall(r"^    (ITCM|DTCM|SRAM) .*ORIGIN = (\w+), LENGTH = (\d+)K", script, re.M)
    assert len(regions) == 3 and "stack_bytes = 24K" in script and "stack (24 KB)" in PAGE
    for _, origin, length in regions:
        assert f"| {origin} | {length} KB" in PAGE


def test_the_timing_of_a_scan_is_that_of_the_settings():
    """The page's slot, of the settings after a start."""
    app = ROOT / "firmware" / "app" / "acquire"
    scan = (app / "scan.h").read_text(encoding="utf-8")
    default = (app / "frame.h").read_text(encoding="utf-8")
    number = {
        name: int(re.search(rf"\.{name} = (\d+)", default)[1])
        for name in ("sample_rate_hz", "samples", "settle_us")
    }
    switch_us = int(re.search(r"FW_SWITCH_US +(\d+)u", scan)[1])
    assert re.search(r"FW_MAX_TRIES +8u", scan) and "up to eight times" in PAGE
    burst_us = number["samples"] * 1_000_000 // number["sample_rate_hz"]
    least = burst_us + switch_us + number["settle_us"]
    slot_us = -(-least // 20) * 20  # whole periods of 50 kHz
    assert f"{burst_us} + {switch_us} + {number['settle_us']} = {least} µs" in PAGE
    assert f"slot of a row, {slot_us} µs" in PAGE
    assert f"208 rows take {208 * slot_us / 1000} ms, {1e6 / 208 / slot_us:.1f} frames" in PAGE
