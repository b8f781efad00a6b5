"""A peripheral of plain 32-bit registers: written values are kept, and unknown registers are
recorded."""

from collections.abc import Mapping

from eitskin_emulator.record import Record


class Registers:
    """``values`` by offset, ``reset_values`` after a reset; other offsets are not modelled."""

    name = "peripheral"
    base = 0
    gate: tuple[str, int] | None = None
    whole_words = True

    def __init__(self, record: Record, reset_values: Mapping[int, int]) -> None:
        self.record, self.reset_values = record, reset_values
        self.values = dict(reset_values)

    def read(self, offset: int, size: int) -> int:
        """A load."""
        if offset not in self.values:
            self.unmodelled(f"read +0x{offset:02X}")
        return self.values.get(offset, 0)

    def write(self, offset: int, size: int, value: int) -> None:
        """A store."""
        if offset not in self.values:
            self.unmodelled(f"write +0x{offset:02X}")
        else:
            self.values[offset] = value

    def unmodelled(self, what: str) -> None:
        """Record that the program uses a function that is not modelled."""
        self.record.unmodelled[f"{self.name}: {what}"] += 1

    def hazard(self, what: str) -> None:
        """Record that the program does what silicon forbids or may answer otherwise."""
        self.record.hazards[f"{self.name}: {what}"] += 1
