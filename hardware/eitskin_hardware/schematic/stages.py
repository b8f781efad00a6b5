"""The layout of each sheet. What is joined is compared with the netlist by a test."""

from collections.abc import Callable, Sequence

from eitskin_hardware.circuit.design import Design
from eitskin_hardware.circuit.instrument import MUX_REF
from eitskin_hardware.schematic.sheet import Point, Sheet


def _bypasses(s: Sheet, at: Point, refs: Sequence[str]) -> None:
    """Capacitors in a row, each between the names of its nets."""
    for k, ref in enumerate(refs):
        x, y = at[0] + 1.9 * k, at[1]
        part = s.design[ref]
        s.two(ref, (x, y), (x, y - 2))
        s.tag((x, y), part.net["1"])
        s.tag((x, y - 2), part.net["2"])


def _grounded(s: Sheet, at: Point) -> None:
    """Join a point to ground, to the left of it."""
    s.wire(at, (at[0] - 0.7, at[1]))
    s.ground((at[0] - 0.7, at[1]))


def board(design: Design) -> Sheet:
    """The processor board."""
    s = Sheet(design, "board")
    names = [pin.name for pin in design["A1"].kind.pins]
    half = (len(names) + 1) // 2
    s.box("A1", (0, 0), names[:half], names[half:])
    return s


def supply(design: Design) -> Sheet:
    """Inlet, star point, supply good."""
    s = Sheet(design, "supply")
    s.box("J1", (0, 0), (), ("+15V", "AGND", "-15V"))
    _bypasses(s, (7, 0), ("C1", "C2"))
    s.two("NT1", (12, -1), (14, -1))
    s.tag((12, -1), "AGND", -1)
    s.tag((14, -1), "GND")
    s.two("R1", (0, -5), (3, -5))
    s.tag((0, -5), "+15V", -1)
    s.two("D1", (3, -5), (6, -5), first="K")
    s.wire((6, -5), (7.1, -5))
    s.tag((7.1, -5), "ZENER")
    s.box("U12", (11, -4.2), ("A", "K"), ("C", "E"))
    s.two("R2", (19, -5), (19, -7.5))
    s.tag((19, -5), "SUPPLY_GOOD")
    s.tag((19, -7.5), "GND")
    return s


def generator(design: Design) -> Sheet:
    """Sine, filter, gain."""
    s = Sheet(design, "generator")
    s.box(
        "U1",
        (-8, 2.2),
        ("MCLK", "SCLK", "SDATA", "FSYNC"),
        ("VOUT", "VDD", "COMP", "CAP", "AGND", "DGND"),
    )
    _bypasses(s, (-8, -4.5), ("C3", "C4", "C5", "C10", "C11", "C12", "C13"))
    s.tag((0, 0), "SINE", -1)
    s.two("R3", (0, 0), (3, 0))
    s.two("R4", (3, 0), (6, 0))
    s.two("C7", (6, 0), (6, -2.2))
    s.ground((6, -2.2))
    u2 = s.op_amp("U2", (7, 0))
    s.wire((6, 0), (7, 0))
    top = u2["OUT"][1] + 2.6
    s.wire((3, 0), (3, top))
    s.two("C6", (3, top), (6, top))
    s.wire((6, top), (u2["OUT"][0], top), u2["OUT"])
    s.wire(u2["-IN"], (u2["-IN"][0], top))
    x, y = u2["OUT"]
    s.two("C8", (x, y), (x + 3, y))
    s.two("R5", (x + 3, y), (x + 3, y - 2.4))
    s.tag((x + 3, y - 2.4), "SERVO")
    u3 = s.op_amp("U3", (x + 4.5, y))
    s.wire((x + 3, y), (x + 4.5, y))
    left = u3["-IN"][0]
    s.wire(u3["-IN"], (left, top))
    s.two("R6", (left, top), (u3["OUT"][0], top))
    s.wire((u3["OUT"][0], top), u3["OUT"])
    s.two("R7", (left, top), (left, top + 2.4))
    s.two("C9", (left, top + 2.4), (left + 2.4, top + 2.4))
    s.ground((left + 2.4, top + 2.4))
    s.tag(u3["OUT"], "DRIVE_V")
    for point in ((3, 0), (6, 0), u2["OUT"], (x + 3, y), u3["OUT"], (left, top)):
        s.dot(point)
    return s


def source(design: Design) -> Sheet:
    """Howland source, buffer, servo, driven return, sense."""
    s = Sheet(design, "source")
    s.tag((0, 0), "DRIVE_V", -1)
    s.two("R8", (0, 0), (3, 0))
    s.two("R11", (3, 0), (3, -2.6))
    s.tag((3, -2.6), "FOLLOW")
    u4 = s.op_amp("U4", (4.5, 0))
    s.wire((3, 0), (4.5, 0))
    top = u4["-IN"][1] + 1.8
    left, (ox, oy) = u4["-IN"][0], u4["OUT"]
    s.wire(u4["-IN"], (left, top))
    s.two("R9", (left, top), (left - 3, top))
    s.ground((left - 3, top))
    s.two("R10", (left, top), (ox, top))
    s.wire((ox, top), (ox, oy))
    s.two("R13", (ox, oy), (ox + 3, oy))
    s.wire((ox + 3, oy), (ox + 6.5, oy))
    s.two("R14", (ox + 3, oy), (ox + 3, oy - 2.6))
    s.ground((ox + 3, oy - 2.6))
    s.two("C14", (ox + 6.5, oy), (ox + 9.5, oy))
    s.tag((ox + 9.5, oy), "DRIVE")
    s.tag((ox + 5, oy + 0.35), "SOURCE")
    s.wire((ox + 5, oy), (ox + 5, oy + 0.35))
    # buffer and return
    y = -7.0
    s.tag((0, y), "SOURCE", -1)
    u13 = s.op_amp("U13", (0, y))
    bx, by = u13["OUT"]
    s.wire(u13["-IN"], (u13["-IN"][0], by + 2), (bx, by + 2), (bx, by))
    s.tag((bx, by - 0.5), "FOLLOW")
    s.wire((bx, by), (bx, by - 0.5))
    s.two("R16", (bx, by), (bx + 3, by))
    u14 = s.op_amp("U14", (bx + 4.2, by - 2.0))
    _grounded(s, u14["+IN"])
    ix, iy = u14["-IN"]
    mx, my = u14["OUT"]
    s.wire((bx + 3, by), (ix, by), (ix, iy))
    s.wire((ix, by), (ix, by + 1.2))
    s.two("R17", (ix, by + 1.2), (mx, by + 1.2))
    s.wire((mx, by + 1.2), (mx, my))
    s.two("C41", (mx, my), (mx + 3, my))
    s.two("R60", (mx + 3, my), (mx + 6, my))
    s.tag((mx + 6, my), "RETURN")
    s.two("R18", (mx + 6, my), (mx + 6, my - 2.4))
    s.ground((mx + 6, my - 2.4))
    # servo
    y = -14.0
    s.tag((0, y), "SOURCE", -1)
    s.two("R15", (0, y), (3, y))
    u5 = s.op_amp("U5", (4.2, y - 2.0))
    _grounded(s, u5["+IN"])
    ix, iy = u5["-IN"]
    mx, my = u5["OUT"]
    s.wire((3, y), (ix, y), (ix, iy))
    s.wire((ix, y), (ix, y + 1.2))
    s.two("C15", (ix, y + 1.2), (mx, y + 1.2))
    s.wire((mx, y + 1.2), (mx, my))
    s.tag((mx, my), "SERVO")
    # sense, optional
    x = 12.0
    s.two("R63", (x, y), (x, y - 2.6))
    s.tag((x, y), "RETURN", -1)
    s.ground((x, y - 2.6))
    s.two("C40", (x, y), (x + 4.5, y), turned=True)
    s.two("R61", (x + 4.5, y), (x + 4.5, y + 2.6), first="2")
    s.tag((x + 4.5, y + 2.6), "AVDD")
    s.two("R62", (x + 4.5, y), (x + 4.5, y - 2.6))
    s.ground((x + 4.5, y - 2.6))
    s.tag((x + 4.9, y), "SENSE")
    s.wire((x + 4.5, y), (x + 4.9, y))
    s.box("D3", (x + 9, y + 1.2), ("AK",), ("K", "A"))
    _bypasses(s, (0, -19), ("C16", "C17", "C18", "C19", "C42", "C43", "C44", "C45"))
    for point in ((3, 0), (left, top), (ox, oy), (ox + 3, oy), (bx, by)):
        s.dot(point)
    return s


def multiplexers(design: Design) -> Sheet:
    """Four multiplexers, and the resistors of their logic lines."""
    s = Sheet(design, "multiplexers")
    left = ("A0", "A1", "A2", "A3", "EN", "VDD", "VSS", "GND", "D")
    right = tuple(f"S{k + 1}" for k in range(16))
    for column, ref in enumerate(MUX_REF.values()):
        x = 17.0 * column
        s.box(ref, (x, 0), left, right)
        for k in range(5):
            resistor = f"R{20 + 5 * column + k}"
            y = -13.0 - 1.5 * k
            s.two(resistor, (x - 2, y), (x + 1, y))
            s.tag((x - 2, y), design[resistor].net["1"], -1)
            s.tag((x + 1, y), design[resistor].net["2"])
        _bypasses(s, (x + 5, -13.0), (f"C{20 + 2 * column}", f"C{21 + 2 * column}"))
        _bypasses(s, (x + 5, -17.0), (f"R{40 + column}",))
    return s


def electrodes(design: Design) -> Sheet:
    """Connector and ESD diodes."""
    s = Sheet(design, "electrodes")
    s.box("J2", (0, 0), [f"E{k}" for k in range(16)], [f"AGND{k}" for k in range(16)])
    for k in range(8):
        s.box(f"D{10 + k}", (12 + 8 * (k % 2), -3.0 * (k // 2)), ("IO1", "IO2"), ("GND",))
    return s


def receiver(design: Design) -> Sheet:
    """Instrumentation amplifier, REF, filter and clamp."""
    s = Sheet(design, "receiver")
    _bypasses(s, (-8, 0), ("R50", "R51"))
    s.box("U10", (0, 1), ("+IN", "-IN", "RG1", "RG2"), ("OUT", "REF", "+VS", "-VS"))
    s.two("R52", (-4, -3.2), (-1, -3.2))
    s.tag((-4, -3.2), "RG1", -1)
    s.tag((-1, -3.2), "RG2")
    s.tag((10, 0), "RECEIVED", -1)
    s.two("R55", (10, 0), (13, 0))
    s.two("C31", (13, 0), (13, -2.4))
    s.ground((13, -2.4))
    s.two("R56", (13, 0), (16, 0))
    s.tag((16, 0), "CONVERTER")
    s.wire((13, 0), (13, 1.0))
    s.tag((13, 1.0), "LIMITED")
    s.box("D2", (21, 1), ("AK",), ("K", "A"))
    y = -7.0
    s.two("R53", (0, y), (3, y))
    s.tag((0, y), "AVDD", -1)
    s.two("R54", (3, y), (3, y - 2.4))
    s.ground((3, y - 2.4))
    s.two("C30", (5, y), (5, y - 2.4))
    s.ground((5, y - 2.4))
    s.wire((3, y), (5, y), (7, y))
    u11 = s.op_amp("U11", (7, y))
    s.wire(u11["-IN"], (u11["-IN"][0], y + 2.4), (u11["OUT"][0], y + 2.4), u11["OUT"])
    s.tag(u11["OUT"], "REF")
    _bypasses(s, (14, y), ("C32", "C33", "C34"))
    s.dot((13, 0))
    return s


SHEETS: dict[str, Callable[[Design], Sheet]] = {
    "board": board,
    "supply": supply,
    "generator": generator,
    "source": source,
    "multiplexers": multiplexers,
    "electrodes": electrodes,
    "receiver": receiver,
}
