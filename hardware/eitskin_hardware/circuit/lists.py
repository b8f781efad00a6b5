"""The parts list and the wiring table, from the design."""

import csv
import io
from dataclasses import dataclass

from eitskin_hardware.circuit.design import Design, Part, order_of
from eitskin_hardware.circuit.parts import EXTRAS, PRICES_OF, Order


@dataclass(frozen=True)
class Line:
    """A line of the parts list."""

    refs: tuple[str, ...]
    order: Order

    @property
    def count(self) -> int:
        """The number of pieces."""
        return max(len(self.refs), 1)

    @property
    def price_usd(self) -> float:
        """The price of all of them."""
        return self.count * self.order.price_usd


def parts_list(design: Design, optional: bool = False) -> list[Line]:
    """Return the lines of the parts that are fitted, or of the ``optional`` ones, in the order of
    the circuit; then, for an instrument, what has no place in the circuit."""
    found: dict[Order, list[str]] = {}
    for part in design.parts.values():
        if part.optional == optional and part.kind.name != "star point":
            found.setdefault(order_of(part), []).append(part.ref)
    lines = [Line(tuple(sorted(refs, key=_by_number)), order) for order, refs in found.items()]
    return lines if optional else lines + [Line((), order) for order in EXTRAS]


def _by_number(ref: str) -> tuple[str, int]:
    letters = ref.rstrip("0123456789")
    return letters, int(ref[len(letters) :] or 0)


def total_usd(design: Design) -> float:
    """Return the approximate price of the parts of one instrument."""
    return sum(line.price_usd for line in parts_list(design))


HEADER = (
    "pieces",
    "references",
    "part",
    "maker",
    "number",
    "alternatives",
    "price of one, USD, approximate",
)


def parts_csv(design: Design) -> str:
    """Return the parts list as CSV: fitted parts, then optional ones."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow((*HEADER, "optional"))
    for optional in (False, True):
        for line in parts_list(design, optional):
            order = line.order
            writer.writerow((
                line.count, " ".join(line.refs), order.what, order.maker, order.number,
                order.alternatives, f"{order.price_usd:.2f}", "yes" if optional else "",
            ))  # fmt: skip
    return out.getvalue()


def parts_page(design: Design) -> str:
    """Return the parts list as a page."""
    text = [
        "# Parts of one instrument",
        "",
        "`eitskin hardware make` wrote this page. Prices are approximate, for single pieces, in US"
        f" dollars, noted in {PRICES_OF} without asking a shop. Numbers are the makers'; compare"
        " package and pins with the data sheet before you order.",
        "",
        f"**Together about {total_usd(design):.0f} USD**, without the skin, its container, tools"
        " and shipping, and without a source of 9 to 36 V for the converter. For"
        " [bring-up](../../docs/guide/bring-up.md) you also need sixteen resistors of 1 kΩ and one"
        " of 10 kΩ, a multimeter and an oscilloscope.",
        "",
        "Nobody has made a layout of the bare circuit board yet ([what"
        " remains](../README.md#what-remains-for-a-person)); until then it is perforated board.",
        "",
        *_table(parts_list(design)),
        "",
        "Optional, for the sense resistor of the safety section (R63 in place of R60):",
        "",
        *_table(parts_list(design, True)),
    ]
    return "\n".join(text) + "\n"


def _table(lines: list[Line]) -> list[str]:
    rows = [
        "| pieces | part | maker's number | alternatives | references | together |",
        f"|{6 * '---|'}",
    ]
    for line in lines:
        order = line.order
        number = f"{order.maker} {order.number}".strip() or "any"
        rows.append(
            f"| {line.count} | {order.what} | {number} | {order.alternatives} |"
            f" {', '.join(line.refs)} | {line.price_usd:.2f} |"
        )
    return rows


def wiring_page(design: Design) -> str:
    """Return the wiring table: each pin of each part with its net and the pins that it meets."""
    nets = design.nets()
    text = [
        "# Wiring, pin by pin",
        "",
        "`eitskin hardware make` wrote this page. Each pin is followed by its net and by the other"
        " pins on it; nets with more than eight pins are named alone.",
    ]
    for part in design.parts.values():
        text += ["", f"## {_title(part)}", "", "| pin | name | net | to |", f"|{4 * '---|'}"]
        for pin in part.kind.pins:
            net = part.net.get(pin.name, "")
            others = [
                (ref, name)
                for ref, name in nets.get(net, [])
                if (ref, name) != (part.ref, pin.name)
            ]
            if not net:
                to = "not connected"
            elif len(others) > 8:
                to = f"{len(others)} other pins"
            else:
                to = ", ".join(f"{ref} {_pin(design[ref], name)}" for ref, name in others)
            text.append(f"| {pin.number} | {pin.name} | {net} | {to} |")
    return "\n".join(text) + "\n"


def _title(part: Part) -> str:
    optional = ", optional" if part.optional else ""
    return f"{part.ref}: {part.text} ({part.stage}{optional})"


def _pin(part: Part, name: str) -> str:
    """The number of a pin, with its name where that says more."""
    number = next(pin.number for pin in part.kind.pins if pin.name == name)
    return number if number == name else f"{number} ({name})"
