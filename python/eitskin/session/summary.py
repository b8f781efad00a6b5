"""The summary of a session."""

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from eitskin.device.client import Device
from eitskin.device.wire.packets import BoardStats, Fault
from eitskin.errors import DeviceError
from eitskin.session.frame import DriveReport, Frame, Message
from eitskin.session.sample import Sample


@dataclass
class Summary:
    """Counts of messages. Times are the board's own, in us: solve and touches of each solved
    frame."""

    frames: int = 0
    drives: int = 0
    refused: int = 0
    faults: int = 0
    first_us: int = 0
    last_us: int = 0
    solve_us: Sample = field(default_factory=Sample)
    link: dict[str, int] = field(default_factory=dict)
    board: BoardStats | None = None

    def add(self, message: Message) -> None:
        if isinstance(message, DriveReport):
            self.drives += 1
        elif isinstance(message, Frame):
            self._add_frame(message)
        elif isinstance(message.cause, Fault):
            self.faults += message.cause.raised

    def _add_frame(self, frame: Frame) -> None:
        if not self.frames:
            self.first_us = frame.time_us
        self.frames += 1
        self.last_us = frame.time_us
        if frame.info is not None:
            self.refused += frame.info.status != 0
            self.solve_us.add(frame.info.solve_us + frame.info.touch_us)

    @property
    def rate_hz(self) -> float | None:
        """Streamed frames per second of the board's time."""
        span = self.last_us - self.first_us
        return 1e6 * (self.frames - 1) / span if span > 0 else None

    @property
    def solve_quantiles_us(self) -> tuple[float, float] | None:
        """Median and 99th percentile; None if nothing was solved, or the board measures no times (a
        simulated one)."""
        if self.solve_us.largest <= 0:
            return None
        return self.solve_us.quantile(0.5), self.solve_us.quantile(0.99)

    def as_dict(self) -> dict[str, Any]:
        quantiles = self.solve_quantiles_us or (None, None)
        return {
            "frames": self.frames,
            "drives": self.drives,
            "refused": self.refused,
            "faults": self.faults,
            "frames_a_second": self.rate_hz,
            "solve_us_p50": quantiles[0],
            "solve_us_p99": quantiles[1],
            "link": self.link,
            "board": None if self.board is None else self.board.as_dict(),
        }

    def lines(self) -> list[str]:
        rate = "" if self.rate_hz is None else f", {self.rate_hz:.1f} a second of the board's time"
        link = self.link
        gaps, missing, dropped = (link.get(name, 0) for name in ("gaps", "missing", "dropped"))
        text = f"{self.frames} frames{rate}; {gaps} gaps ({missing} packets missing)"
        text += f", {dropped} dropped here"
        if link.get("lines_skipped"):
            text += f", {link['lines_skipped']} lines skipped"
        if self.board is not None:
            text += f", {self.board.packets_dropped} dropped by the board"
        lines = [text]
        if self.drives:
            lines.append(f"touches were reported after {self.drives} drives")
        if self.solve_quantiles_us is not None:
            p50, p99 = self.solve_quantiles_us
            lines.append(
                f"solve and touches on the board: p50 {p50 / 1e3:.2f} ms, p99 {p99 / 1e3:.2f} ms"
            )
        if self.faults:
            lines.append(f"{self.faults} faults were reported")
        if self.refused:
            lines.append(f"{self.refused} frames refused by the board's core")
        return lines

    def finish(self, device: Device, limit_s: float) -> None:
        """Add the counters of the link and of the board. Those of a board that does not answer
        within ``limit_s`` are left out; with 0 it is not asked."""
        self.link = device.counters.as_dict()
        self.board = None
        if limit_s and not (device.replays or device.link.ended or device.link.away):
            with suppress(DeviceError):
                self.board = device.bounded(limit_s, device.stats)
