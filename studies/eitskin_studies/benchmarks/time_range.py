"""A frame's time on the board as a range: the firmware on the emulated NUCLEO-F767ZI, its time
bounded from below and from above.

``eitskin_emulator.timing.bounds`` has the constants with their sources. Stages are those that the
firmware itself measures, by the clock of the bound; interrupts that come during a stage are in it.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.device.client import Device
from eitskin.device.settings import ScanSettings, apply_scan
from eitskin.device.wire.link_table import Stream
from eitskin.errors import ConfigError, DeviceError
from eitskin_studies.harness.numbers import stored_filling
from eitskin_studies.harness.sections import Filling, Tabular, text_table

TARE_FRAMES, BEFORE_FRAMES = 8, 2
SCANS = ((1, "208 rows"), (0, "104 rows"))
STAGES = {
    "demodulate": "interrupts of the scan",
    "solve": "solve",
    "touches": "touches",
    "send": "send",
}


@dataclass(frozen=True)
class BoundedFrame:
    """Frames of one image by one bound, microseconds; the greatest of ``frames``. ``late``: slots
    that were measured again because the switch came too late, per frame."""

    image: str
    scan: str
    bound: str
    acquire_us: int
    stage_us: dict[str, int]
    switch_mean_us: float
    switch_most_us: float
    switch_allowed_us: float
    late: float

    @property
    def solving_us(self) -> int:
        """Solve and touches, the interrupts of the scan included."""
        return self.stage_us["solve"] + self.stage_us["touches"]

    @property
    def rate_hz(self) -> float:
        """Frames per second: the slower of acquisition and solving."""
        return 1e6 / max(self.acquire_us, self.solving_us)


@dataclass(frozen=True)
class TimeRange:
    """All that ``eitskin bench time`` measures."""

    scene: str
    frames: int
    rows: tuple[BoundedFrame, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def run(images: dict[str, Path | None], frames: int, scene: str = "two_touch") -> TimeRange:
    """Measure ``frames`` frames of each image (None: the one that ships), full and reciprocal, by
    both bounds.

    Raises:
        DeviceError: an image gives no frames.
    """
    from eitskin_emulator.timing.bounds import OPTIMISTIC, PESSIMISTIC

    rows = [
        _bounded(name, path, check_every, scan, bound, frames, scene)
        for name, path in images.items()
        for check_every, scan in SCANS
        for bound in (OPTIMISTIC, PESSIMISTIC)
    ]
    return TimeRange(scene, frames, tuple(rows))


def _bounded(
    name: str, path: Path | None, check_every: int, scan: str, bound: Any, frames: int, scene: str
) -> BoundedFrame:
    from eitskin_emulator.timing.bounded_time import BoundedTime
    from eitskin_emulator.timing.switching import watch_switching
    from eitskin_emulator.transport import open_emulated

    transport = open_emulated(scene, image=path)
    with Device(transport) as device:
        apply_scan(device, ScanSettings(check_every=check_every))
        device.tare(TARE_FRAMES)
        device.start_scene()
        _watch(device, BEFORE_FRAMES)
        device.stats(reset=True)
        timed = BoundedTime(transport.board, bound)
        with watch_switching(transport.board) as switching:
            _watch(device, frames)
        timed.detach()
        stats, info = device.stats(), device.board
    times = stats.stages
    after_us = np.array(switching.after_us)
    return BoundedFrame(
        name,
        scan,
        bound.name,
        max(info.measured_rows * info.slot_us, times["scan"].worst_us),
        {stage: times[stage].worst_us for stage in STAGES},
        float(after_us.mean()),
        float(after_us.max()),
        switching.allowed_us,
        stats.slots_repeated / max(times["scan"].count, 1),
    )


def _watch(device: Device, frames: int) -> None:
    seen = sum(1 for _ in device.stream(Stream.TOUCHES, frames=frames))
    if not seen:
        raise DeviceError("the emulated board gives no frames")


# ---- tables ----

HEAD = (
    "firmware", "rows", "interrupts of the scan, ms", "solve, ms", "touches, ms", "send, ms",
    "acquisition, ms", "frames a second", "switched after, µs", "of", "late rows a frame",
)  # fmt: skip


def _range(low: float, high: float, digits: int) -> str:
    return f"{low:.{digits}f} to {high:.{digits}f}"


def table(result: TimeRange) -> Tabular:
    """One row for each image and scan: from the optimistic to the pessimistic bound."""
    rows = []
    for low, high in zip(result.rows[::2], result.rows[1::2], strict=True):
        stages = [
            _range(low.stage_us[stage] / 1e3, high.stage_us[stage] / 1e3, 2) for stage in STAGES
        ]
        rows.append(
            (
                low.image, low.scan, *stages,
                _range(low.acquire_us / 1e3, high.acquire_us / 1e3, 1),
                _range(high.rate_hz, low.rate_hz, 0),
                _range(low.switch_most_us, high.switch_most_us, 2),
                f"{low.switch_allowed_us:.1f}",
                _range(low.late, high.late, 0),
            )
        )  # fmt: skip
    return HEAD, rows


def as_text(result: TimeRange) -> str:
    """For a terminal."""
    return text_table(*table(result))


def for_page(result: TimeRange, command: str) -> Filling:
    """The marks of studies/results/board-cost.md."""
    now = [one for one in result.rows if one.image == result.rows[-1].image]
    worst = max(now, key=lambda one: one.switch_most_us)
    half = next(one for one in now if one.scan == SCANS[1][1] and one.bound == "pessimistic")
    text = (
        f"By `{command}`: the greatest of {result.frames} frames of `emu:{result.scene}`, from the"
        f" optimistic to the pessimistic bound. By the pessimistic bound the multiplexers have"
        f" switched at most {worst.switch_most_us:.2f} µs after a burst's last sample; a slot of"
        f" 100 µs leaves {worst.switch_allowed_us:.1f} µs for it. By this bound 104 rows"
        f" are solved at {half.rate_hz:.0f} frames per second."
    )
    return {"time-run": text}, {"time": table(result)}


def stored_ratios(path: Path) -> tuple[float, float]:
    """The optimistic and the pessimistic bound of the time of solve and touches, over the time at
    an instruction per cycle: half scans in f32, by the stored numbers of board-cost.md.

    Raises:
        FileError, ConfigError: the file cannot be read, or lacks one of the numbers.
    """
    _, (_, tables) = stored_filling(path)
    try:
        bounded = _row(tables["time"], {"firmware": "now", "rows": SCANS[1][1]})
        low, high = (
            sum(float(bounded[f"{stage}, ms"].split(" to ")[k]) for stage in ("solve", "touches"))
            for k in (0, 1)
        )
        rate = _row(tables["rates"], {"storage": "f32", "rows x samples": "104 x 80"})
        plain = float(rate["worst"].removesuffix(" ms"))
    except (KeyError, ValueError, IndexError, StopIteration):
        raise ConfigError(
            f"{path}: lacks times of half scans; run  studies/run board-cost time"
        ) from None
    return low / plain, high / plain


def _row(table: Tabular, cells: dict[str, str]) -> dict[str, str]:
    head, rows = table
    named = (dict(zip(head, row, strict=True)) for row in rows)
    return next(row for row in named if cells.items() <= row.items())
