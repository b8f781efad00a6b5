"""What the firmware refuses of a command by itself, and how it times a scan;
docs/reference/link-protocol.md lists the limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from eitskin.core.findings import ALL_FINDINGS
from eitskin.core.results import MAX_TOUCHES, SOLVERS
from eitskin.device.wire.commands import Command, ModelData, Scan, Solver
from eitskin.device.wire.packets import ReplyStatus as Status

SWITCH_US = 3
MOST_INT = 2**31 - 1


@dataclass(frozen=True)
class Answer:
    """A reply without its request."""

    status: Status
    detail: tuple[int, int] = (0, 0)


OK = Answer(Status.OK)


def outside(offset: int, value: int, low: int, high: int) -> Answer | None:
    """RANGE where the field at ``offset`` is not between ``low`` and ``high``."""
    if low <= value <= high:
        return None
    return Answer(Status.RANGE, (offset, low if value < low else high))


def check_size(kind: type[Command], payload: bytes) -> Answer | None:
    """LENGTH where a payload has another length than its command's."""
    size = kind.LAYOUT.size
    if kind is ModelData:
        return None if len(payload) > size else Answer(Status.LENGTH, (size + 4, 0))
    return None if len(payload) == size else Answer(Status.LENGTH, (size, 0))


def slot_us(scan: Scan) -> int:
    """From one measurement to the next: burst, settling, switching; made a whole number of
    excitation periods where that costs at most a quarter more."""
    burst = -(-scan.samples * 1_000_000 // scan.sample_rate_hz)
    least = burst + scan.settle_us + SWITCH_US
    for us in range(least, least + least // 4 + 1):
        if us * scan.excitation_millihz % 1_000_000_000 == 0:
            return us
    return least


def check_scan(scan: Scan, rows: int) -> Answer | None:
    """What is wrong with scan settings, for ``rows`` measurements in the longest frame (0: no
    model)."""
    bad = (
        outside(4, scan.excitation_millihz, 1000, 250_000_000)
        or outside(8, scan.sample_rate_hz, 1000, 5_000_000)
        or outside(12, scan.samples, 4, 1024)
        or outside(14, scan.settle_us, 0, 50_000)
        or outside(18, scan.reserved, 0, 0)
        or outside(20, scan.frame_period_us, 0, 600_000_000)
    )
    if bad is not None:
        return bad
    half = scan.sample_rate_hz * 500
    if scan.excitation_millihz >= half:
        return Answer(Status.RANGE, (4, half - 1))
    rate = scan.sample_rate_hz * 1000
    if scan.excitation_millihz * scan.samples % rate:
        unit = rate // math.gcd(rate, scan.excitation_millihz)
        nearest = unit * max((scan.samples + unit // 2) // unit, 1)
        return Answer(Status.PERIODS, (min(nearest, MOST_INT), 0))
    least = rows * slot_us(scan)
    if scan.frame_period_us and scan.frame_period_us < least:
        return Answer(Status.TOO_FAST, (min(least, MOST_INT), 0))
    return None


def check_solver(command: Solver) -> Answer | None:
    """What is wrong with solver options."""
    bad = (
        outside(4, command.iterations, 1, 1000)
        or outside(8, command.max_touches, 0, MAX_TOUCHES)
        or outside(12, command.warm_start, 0, 1)
        or outside(16, command.sign, 0, 2)
    )
    if bad is not None:
        return bad
    for offset, value in ((20, command.lambda_rel), (24, command.gap_rel)):
        if not 0 <= value <= 1:
            return Answer(Status.RANGE, (offset, 1 if value > 1 else 0))
    found = outside(28, command.solver, 0, len(SOLVERS) - 1) or outside(
        36, command.findings, 0, ALL_FINDINGS
    )
    return found or outside(40, command.track, 0, 1)
