"""A design: parts and the net at each of their pins, without the library that made it.

All outputs read it: netlist, parts list, wiring table, schematic and deck. A mistake of a maker is
a changed copy.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from eitskin_hardware.circuit.parts import ORDERS, Kind, Order

GROUNDS = ("GND", "AGND")


@dataclass(frozen=True)
class Part:
    """A part of the circuit. ``value`` is as printed, ``net`` maps the name of a pin to its net;
    a pin that is not used has none. ``optional`` is not fitted by default."""

    ref: str
    kind: Kind
    value: str
    stage: str
    net: dict[str, str]
    optional: bool = False

    @property
    def text(self) -> str:
        """The value, or the kind where that says all."""
        return self.value or self.kind.name


@dataclass(frozen=True)
class Design:
    """Parts by their reference, in the order of the stages."""

    parts: dict[str, Part]

    def __getitem__(self, ref: str) -> Part:
        return self.parts[ref]

    def of(self, kind: str) -> list[Part]:
        """All parts of a kind."""
        return [part for part in self.parts.values() if part.kind.name == kind]

    def fitted(self) -> Iterable[Part]:
        """The parts that are not optional."""
        return (part for part in self.parts.values() if not part.optional)

    def nets(self) -> dict[str, list[tuple[str, str]]]:
        """The (reference, pin name) of each net, by its name."""
        found: dict[str, list[tuple[str, str]]] = {}
        for part in self.parts.values():
            for pin, net in part.net.items():
                found.setdefault(net, []).append((part.ref, pin))
        return found

    def changed(self, *parts: Part) -> "Design":
        """Return a copy with these parts in place of those of the same reference."""
        return Design({**self.parts, **{part.ref: part for part in parts}})

    def without(self, *refs: str) -> "Design":
        """Return a copy that lacks some parts."""
        return Design({ref: part for ref, part in self.parts.items() if ref not in refs})

    def with_value(self, ref: str, value: str) -> "Design":
        """Return a copy in which a part has another value."""
        return self.changed(replace(self.parts[ref], value=value))

    def rewired(self, ref: str, **net: str) -> "Design":
        """Return a copy in which pins of a part go to other nets (underscores stand for what a
        keyword cannot hold: ``IN_P`` is ``+IN``, ``IN_N`` is ``-IN``)."""
        names = {"IN_P": "+IN", "IN_N": "-IN"}
        part = self.parts[ref]
        changes = {names.get(pin, pin): to for pin, to in net.items()}
        unknown = set(changes) - set(part.net)
        if unknown:
            raise KeyError(f"{ref} has no pin {sorted(unknown)}")
        return self.changed(replace(part, net={**part.net, **changes}))


def order_of(part: Part) -> Order:
    """Return how a part is ordered.

    Raises:
        KeyError: the catalogue has no such part.
    """
    for order in ORDERS:
        if order.kind == part.kind.name and order.value in ("", part.value):
            return order
    raise KeyError(f"{part.ref}: no order for {part.kind.name} {part.value}")
