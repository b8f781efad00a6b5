"""The work of an emulated board in numbers, for tests and for curious users."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class BoardReport:
    """Since power came.

    Attributes:
        time_s, asleep_s: of the board, and of it in WFI.
        instructions: executed.
        generator_hz, mclk_hz: the AD9833's output, as decoded from what was shifted into it, and
            its clock.
        scans, samples, switches: begun, taken by the converter, and changes of what the
            multiplexers join.
        violations: multiplexers that may have joined two electrodes.
        unknown_rows: electrodes that were joined though the scene's protocol has no such row, with
            how often.
        interrupts: by exception number (IRQ n is 16 + n).
        unmodelled, clock_off, hazards, faults, resets: as ``record.Record``.
    """

    time_s: float
    asleep_s: float
    instructions: int
    generator_hz: float
    mclk_hz: int
    scans: int
    samples: int
    switches: int
    violations: tuple[str, ...]
    unknown_rows: dict[str, int]
    interrupts: dict[int, int]
    unmodelled: dict[str, int]
    clock_off: dict[str, int]
    hazards: dict[str, int]
    faults: tuple[str, ...]
    resets: tuple[str, ...]

    @property
    def clean(self) -> bool:
        """Return whether no access was unknown, unclocked, forbidden or wrong; requested restarts
        are not wrong."""
        return not (
            self.violations
            or self.unknown_rows
            or self.unmodelled
            or self.clock_off
            or self.hazards
            or self.faults
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)
