"""A sheet of the schematic: draws parts of the design by schemdraw, and records the connections
that it has drawn.

A test compares what is joined with the netlist."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

from eitskin_hardware.circuit.design import Design, Part

Point = tuple[float, float]
PinAt = tuple[str, str]
NEAR = 1e-3
ROW = 0.62  # between the pins of a box
SMALL = 9
INCHES = 0.5  # of a unit
KINDS = {"Zener": "Zener", "C bulk": "Capacitor2"}


class Sheet:
    """One page. Points are given in schemdraw's units; a pin is where the drawing puts it."""

    def __init__(self, design: Design, title: str) -> None:
        import schemdraw
        from schemdraw import elements

        schemdraw.use("matplotlib")
        self.design, self.title = design, title
        self.elements = elements
        self.drawing = schemdraw.Drawing(show=False, fontsize=11, lw=1.2)
        self.pins: list[tuple[Point, PinAt]] = []
        self.lines: list[tuple[Point, Point]] = []
        self.tags: list[tuple[Point, str]] = []

    # ---- what is drawn ----

    def two(
        self, ref: str, start: Point, end: Point, first: str = "1", turned: bool = False
    ) -> None:
        """Draw a part of two pins from ``start``, where pin ``first`` is, to ``end``."""
        part = self.design[ref]
        other = next(pin.name for pin in part.kind.pins if pin.name != first)
        ends = (end, start) if part.kind.name == "Zener" else (start, end)  # drawn from the anode
        symbol = self._symbol(part).at(ends[0]).to(ends[1])
        upright = abs(end[0] - start[0]) < NEAR
        place = "bottom" if turned else "top"
        text = f"{ref}\n{part.text}" + ("\noptional" if part.optional else "")
        self.drawing.add(
            symbol.label(text, loc=place, fontsize=SMALL, ofst=0.15 if upright else 0.1)
        )
        self.pins += [(start, (ref, first)), (end, (ref, other))]

    def _symbol(self, part: Part) -> Any:
        first = {"R": "Resistor", "C": "Capacitor"}
        symbol = KINDS.get(part.kind.name) or first.get(part.kind.name[0], "Line")
        return getattr(self.elements, symbol)()

    def op_amp(self, ref: str, plus: Point) -> dict[str, Point]:
        """Draw an amplifier with its positive input at ``plus``; return its points. Its supplies
        stand beside it as text."""
        drawn = self.drawing.add(self.elements.Opamp().theta(0).anchor("in2").at(plus))
        at = {
            name: _rounded(drawn.absanchors[key])
            for name, key in (("+IN", "in2"), ("-IN", "in1"), ("OUT", "out"))
        }
        part = self.design[ref]
        supply = ", ".join(f"{pin} {part.net[pin]}" for pin in ("V+", "V-"))
        self.text((plus[0] + 1.0, plus[1] - 1.0), f"{ref} {part.kind.name}\n{supply}")
        for name, point in at.items():
            self.pins.append((point, (ref, name)))
        for k, name in enumerate(("V+", "V-")):
            hidden = (plus[0] + 1.0 + 0.01 * k, plus[1] - 7.77)
            self.pins.append((hidden, (ref, name)))
            self.tags.append((hidden, part.net[name]))
        return at

    def box(self, ref: str, corner: Point, left: Sequence[str], right: Sequence[str]) -> float:
        """Draw a part as a box with its upper left corner at ``corner``, its pins at both sides,
        each with number, name and net; return its height."""
        part = self.design[ref]
        number = {pin.name: pin.number for pin in part.kind.pins}
        height = ROW * (max(len(left), len(right)) + 1)
        widest = [
            max((len(name) + len(number[name]) + 2 for name in names), default=1)
            for names in (left, right)
        ]
        width = max(2.8, 0.2 * sum(widest))
        x, y = corner
        self._frame(x, y, width, height)
        self.text(
            (x + width / 2, y + 0.35),
            f"{ref} {part.text}" + (", optional" if part.optional else ""),
        )
        for names, edge, out in ((left, x, -1), (right, x + width, 1)):
            for k, name in enumerate(names):
                at = (edge, y - ROW * (k + 1))
                end = (edge + 0.5 * out, at[1])
                self.wire(at, end)
                self.pins.append((at, (ref, name)))
                self.text(
                    (edge - 0.12 * out, at[1]),
                    f"{number[name]} {name}" if number[name] != name else name,
                    "right" if out > 0 else "left",
                )
                if name in part.net:
                    self.tag(end, part.net[name], out)
                else:
                    self.text((end[0] + 0.1 * out, at[1]), "x", "left" if out > 0 else "right")
        return height

    def _frame(self, x: float, y: float, width: float, height: float) -> None:
        corners = [(x, y), (x + width, y), (x + width, y - height), (x, y - height), (x, y)]
        for start, end in pairwise(corners):
            self.drawing.add(self.elements.Line().at(start).to(end))

    def wire(self, *points: Point) -> None:
        """Draw a wire through ``points``."""
        for start, end in pairwise(points):
            self.drawing.add(self.elements.Line().at(start).to(end))
            self.lines.append((start, end))

    def dot(self, at: Point) -> None:
        """Mark a junction."""
        self.drawing.add(self.elements.Dot().at(at))

    def tag(self, at: Point, net: str, out: int = 1) -> None:
        """Write the name of a net at a point: all points with this name are joined."""
        self.text((at[0] + 0.12 * out, at[1]), net, "left" if out > 0 else "right", "blue")
        self.tags.append((at, net))

    def ground(self, at: Point) -> None:
        """Draw AGND below a point."""
        self.drawing.add(self.elements.Ground().theta(0).at(at))
        self.tags.append((at, "AGND"))

    def text(self, at: Point, text: str, align: Any = "center", colour: str = "black") -> None:
        """Write a text."""
        label = self.elements.Label().theta(0).at(at).color(colour)
        self.drawing.add(label.label(text, halign=align, valign="center", fontsize=SMALL, ofst=0))

    # ---- what is joined ----

    def groups(self) -> list[tuple[set[PinAt], set[str]]]:
        """Return what the drawing joins: for each group its pins and the names of nets at it."""
        points = [point for point, _ in (*self.pins, *self.tags)]
        points += [end for line in self.lines for end in line]
        root = list(range(len(points)))

        def find(k: int) -> int:
            while root[k] != k:
                k = root[k]
            return k

        for k, point in enumerate(points):
            for other in range(k):
                if _same(point, points[other]):
                    root[find(k)] = find(other)
        first_line = len(self.pins) + len(self.tags)
        for number, (start, end) in enumerate(self.lines):
            at = first_line + 2 * number
            root[find(at)] = find(at + 1)
            for k, point in enumerate(points):
                if _on(point, start, end):
                    root[find(k)] = find(at)
        found: dict[int, tuple[set[PinAt], set[str]]] = {}
        for k, (_, pin) in enumerate(self.pins):
            found.setdefault(find(k), (set(), set()))[0].add(pin)
        for k, (_, net) in enumerate(self.tags):
            found.setdefault(find(len(self.pins) + k), (set(), set()))[1].add(net)
        return list(found.values())

    def figure(self) -> Any:
        """Return the page as a matplotlib figure."""
        figure = self.drawing.draw(show=False).fig
        left, low, right, high = self.drawing.get_bbox()
        height = INCHES * (high - low)
        figure.set_size_inches(INCHES * (right - left), height)
        title = f"eitskin instrument: {self.title}"
        figure.suptitle(title, fontsize=12, x=0.0, y=1 + 0.4 / height, ha="left")
        return figure


def differences(design: Design, sheets: Iterable[Sheet]) -> list[str]:
    """Compare the sheets with the netlist: return what is missing, twice, or joined otherwise."""
    found: list[str] = []
    seen: dict[PinAt, int] = {}
    parts_of: dict[str, list[set[str]]] = {}
    for sheet in sheets:
        for pins, tags in sheet.groups():
            nets = {design[ref].net.get(name, f"no net at {ref} {name}") for ref, name in pins}
            for pin in pins:
                seen[pin] = seen.get(pin, 0) + 1
            if len(nets | tags) > 1:
                found.append(f"{sheet.title}: {sorted(pins)} joins {sorted(nets | tags)}")
            for net in nets:
                parts_of.setdefault(net, []).append(tags)
    for net, groups in parts_of.items():
        if len(groups) > 1 and any(net not in tags for tags in groups):
            found.append(f"{net} is drawn in pieces without its name")
    wanted = {(part.ref, pin) for part in design.parts.values() for pin in part.net}
    found += [f"{ref} {pin} is not drawn" for ref, pin in sorted(wanted - set(seen))]
    return found + [f"{pin} is drawn {count} times" for pin, count in seen.items() if count > 1]


def _rounded(point: Any) -> Point:
    return (round(float(point[0]), 6), round(float(point[1]), 6))


def _same(a: Point, b: Point) -> bool:
    return abs(a[0] - b[0]) < NEAR and abs(a[1] - b[1]) < NEAR


def _on(point: Point, start: Point, end: Point) -> bool:
    """Return whether a point lies on a line that is level or upright."""
    low = (min(start[0], end[0]) - NEAR, min(start[1], end[1]) - NEAR)
    high = (max(start[0], end[0]) + NEAR, max(start[1], end[1]) + NEAR)
    return low[0] <= point[0] <= high[0] and low[1] <= point[1] <= high[1]
