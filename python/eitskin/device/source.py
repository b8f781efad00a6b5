"""Frames of another instrument: the interface of a source, and the transport that feeds its frames
to the board's own application, so that tare, stream, record and all other commands work as with a
board.

A source of your own is a class with ``read``; the entry point group ``eitskin.sources`` gives it a
scheme (docs/guide/your-board.md).
"""

import threading
import time
import zlib
from collections import deque
from dataclasses import dataclass, replace
from importlib.metadata import entry_points

import numpy as np

from eitskin.arrays import AnyArray, BoolArray
from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.device.host_board import GivenBoard
from eitskin.device.transport import Capabilities, LinkEvent, Transport
from eitskin.errors import EitskinError, FrameError, UsageError
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.threads import FairLock

GROUP = "eitskin.sources"
POLL_S = 0.02
PERIOD_US = 20_000  # if nothing else is known
MAX_GAP_S = 60.0
SILENT_S, SILENT_PERIODS = 1.0, 4  # until it is a fault that no frame comes
LOOKED_AT = 4  # frames of a tare that show which rows cannot be used
NAMED = 8  # rows that are named in a message
PERIODS = 16  # frame periods that the reported rate is the mean of


@dataclass(frozen=True, eq=False)
class GivenFrame:
    """A frame: ``voltage_v`` (m,), real or complex, in the model's rows, NaN if a row cannot be
    used; ``time_s`` by the instrument's clock, where it sends one; ``came_s``: when it came, by
    ``time.monotonic``, where that is not now."""

    voltage_v: AnyArray
    time_s: float | None = None
    came_s: float | None = None


class Source:
    """Frames of an instrument. A source of your own is a subclass with ``read``.

    Attributes:
        name: in messages and in INFO, where 15 characters of it are shown.
        synchronous: frames come whenever they are asked for, as from a file.
        keeps: frames that nobody wants yet wait, as in a pipe; else they are lost.
        ended: no frame will come again.
        period_s: from frame to frame, where it is known.
        offset, scale: see ``Capabilities``.
    """

    name = "source"
    synchronous = False
    keeps = False
    ended = False
    period_s: float | None = None
    offset, scale = 0.0, 1.0

    def use_model(self, model: Model) -> None:
        """The board uses ``model`` from now on: give frames in its rows.

        Raises:
            EitskinError: the instrument cannot.
        """

    def read(self, timeout_s: float) -> list[GivenFrame]:
        """The frames that have come, after at most ``timeout_s``; at most one of a source that is
        synchronous or keeps them.

        Raises:
            DeviceError: the instrument is gone.
        """
        raise NotImplementedError

    def take_events(self) -> list[LinkEvent]:
        """Return the events of the instrument since the last call."""
        return []

    def reopen(self) -> bool:
        """Try once to find an instrument that is gone again."""
        return False

    def close(self) -> None:
        """Close the source; may be called twice."""


class SourceTransport(Transport):
    """The application, built for this host, that gets a source's frames. ``model`` goes into its
    first bank (None: the prebuilt one).

    A tare needs all rows that are not masked. Rows that cannot be used in at least half of its
    first frames are therefore masked until the next tare; a single reading that is missing later is
    replaced by the mean of its row, so that it does not change the reference.
    """

    def __init__(self, url: str, source: Source, model: bytes | None = None) -> None:
        self.url, self.source = url, source
        self._passed: deque[int] = deque(maxlen=PERIODS)
        blob = load_prebuilt()[1] if model is None else model
        empty = bytes([ERASED]) * BANK_BYTES
        serial = f"{zlib.crc32(url.encode()):08X}"
        short = url.partition(":")[0].encode("ascii", "replace")[:15].decode()
        self.board = GivenBoard(
            short, serial, [bank_bytes(blob, 1), empty], period_us=self._period_us()
        )
        self._lock = FairLock()  # a command gets its turn between two frames, also in a flood
        self._written = threading.Event()
        self._rows = self._given = 0
        self._board_s = self._last_s = time.monotonic()  # of the board's clock, of the last frame
        self._last_time_s: float | None = None
        self._tare: _TareRows | None = None  # of the tare that is under way
        self._left_out: set[int] = set()  # rows that were masked here
        self._events: list[LinkEvent] = []
        try:
            self._use_model()
        except BaseException:
            source.close()
            raise

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.source.name

    @property
    def capabilities(self) -> Capabilities:
        source = self.source
        return Capabilities(
            own_clock=source.synchronous, offset=source.offset, scale=source.scale, instrument=True
        )

    @property
    def ended(self) -> bool:  # type: ignore[override]
        return self.source.ended

    def read(self, timeout_s: float) -> bytes:
        with self._lock:
            output = self.board.take_output()
            if output or (self.source.synchronous and not self.board.wanted):
                return output
        if self.ended:
            return self._after_the_end(timeout_s)
        if self.source.keeps and not self.board.wanted:
            self._await_command(timeout_s)
            return self._output()
        if self.source.synchronous:
            while not output and not self.ended and self.board.wanted:
                self._give(self.source.read(0.0))
                output = self._output()
            return output
        self._give(self.source.read(min(timeout_s, POLL_S)))
        return self._output()

    def begin(self) -> None:
        """Pass on the frames that have come already, so that the board knows their period."""
        if not self.source.synchronous and not self.source.keeps:
            self._give(self.source.read(0.0))

    def _after_the_end(self, timeout_s: float) -> bytes:
        """Commands are still answered; a tare fails."""
        if not self.source.synchronous:
            self._await_command(timeout_s)
        with self._lock:
            if self._tare is not None and self.board.tares:
                self._give_held(self._tare)
            if self.board.tares:
                self.board.let_pass(round(1e6 * SILENT_S))
            return self.board.take_output()

    def write(self, data: bytes) -> None:
        with self._lock:
            self.board.receive(data)
        self._written.set()

    def take_events(self) -> list[LinkEvent]:
        with self._lock:
            events, self._events = self._events, []
        return self.source.take_events() + events

    def reopen(self) -> bool:
        return self.source.reopen()

    def close(self) -> None:
        self.source.close()

    def _await_command(self, timeout_s: float) -> None:
        self._written.wait(timeout_s)
        self._written.clear()

    def _output(self) -> bytes:
        with self._lock:
            return self.board.take_output()

    def _give(self, frames: list[GivenFrame]) -> None:
        now = time.monotonic()
        if not frames:
            with self._lock:
                self._miss(now)
        for frame in frames:
            with self._lock:
                self._give_one(frame, now)

    def _give_one(self, frame: GivenFrame, now: float) -> None:
        self._use_model()
        if frame.voltage_v.shape != (self._rows,):
            raise FrameError(
                f"{self.name}: a frame of shape {frame.voltage_v.shape}; the model has"
                f" {self._rows} rows"
            )
        came_s = now if frame.came_s is None else frame.came_s
        frame = replace(frame, came_s=came_s)
        if not self.board.tares:
            self._pass_on(frame, came_s)
            return
        if self._tare is None:
            self._tare = _TareRows()
        if self._tare.looks:
            self._tare.held.append(frame)
            if len(self._tare.held) == LOOKED_AT:
                self._give_held(self._tare)
        else:
            self._pass_on(self._tare.filled(frame), came_s)

    def _give_held(self, tare: "_TareRows") -> None:
        """Mask the rows that the frames looked at cannot use, and pass those frames on."""
        bad = set(np.flatnonzero(tare.look()).tolist())
        for row in self._left_out - bad:
            self.board.mask_row(row, False)
        masked_before = {row for row in bad if self.board.mask_row(row, True)}
        self._left_out = (self._left_out & bad) | (bad - masked_before)
        if bad:
            self._events.append(LinkEvent("rows", len(bad), _left_out_text(bad, self._rows)))
        held, tare.held = tare.held, []
        for frame in held:
            assert frame.came_s is not None
            self._pass_on(tare.filled(frame), frame.came_s)

    def _pass_on(self, frame: GivenFrame, came_s: float) -> None:
        passed_us = self._passed_us(frame, came_s)
        self.board.give(frame.voltage_v, passed_us, self._period_us(passed_us))
        self._board_s = self._last_s = came_s
        self._given += 1
        if not self.board.tares:
            self._tare = None

    def _use_model(self) -> None:
        model = self.board.new_model()
        if model is not None:
            self.source.use_model(model)
            self._rows = model.protocol.n_rows

    def _miss(self, now: float) -> None:
        """If no frame comes for long, advance the board's clock, so that it reports the silence."""
        if self.source.synchronous:
            return
        limit = max(SILENT_S, SILENT_PERIODS * self._period_us() / 1e6)
        if now - self._last_s > limit and now - self._board_s > SILENT_S:
            self.board.let_pass(round(1e6 * (now - self._board_s)))
            self._board_s = now

    def _passed_us(self, frame: GivenFrame, now: float) -> int:
        """Return the time since the frame before, by the instrument's clock if it has one, else by
        the host's."""
        last, self._last_time_s = self._last_time_s, frame.time_s
        if frame.time_s is not None and last is not None and 0 < frame.time_s - last < MAX_GAP_S:
            return round(1e6 * (frame.time_s - last))
        if self.source.synchronous or frame.time_s is not None or not self._given:
            return self._period_us()
        return max(round(1e6 * (now - self._board_s)), 1)

    def _period_us(self, passed_us: int | None = None) -> int:
        """The mean time between the last frames, ``passed_us`` the newest."""
        if self.source.period_s is not None:
            return max(round(1e6 * self.source.period_s), 1)
        if passed_us is not None and self._given:
            self._passed.append(passed_us)
        return max(round(sum(self._passed) / len(self._passed)), 1) if self._passed else PERIOD_US


class _TareRows:
    """The rows of a tare's frames: which of them cannot be used, and the means of the others."""

    def __init__(self) -> None:
        self.held: list[GivenFrame] = []
        self.looks = True

    def look(self) -> BoolArray:
        """The rows (m,) that cannot be used in half of the frames that are held, or more."""
        values = np.array([frame.voltage_v for frame in self.held])
        usable = np.isfinite(values)
        self.looks = False
        self._count = usable.sum(axis=0)
        self._sum = np.where(usable, values, 0.0).sum(axis=0)
        return np.asarray(2 * self._count <= len(values))

    def filled(self, frame: GivenFrame) -> GivenFrame:
        """``frame`` with the mean of the row in place of each reading that is missing."""
        missing = ~np.isfinite(frame.voltage_v) & (self._count > 0)
        if not missing.any():
            return frame
        mean = self._sum / np.maximum(self._count, 1)
        return replace(frame, voltage_v=np.where(missing, mean, frame.voltage_v))


def _left_out_text(bad: set[int], rows: int) -> str:
    named = ", ".join(str(row) for row in sorted(bad)[:NAMED])
    more = f" and {len(bad) - NAMED} others" if len(bad) > NAMED else ""
    which = f"row {named} (from 0) of {rows} cannot be used and is"
    if len(bad) > 1:
        which = f"{len(bad)} of {rows} rows cannot be used, {named}{more} (from 0), and are"
    rest = "; too few rows are left, repair the instrument or its layout"
    rest = rest if 2 * len(bad) > rows else ""
    return f"{which} left out of the reference and of the frames{rest}"


def source_schemes() -> tuple[str, ...]:
    """Schemes that installed packages bring."""
    return tuple(sorted(point.name for point in entry_points(group=GROUP)))


def open_source(url: str, *, model: bytes | None = None) -> Transport:
    """Open the source behind ``url``, whose scheme another package defines: its entry point is
    called with the text after the colon, and returns a ``Source`` or a transport.

    Raises:
        UsageError: it cannot be loaded, fails, or gives something else.
        EitskinError: whatever the source itself raises.
    """
    scheme, _, rest = url.partition(":")
    point = next(iter(entry_points(group=GROUP, name=scheme)))
    try:
        made = point.load()(rest)
    except EitskinError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())
        raise UsageError(
            f"device {url!r}: the source {point.value} failed ({type(error).__name__}: {reason});"
            " repair it, or leave it to its package's own test"
        ) from None
    if isinstance(made, Source):
        return SourceTransport(url, made, model)
    if isinstance(made, Transport):
        return made
    raise UsageError(
        f"device {url!r}: {point.value} gives {type(made).__name__}; a source gives"
        " eitskin.device.source.Source"
    )
