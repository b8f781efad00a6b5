"""Peripherals by address. A peripheral whose clock is off reads 0 and ignores writes, like the real
one. So do registers that are not modelled. Both are recorded."""

from typing import Protocol

from eitskin_emulator.record import Record

PAGE = 10  # peripherals lie 1 KB apart


class Peripheral(Protocol):
    """Registers in one or more KB.

    ``gate`` names the bit of RCC that clocks them ("AHB1ENR", 21); None: always clocked.
    ``whole_words``: they take and give 32 bits; the bus then merges narrower writes. Else they see
    sizes and offsets as the program uses them.
    """

    @property
    def name(self) -> str: ...
    @property
    def base(self) -> int: ...
    @property
    def gate(self) -> tuple[str, int] | None: ...
    @property
    def whole_words(self) -> bool: ...
    def read(self, offset: int, size: int) -> int: ...
    def write(self, offset: int, size: int, value: int) -> None: ...


class Gates(Protocol):
    """Tells whether a peripheral is clocked."""

    def clocked(self, gate: tuple[str, int]) -> bool: ...


class Bus:
    """Finds the peripheral of an address."""

    def __init__(self, record: Record, gates: Gates) -> None:
        self.record = record
        self.gates = gates
        self._pages: dict[int, Peripheral] = {}

    def add(self, peripheral: Peripheral, kilobytes: int = 1) -> None:
        """Put ``peripheral`` at its base."""
        for page in range(kilobytes):
            self._pages[(peripheral.base >> PAGE) + page] = peripheral

    def read(self, address: int, size: int) -> int:
        """Return the value of a load of ``size`` bytes."""
        peripheral = self._pages.get(address >> PAGE)
        if peripheral is None or (
            peripheral.gate is not None and not self.gates.clocked(peripheral.gate)
        ):
            return self._refuse(peripheral, address, "read")
        offset = address - peripheral.base
        if size == 4 or not peripheral.whole_words:
            return peripheral.read(offset, size)
        return (peripheral.read(offset & ~3, 4) >> 8 * (offset & 3)) & ((1 << 8 * size) - 1)

    def write(self, address: int, size: int, value: int) -> None:
        """A store of ``size`` bytes."""
        peripheral = self._pages.get(address >> PAGE)
        if peripheral is None or (
            peripheral.gate is not None and not self.gates.clocked(peripheral.gate)
        ):
            self._refuse(peripheral, address, "write")
            return
        offset = address - peripheral.base
        if size != 4 and peripheral.whole_words:
            shift, mask = 8 * (offset & 3), (1 << 8 * size) - 1
            offset &= ~3
            value = (peripheral.read(offset, 4) & ~(mask << shift)) | (value & mask) << shift
        peripheral.write(offset, size, value)

    def _refuse(self, peripheral: Peripheral | None, address: int, what: str) -> int:
        if peripheral is None:
            self.record.unmodelled[f"{what} 0x{address:08X}"] += 1
        else:
            self.record.clock_off[f"{what} {peripheral.name}"] += 1
        return 0
