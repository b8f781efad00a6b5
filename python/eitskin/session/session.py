"""A session with a board, the one path of a frame: a transport's packets come out of the link's
queue, are put together, and go to every consumer as one family of messages.

    transport -> link (queue) -> packet stream -> Assembler -> Session.messages -> consumers

``eitskin stream``, ``record``, ``replay`` and ``view`` and ``eitskin.stream()`` all use this. The
thread that iterates ``messages`` owns the board; every other thread asks it (``ask``).
"""

import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future
from dataclasses import replace
from typing import Any, NoReturn, TypeVar

from eitskin.core.results import Options
from eitskin.device.bandwidth import carried_every
from eitskin.device.client import TARE_FRAMES, Device
from eitskin.device.exchange import OTHERS
from eitskin.device.known_model import KnownModel, find_model, need_model
from eitskin.device.link import Reconnect
from eitskin.device.open import open_with_files
from eitskin.device.pacing import Pacer, Slowness, WallClock
from eitskin.device.recordings.recording import Recorder
from eitskin.device.settings import ScanSettings, SolverSettings
from eitskin.device.streaming import LEAVE_S, STOP_S, packet_stream
from eitskin.device.timing import check_name, check_speed, is_name, split_name, split_timing
from eitskin.device.transport import Capabilities
from eitskin.device.wire.link_table import Setting, Stream
from eitskin.errors import UsageError
from eitskin.kinematics.pose import IDENTITY, Pose
from eitskin.robot.placement import Placement
from eitskin.session.assemble import Assembler, Clock
from eitskin.session.frame import DriveReport, Frame, Message, Notice
from eitskin.session.gestures import StreamGestures
from eitskin.session.notices import Novelty, notice_of
from eitskin.session.observer import Observer
from eitskin.session.reference import ReferenceMean
from eitskin.session.replay import Replay
from eitskin.session.requests import Requests
from eitskin.session.set_up import begin_scene, set_up, take_reference, wait_untouched
from eitskin.session.settings import KINDS, Say, SessionSettings
from eitskin.session.summary import Summary
from eitskin.session.zones import refuse_off_skin
from eitskin.threads import OneReader, OneThreadAtATime, refuse_copy

KEPT_ON = (
    "the board's owner has set keep-current: current flows on when this program ends;  eitskin"
    " board --no-keep-current  changes that"
)
TICK_S = 0.25  # of a real board: how soon a request, a stop or a lost port is noticed
ALL_KINDS = Stream.RAW | Stream.IMAGE | Stream.TOUCHES
T = TypeVar("T")


class Session:
    """A board, set up and streaming. ``with`` opens it and lets go of it; ``start`` sets it up,
    takes the reference and begins the scene; ``messages`` starts it where nobody did.

    ``say`` gets lines for the user, ``progress`` how far and how slow an emulated board is.
    ``speed``: of what is simulated, emulated or recorded, where the URL does not name one; 0 is as
    fast as it can. ``observe`` attaches an observer to the open session.

    ``ask``, ``tare``, ``stop`` and ``close`` may be called from any thread; all else belongs to the
    thread that iterates, and a second thread that iterates is refused. Whatever is asked gets an
    answer: it waits until the session has started, and is refused once the session is over, or
    while the board is unplugged.

    Attributes:
        given_name: the name of the source that the settings, the URL or the board give, in this
            order; None: none.
        device, known: the board and its model, where the host has that.
        mode: what is streamed.
        observer: who adds to frames what is known of them; None: nobody.
        solver: the solver's options as set; None where the board's model is not known here.
        began_us: the board's clock at a simulated scene's time 0; None: with the first frame.
        reference: the mean of the untouched frames, where the settings ask for them.
        summary: what the messages amounted to so far.
        recorder: where every packet is recorded.
        pacer: holds what is simulated, emulated or recorded until it is due; not a real board.
        consumers: each gets every message before ``messages`` gives it.
    """

    device: Device
    mode: Stream

    def __init__(
        self,
        url: str = "auto",
        settings: SessionSettings | None = None,
        *,
        say: Say = lambda text: None,
        progress: Say = lambda text: None,
        reconnect: Reconnect | None = None,
        speed: float = 0.0,
        clock: WallClock | None = None,
        observe: "Callable[[Session], Observer | None]" = lambda session: None,
    ) -> None:
        self.url, self.settings, self._say = url, settings or SessionSettings(), say
        self._progress, self._observe = progress, observe
        self.given_name = split_name(url)[1]
        if self.settings.name is not None:
            self.given_name = check_name(self.settings.name, "name")
        named = split_timing(url)[1]
        self._loops = named.loop
        chosen = check_speed(speed, "speed") if named.speed is None else named.speed
        self.pacer = Pacer(chosen, clock)
        self._slowness = Slowness(clock)
        self._reconnect = reconnect
        self.known: KnownModel | None = None
        self.observer: Observer | None = None
        self.solver: Options | None = None
        self.recorder: Recorder | None = None
        self.reference: ReferenceMean | None = None
        self.began_us: int | None = None
        self.summary = Summary()
        self.consumers: list[Callable[[Message], None]] = []
        self._novelty = Novelty()
        self._last_s: float | None = None  # of the last frame
        self._replay: Replay | None = None
        self._skip_us: int | None = None  # messages before it are not shown
        self._requests = Requests()
        self._stopping, self._started, self._every = threading.Event(), False, 1
        self._starting = threading.RLock()
        self._answers_s = STOP_S  # limit for the board to send its counters
        self._reading = OneReader("the messages of this session", OTHERS)

    def __enter__(self) -> "Session":
        try:
            self.device = self._open()
        except BaseException as error:
            self._requests.close(str(error))
            raise
        try:
            self._find()
        except BaseException as error:
            self._requests.close(str(error))
            self.device.close()
            raise
        if self.given_name is None and is_name(self.device.board.name):
            self.given_name = self.device.board.name
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self.close(str(error) if error is not None else "")

    def close(self, reason: str = "") -> None:
        """Close the board and the recording, and answer all open requests with ``reason``; may be
        called twice."""
        if not hasattr(self, "device"):
            self._requests.close(reason or f"{self.url}: the session was closed; start again")
            return
        self._requests.close(reason or f"{self.name}: the session is over; start again")
        if self.recorder is not None:
            self.recorder.close()
        self.device.close()

    def __reduce__(self) -> NoReturn:
        refuse_copy("a session", "open another one in the other process")

    @property
    def name(self) -> str:
        """The board, in a word or two."""
        return self.device.transport.name

    @property
    def source(self) -> str:
        """The name of the source in every message: the one given, else the board's serial
        number."""
        return self.given_name or self.device.board.serial

    @property
    def placement(self) -> Placement | None:
        """The place of the skin on its link; None for a flat skin that no robot file places."""
        how, surface = self.settings, None if self.known is None else self.known.model.surface
        if how.pose is None and surface is None:
            return None
        named = how.link or (None if surface is None else surface.link)
        return Placement(named or self.given_name or "skin", how.pose or IDENTITY, surface)

    @property
    def parts(self) -> "dict[str, Session]":
        """The sessions of a robot's skins by their names; of one device itself alone."""
        return {self.source: self}

    @property
    def bases(self) -> "dict[str, Pose]":
        """The poses of the skins' links in the robot's frame; none are known of one device."""
        return {}

    @property
    def capabilities(self) -> Capabilities:
        """The capabilities of this kind of device."""
        return self.device.transport.capabilities

    @property
    def replays(self) -> bool:
        """Return whether it is a recording, which answers no requests."""
        return self.capabilities.replays

    @property
    def timed(self) -> bool:
        """Return whether it is simulated, emulated or recorded, so that ``pacer`` decides when
        frames come."""
        return self.capabilities.own_clock

    @property
    def patient(self) -> bool:
        """Return whether no clock is kept, so that the consumer of its frames may take any time."""
        return self.timed and not self.pacer.speed

    def start(self) -> None:
        """Set up, take the reference, begin the scene; once."""
        with self._starting:
            if self._started:
                return
            self._started = True
            if self.known is not None:
                refuse_off_skin(self.settings.zones, self.known.model.grid)
            self._set_up()

    # ---- from any thread ----

    def stop(self) -> None:
        """End after the next frame, or now if none comes."""
        self._stopping.set()
        self.pacer.wake()

    def ask(self, action: Callable[[Device], T]) -> Future[T]:
        """Let ``action`` talk to the board between two frames; the stream stops meanwhile. The
        answer is a DeviceError if the session is over or its board is unplugged."""
        answer = self._requests.ask(action)
        self.pacer.wake()
        return answer

    def tare(self, frames: int = TARE_FRAMES, *, anyway: bool = False) -> Future[None]:
        """Take the reference again, from frames of the untouched skin, as ``Device.tare``."""
        return self.ask(lambda device: device.tare(frames, anyway=anyway))

    @property
    def asked(self) -> bool:
        """Return whether a request waits for an answer of the board."""
        return self._requests.waiting

    # ---- to be called in ``ask`` ----

    def change_mode(self, mode: Stream) -> None:
        """Change the streamed kinds of packets from the next frame on."""
        self.mode, self.settings = mode, replace(self.settings, mode=mode)
        if not self.replays:
            self._every = self.settings.every or self._carried()

    def seek(self, time_s: float) -> None:
        """Continue a recording at ``time_s``: messages in between are read and not shown. To go
        back, it is read from its beginning.

        Raises:
            UsageError: it is no recording.
        """
        if self._replay is None:
            raise UsageError(f"{self.name} is not a recording, so its time cannot be chosen")
        self._skip_us = round(1e6 * time_s)
        if self._skip_us < self._replay.last_us:
            self._read_again(Replay(self.settings.every or 1))
            self._gestures = StreamGestures(self.settings.zones)
        self.pacer.jump()

    def change_solver(self, solver: SolverSettings) -> None:
        """Solve with other settings from the next frame on."""
        self.solver = set_up(self.device, ScanSettings(), solver, self.known)
        self.settings = replace(self.settings, solver=solver, preset=None)
        if self.observer is not None and solver.sign is not None:
            self.observer.look_for(solver.sign)

    def use_model(self, known: KnownModel) -> None:
        """The board has another model from the next frame on."""
        self.known = known
        self.solver = set_up(self.device, ScanSettings(), self.settings.solver, known)

    def apply(self, settings: SessionSettings) -> None:
        """Set scan and solver from now on as ``settings`` name them. If that is not possible, they
        do not change."""
        before, self.settings = self.settings, settings
        try:
            scan, solver = self.scan_and_solver()
        except BaseException:
            self.settings = before
            raise
        self.solver = set_up(self.device, scan, solver, self.known)

    # ---- messages ----

    def messages(self) -> Generator[Message, None, None]:
        """Yield frames, reports after drives if the settings ask for them, and notices of news,
        until the end of the scene, of the recording, or of the number of frames. Every message
        passes this loop; ``summary`` counts them."""
        advice = "Session.stop() ends it from any thread"
        return OneThreadAtATime(self._guarded(), "the session's messages", advice)

    def _guarded(self) -> Generator[Message, None, None]:
        mine = object()
        self._reading.begin(mine)
        reason = f"{self.name}: the session is over; start again"
        try:
            self.start()
            yield from self._messages(mine)
        except GeneratorExit:
            raise
        except BaseException as error:
            reason = str(error) or reason
            raise
        finally:
            self._reading.end(mine)
            self._requests.close(reason)

    def _messages(self, mine: object) -> Generator[Message, None, None]:
        self._clock, self._count = Clock(), 0
        self._replay = Replay(self.settings.every or 1) if self.replays else None
        self._begin_stream()
        limit_s = LEAVE_S  # unless the end is reached
        try:
            while not self._stopping.is_set():
                self._reading.go_on(mine)
                for message in self._due():
                    for seen in self._seen(message):
                        for consumer in self.consumers:
                            consumer(seen)
                        yield seen
                    if self._stopping.is_set():
                        return
                    if 0 < self.settings.frames <= self._count:
                        limit_s = STOP_S
                        return
                if self._packets.over:
                    if not self._begin_again():
                        limit_s = STOP_S
                        return
                elif self._requests.waiting:
                    self._answer_requests()
        finally:
            self._answers_s = limit_s if self._packets.stop(limit_s) else 0.0

    def _begin_stream(self) -> None:
        """Start the stream of packets, and prepare their assembly."""
        how, what = self.settings, self.mode
        if how.report == "drive":
            what |= Stream.DRIVE_TOUCHES
        if self.replays:
            if what & Stream.EVENTS:
                what |= Stream.TOUCHES  # gestures are made from these touches if none were recorded
            self._packets = packet_stream(self.device, what, 1, 0)
        else:
            limited = how.frames and how.report == "frame"
            frames = max(how.frames - self._count, 1) if limited else 0
            self._packets = packet_stream(self.device, what, self._every, frames)
        self._assembler = Assembler(what, self._clock)

    def _due(self) -> Iterator[Message]:
        """The messages that the next packet completes, each when it is due; none where nothing
        comes for a while."""
        item = self._packets.next(TICK_S)
        if item is not None:
            came = self._assembler.take(item)
        else:
            came = self._assembler.rest() if self._packets.over else []
        for one in came:
            message = one if self._replay is None else self._replayed(self._replay, one)
            if message is None or self._skipped(message):
                continue
            if isinstance(message, Frame):
                if self._over(message):
                    self._packets.over = True
                    return
                self._count += 1
            if self.timed and not isinstance(message, Notice):
                self.pacer.hold(message.time_us)
            yield message.confirmed() if self.settings.confirmed else message

    def _replayed(self, replay: Replay, message: Message) -> Message | None:
        """Return a recording's ``message`` as it is shown, None if it is not. The first frame tells
        the observer when the scene began, even if what is shown begins later."""
        begins = not replay.frames
        shown = replay.take(message)
        if begins and isinstance(shown, Frame) and self.observer is not None:
            self.observer.began(shown.board_us)
        return shown

    def _skipped(self, message: Message) -> bool:
        """Return whether ``message`` lies before the time that was sought."""
        if self._skip_us is None:
            return False
        if isinstance(message, Notice) or message.time_us < self._skip_us:
            return True
        self._skip_us = None
        return False

    def _begin_again(self) -> bool:
        """Open a looped recording once more; False if nothing comes any more."""
        again = self._replay.again() if self._replay is not None and self._loops else None
        if again is None:
            return False
        self._read_again(again)
        return True

    def _read_again(self, replay: Replay) -> None:
        """Read the recording from its beginning."""
        self.device.close()
        self.device = self._open()
        self._replay, self._clock = replay, Clock()
        self._begin_stream()

    def _answer_requests(self) -> None:
        """Let other threads use the board; its stream stops in the meantime. A board that does not
        stop does not answer either: then the session ends when the stream starts again, and the
        requests end with it."""
        if self.device.link.away:
            reason = f"{self.name}: the board is unplugged; plug it in, then ask again"
            self._requests.refuse(reason)
        elif self.replays:
            self._requests.carry_out(self.device)
        else:
            if self._packets.stop():
                self._requests.carry_out(self.device)
            self._begin_stream()

    def _seen(self, message: Message) -> Iterator[Message]:
        """Yield ``message`` in the form for consumers, after the notices that it causes."""
        now_s = None if self.replays else time.time()
        self.summary.add(message)
        if isinstance(message, Notice):
            if self._novelty.lines(message):
                yield replace(message, time_s=self._last_s, time_unix_s=now_s, source=self.source)
        elif isinstance(message, DriveReport):
            yield replace(message, time_unix_s=now_s, source=self.source, placement=self.placement)
        else:
            yield from self._seen_frame(message, now_s)

    def _seen_frame(self, frame: Frame, now_s: float | None) -> Iterator[Message]:
        arrived_ns = time.monotonic_ns()
        self._last_s = frame.time_s
        if self.capabilities.slow:
            for text in self._slowness.lines(frame.time_us):
                self._progress(text)
        for text in self._novelty.lines(frame):
            yield Notice("diagnostic", text, self._last_s, now_s, source=self.source)
        events = self._gestures.take(frame)
        if not self.mode & Stream.TOUCHES and frame.has_touches:  # read for the gestures alone
            info = None if frame.solver_image is None else frame.info
            frame = replace(frame, touches=(), has_touches=False, info=info)
        frame = replace(
            frame, known=self.known, time_unix_s=now_s, arrived_ns=arrived_ns, events=events,
            source=self.source, placement=self.placement,
        )  # fmt: skip
        yield frame if self.observer is None else self.observer.see(frame)

    def _over(self, frame: Frame) -> bool:
        """Return whether there is nothing more to see, as after the end of a scene, whose last
        frame an emulated board shows for ever."""
        if self.settings.frames or self.observer is None:
            return False
        return self.observer.over(frame.board_us)

    def facts(self) -> dict[str, Any]:
        """Return the present summary, for JSON."""
        truth = None if self.observer is None else self.observer.facts()
        return self.summary.as_dict() | {"truth": truth}

    def finish(self) -> Summary:
        """Return the summary with the counters of the link and of the board. A board that did not
        answer when it was stopped is not asked for them."""
        self.summary.finish(self.device, self._answers_s)
        return self.summary

    def count_links(self) -> None:
        """Put the link's counters into the summary, without asking the board."""
        self.summary.link = self.device.counters.as_dict()

    # ---- steps ----

    def _open(self) -> Device:
        how = self.settings
        device = open_with_files(self.url, how.model, how.firmware, reconnect=self._reconnect)
        if how.quiet_frames:
            self.reference = ReferenceMean(device.link, self.reference)
        return device

    def _find(self) -> None:
        """Decide what the settings leave open: the model, the kinds of packets, and the
        observer."""
        how, board = self.settings, self.device.board
        if how.mode is None:
            how = replace(how, mode=ALL_KINDS if self.timed else Stream.IMAGE | Stream.TOUCHES)
        self.settings, self.mode = how, how.mode or Stream(0)
        if how.model_for:
            self.known = need_model(board, how.model, self.name, how.model_for)
        else:
            self.known = find_model(board, how.model, self.name)
        if self.replays:
            how.refuse_of_recording(self.name)
        self.observer = self._observe(self)
        self._gestures = StreamGestures(how.zones)

    def _set_up(self) -> None:
        how = self.settings
        if self.replays:
            return
        if self.device.board.settings & Setting.KEEP_CURRENT:
            self._say(KEPT_ON)
        self._watch_start()
        self.solver = set_up(self.device, *self.scan_and_solver(), self.known)
        if how.record is not None:
            self.recorder = Recorder(
                how.record, self.device, self.solver, name=self.given_name, overwrite=True
            )
        self._take_reference()
        began_us, meanwhile = begin_scene(self.device)
        self.device.transport.watch(None)
        self.began_us = began_us
        if self.observer is not None and began_us is not None:
            self.observer.began(began_us)
        novelty = Novelty()
        for cause in meanwhile:
            for text in novelty.lines(notice_of(cause)):
                self._say(text)
        self._every = how.every or self._carried()

    def _watch_start(self) -> None:
        """Report the progress of a slow board until its scene begins."""
        start = time.monotonic()

        def progress(board_s: float) -> None:
            self._progress(
                f"the emulated board starts: {board_s:.2f} s of its time in"
                f" {time.monotonic() - start:.0f} s"
            )

        self.device.transport.watch(progress)

    def _take_reference(self) -> None:
        how, simulated = self.settings, self.timed
        recorded = self.recorder is not None
        needed = bool(self.mode & ~Stream.RAW) and not self.device.board.tared
        if how.tare is None and not (simulated or recorded or needed):
            return
        frames = TARE_FRAMES if how.tare is None else how.tare
        if not simulated:
            self._say(f"leave the skin untouched: taking the reference from {frames} frames")
        wait_untouched(
            lambda: take_reference(self.device, frames, streamed=recorded or how.quiet_frames),
            self._say,
        )
        if not simulated:
            self._say("touch it")

    def scan_and_solver(self) -> tuple[ScanSettings, SolverSettings]:
        """Return the named settings, or with a preset those of the operating point it chooses."""
        return self.settings.scan_and_solver(self.device.board, self.known, self.name, self._say)

    def _carried(self) -> int:
        """The smallest N for which the link carries every N-th frame; with touches after each drive
        every frame is asked for."""
        if self.settings.report == "drive":
            return 1
        carried = carried_every(self.device, self.mode)
        if carried > 1:
            kinds = ",".join(kind for kind in KINDS if self.mode & Stream[kind.upper()])
            self._say(
                f"the line carries one frame in {carried} of {kinds}; name another number with"
                "  --every"
            )
        return carried
