"""A board's commands with their answers, and its streams, for any kind of device."""

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from eitskin.core.diagnostics import names
from eitskin.core.options_table import CHOICES
from eitskin.core.results import Options, check_options
from eitskin.device.exchange import ANSWER_S, CommandExchange
from eitskin.device.fitting import unserved
from eitskin.device.link import Streamed
from eitskin.device.pacing import Pacer
from eitskin.device.streaming import LEAVE_S, packet_stream
from eitskin.device.timing import check_name
from eitskin.device.upload import upload
from eitskin.device.wire import link_table as commands
from eitskin.device.wire.explain import found_touched, reply_text
from eitskin.device.wire.link_table import Setting, Stream
from eitskin.device.wire.packets import (
    BoardHashes,
    BoardInfo,
    BoardStats,
    ProbedBurst,
    RawFrame,
    SolvedTouches,
)
from eitskin.errors import DeviceError, SkinTouchedError, UsageError
from eitskin.threads import OneThreadAtATime

TARE_FRAMES = 16
LOOK_FRAMES = 2  # that show whether something touches the skin
LOOK_CONFIDENCE = 0.7
# with these, what looks like a touch may come of a reference that does not fit any more
LOOK_UNSURE = {"model mismatch", "stale reference", "unlike the model"}


def _asked_millihz(info: BoardInfo) -> int:
    """The excitation that the board was asked for: a whole number of its periods fills a burst.
    INFO reports what the generator makes of it, which is not quite the same."""
    rate_millihz = 1000 * info.sample_rate_hz
    periods = round(info.excitation_millihz * info.samples / rate_millihz)
    return periods * rate_millihz // info.samples


def _electrodes(row: Sequence[int] | None) -> int:
    if row is None:
        return commands.PROBE_OPEN
    if len(row) != 4 or not all(0 <= one <= 255 for one in row):
        raise UsageError(f"electrodes {list(row)}: give four, those of I+, I-, V+ and V-")
    return sum(int(one) << 8 * k for k, one in enumerate(row))


def check_tare_frames(frames: int) -> int:
    """Return ``frames`` if a board can take its reference from that many frames, else raise
    UsageError."""
    if frames != 1 and not 4 <= frames <= 1024:
        raise UsageError(f"a tare of {frames} frames cannot be; use 1, or 4 to 1024")
    return frames


class Device(CommandExchange):
    """All commands and requests that a board takes; ``open_device`` makes one from a URL. Raises as
    ``CommandExchange``. ``pacer`` holds frames back as ``?speed=`` of the URL says."""

    pacer: Pacer | None = None
    can_undo_tare = False  # as far as this program knows

    # ---- commands ----

    def stats(self, *, reset: bool = False) -> BoardStats:
        """The board's statistics; ``reset`` begins them again."""
        answer = self.ask(commands.GetStats(int(reset)), ANSWER_S)
        assert isinstance(answer, BoardStats)
        return answer

    def tare(self, frames: int = TARE_FRAMES, *, anyway: bool = False) -> None:
        """Take the reference from ``frames`` (1, or 4 to 1024) frames of the untouched skin.

        Before that, a board with a reference shows whether something touches the skin;
        ``anyway`` leaves that out. Whether something moves while the reference is taken is always
        examined.

        Raises:
            UsageError: another number of frames.
            SkinTouchedError: something touches the skin or moves on it; the last reference stays.
            DeviceError: the board refuses, or its core the frames; where source and amplifier do
                not serve the skin, it names the part to change.
        """
        check_tare_frames(frames)
        wait_s = 3.0 + 2e-6 * max(self.board.frame_us, 1000) * (frames + 4)
        with self.asking:
            if not anyway:
                self.check_untouched()
            self._tare(frames, wait_s)
            self.can_undo_tare = bool(self.board.tared)
            self.board = replace(self.board, tared=1)

    def _tare(self, frames: int, wait_s: float) -> None:
        reply = self.send_command(commands.Tare(frames), wait_s)
        if reply.ok:
            return
        text = f"{self.transport.name}: {reply_text(reply)}"
        wrong = self.unserved()  # rows that clip can look like touches
        if wrong is None and found_touched(reply):
            raise SkinTouchedError(text)
        raise DeviceError(f"{text}; {wrong}" if wrong else text)

    def check_untouched(self) -> None:
        """Look for touches by the reference that the board has. Without one, or while somebody
        reads the frames, nothing is examined. Touches that a poor reference may cause do not count.

        Raises:
            SkinTouchedError: something touches the skin.
        """
        if not self.board.tared or not self.reader.idle:
            return
        seen = [
            item
            for item in self.stream(Stream.TOUCHES, frames=LOOK_FRAMES)
            if isinstance(item, SolvedTouches)
        ]
        if not seen or LOOK_UNSURE & set(names(seen[-1].solved.diagnostics)):
            return
        places = [
            f"({touch.x_mm:.0f}, {touch.y_mm:.0f}) mm"
            for touch in seen[-1].touches
            if touch.confidence is None or touch.confidence >= LOOK_CONFIDENCE
        ]
        if places:
            raise SkinTouchedError(
                f"{self.transport.name}: something touches the skin at {', '.join(places)}; lift"
                " it, and take the reference then"
            )

    def undo_tare(self) -> None:
        """Restore the reference that the last tare replaced; results with the new one do not
        change.

        Raises:
            DeviceError: the board does not keep it: there was none, it has been brought back
                already, or scan, model or masked rows have changed since.
        """
        with self.asking:
            self.can_undo_tare = False
            self.command(commands.Tare(0), ANSWER_S)

    def unserved(self) -> str | None:
        """Return what source and amplifier do not serve of the skin, and which part to change.

        None: they serve it, or the board does not know. It takes a raw frame, unless somebody reads
        the frames."""
        if not self.board.gain_ppm or not self.reader.idle:
            return None
        raw = [item for item in self.stream(Stream.RAW, frames=3) if isinstance(item, RawFrame)]
        return unserved(self.board, raw[-1]) if raw else None  # two were measured before

    def start_scene(self) -> int | None:
        """Begin the touches of the scene on a simulated or emulated board; call it after ``tare``.
        Does nothing on a real board. Returns as ``Transport.begin_scene``."""
        return self.link.begin_scene()

    def scan(
        self,
        *,
        excitation_hz: float | None = None,
        sample_rate_hz: int | None = None,
        samples: int | None = None,
        settle_us: int | None = None,
        check_every: int | None = None,
        frame_period_us: int | None = None,
    ) -> BoardInfo:
        """Change the scan; settings that are not given stay. The reference is discarded.

        Raises:
            UsageError: a number is negative or does not fit its field.
            DeviceError: the board cannot do it; it keeps what it had.
        """
        with self.asking:
            return self._scan(
                excitation_hz, sample_rate_hz, samples, settle_us, check_every, frame_period_us
            )

    def _scan(
        self,
        excitation_hz: float | None,
        sample_rate_hz: int | None,
        samples: int | None,
        settle_us: int | None,
        check_every: int | None,
        frame_period_us: int | None,
    ) -> BoardInfo:
        now = self.board
        if now.frames_given:
            raise DeviceError(
                f"{self.transport.name}: its frames are another instrument's, whose scan cannot be"
                " set from here; leave the options of the scan out"
            )
        command = commands.Scan(
            excitation_millihz=(
                _asked_millihz(now) if excitation_hz is None else round(1000 * excitation_hz)
            ),
            sample_rate_hz=now.sample_rate_hz if sample_rate_hz is None else sample_rate_hz,
            samples=now.samples if samples is None else samples,
            settle_us=now.settle_us if settle_us is None else settle_us,
            check_every=now.check_every if check_every is None else check_every,
            reserved=0,
            frame_period_us=now.frame_period_us if frame_period_us is None else frame_period_us,
        )
        self.command(command, 2 * ANSWER_S)
        self.can_undo_tare = False
        return self.info()

    def solver(self, options: Options) -> None:
        """Give the board's solver these of ``options``: iterations, max_touches, warm_start, sign,
        lambda_rel, gap_rel, solver, mac_limit and diagnostics.

        Raises:
            UsageError: one is out of its range.
            DeviceError: the board refuses; it keeps what it had.
        """
        check_options(options)
        self.command(
            commands.Solver(
                options.iterations, options.max_touches, int(options.warm_start),
                CHOICES["sign"][options.sign],
                options.lambda_rel, options.gap_rel, CHOICES["solver"][options.solver],
                options.mac_limit,
                options.diagnostics,
            ),
            ANSWER_S,
        )  # fmt: skip

    def mask_row(self, row: int, *, masked: bool = True) -> None:
        """Leave protocol row ``row`` out of every frame, or use it again from the next tare on."""
        self.command(commands.MaskRow(row, int(masked)), ANSWER_S)
        self.can_undo_tare = False

    def self_test(self) -> None:
        """Let the board run its model's golden frame.

        Raises:
            DeviceError: the image has other bits than the model states.
        """
        self.command(commands.SelfTest(), 10.0)
        self.can_undo_tare = False

    def hashes(self) -> BoardHashes:
        """SHA-256 of the model in use and of the program, as the board's flash has them; of a
        recording as they were."""
        noted = self.transport.known_hashes
        if noted is not None:
            return noted
        answer = self.ask(commands.GetHashes(), 2 * ANSWER_S)
        assert isinstance(answer, BoardHashes)
        return answer

    def settings(
        self,
        settings: Setting,
        current_limit_ua_rms: int | None = None,
        name: str | None = None,
        source_ua: int | None = None,
        gain: float | None = None,
    ) -> BoardInfo:
        """Give the board all of its owner's settings, which it keeps in flash; the current stops.
        The limit counts where a sense resistor is fitted; 0: 1.25 times what the source gives,
        None: as it is. ``name`` is the board's, in messages and topics; "": none, None: as it is.
        ``source_ua``, the amplitude of the current source, and ``gain``, volts at the converter
        per volt between the electrodes, are what its parts give; 0: as designed, None: as it is.
        Others than before make the board forget its reference.

        Raises:
            UsageError: a number does not fit, or the name cannot be used.
            DeviceError: the board is locked and nobody holds its button, or keeps no settings.
        """
        limit = commands.KEPT if current_limit_ua_rms is None else current_limit_ua_rms
        with self.asking:
            named = self.board.name if name is None else name and check_name(name, "name")
            source = commands.KEPT if source_ua is None else source_ua
            gain_ppm = commands.KEPT if gain is None else round(gain * 1e6)
            wanted = commands.Settings(int(settings), limit, named, source, gain_ppm)
            self.command(wanted, 10.0)
            return self.info()

    def probe(
        self,
        joined: Sequence[int] | None,
        *,
        before: Sequence[int] | None = None,
        settle_us: int = 1000,
        samples: int = 1000,
        generator: bool = True,
    ) -> ProbedBurst:
        """Take one burst of a fixed row: the converter's codes while ``joined`` (I+, I-, V+, V-;
        None: all open) are connected, from ``settle_us`` after the switch from ``before`` on. The
        scan waits meanwhile. Current flows if the ``generator`` runs.

        Raises:
            UsageError: an electrode is out of range.
            DeviceError: the board cannot do it.
        """
        answer = self.ask(
            commands.Probe(
                _electrodes(before), _electrodes(joined), settle_us, samples, int(generator), 0
            ),
            ANSWER_S,
        )
        assert isinstance(answer, ProbedBurst)
        return answer

    def clear_faults(self) -> None:
        """Clear the faults that the board has raised; those that persist are raised again."""
        self.command(commands.ClearFaults(), ANSWER_S)

    def reset(self) -> BoardInfo:
        """Restart the board and wait until it answers; it then has no reference."""
        with self.asking:
            self.command(commands.Reset(), ANSWER_S)
            self.can_undo_tare = False
            self.link.connected = False  # that it restarts was asked for
            try:
                return self.info()
            finally:
                self.link.connected = True

    def upload_model(
        self, model: str | Path | bytes, progress: Callable[[int, int], None] | None = None
    ) -> BoardInfo:
        """Put a model into the board's other bank; the board verifies it, then swaps.
        ``progress(done, total)`` in bytes.

        Raises:
            FileError, ModelError: it cannot be read, or is no model.
            DeviceError: it does not fit the board, or the link broke; the old model stays.
        """
        with self.asking:
            upload(self, model, progress)
            self.can_undo_tare = False
            return self.info()

    # ---- streaming ----

    def stream(
        self, what: Stream = Stream.TOUCHES, *, every: int = 1, frames: int = 0
    ) -> Iterator[Streamed]:
        """``what`` of every ``every``-th frame, ``frames`` of them (0: until the iterator is
        closed), with faults and events of the link between them. Ends when a scene or a recording
        does.

        Raises:
            UsageError: ``what``, ``every`` or ``frames`` cannot be, or another thread streams.
            DeviceError: the board refuses (no model, not tared), is gone, or has gone silent.
        """
        if not 0 < what <= 31 or not 1 <= every <= 0xFFFF or not 0 <= frames < 2**32:
            raise UsageError(
                f"stream: what = {int(what)}, every = {every}, frames = {frames} cannot be"
            )
        advice = "end the loop there first"
        return OneThreadAtATime(self._streamed(what, every, frames), "this stream", advice)

    def _streamed(self, what: Stream, every: int, frames: int) -> Generator[Streamed, None, None]:
        packets = packet_stream(self, what, every, frames)
        try:
            while not packets.over:
                item = packets.next(None)
                if item is not None:
                    time_us = getattr(getattr(item, "solved", item), "time_us", None)
                    if time_us is not None and self.pacer is not None:
                        self.pacer.hold(time_us)
                    yield item
        except KeyboardInterrupt:
            packets.stop(LEAVE_S)
            raise
        finally:
            packets.stop()
