"""A session with a board: open it, set it up, take its reference, begin its scene, follow it.

``eitskin stream``, ``record`` and ``replay``, ``eitskin.stream()`` and the page all follow boards
through this.
"""

import queue
import threading
import time
from collections.abc import Callable, Generator
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from eitskin.core.results import Options
from eitskin.device.bandwidth import carried_every
from eitskin.device.client import TARE_FRAMES, Device
from eitskin.device.events import Events
from eitskin.device.known_model import KnownModel, find_model, need_model
from eitskin.device.link import LinkEvent, Reconnect
from eitskin.device.live_frames import (
    Clock,
    Item,
    LiveDrive,
    LiveFrame,
    LiveSummary,
    finish,
    put_together,
    replayed,
)
from eitskin.device.open import open_with_files
from eitskin.device.recordings.recording import Recorder, read_head, recorded_options
from eitskin.device.set_up import begin_scene, set_up, take_reference
from eitskin.device.settings import ScanSettings, SolverSettings
from eitskin.device.timing import Pacer, Slowness, WallClock, split_timing
from eitskin.device.wire.link_table import Setting, Stream
from eitskin.device.wire.packets import Fault
from eitskin.errors import EitskinError
from eitskin.live.frame import Frame, Notice, Report
from eitskin.live.gestures import GestureTeller
from eitskin.live.settings import KINDS, Say, SessionSettings
from eitskin.live.zones import refuse_off_skin
from eitskin.scoring.matching import match
from eitskin.scoring.scene_truth import SceneTruth, TruthScore, truth_of
from eitskin.scoring.stream_check import Watcher

KEPT_ON = (
    "the board's owner has set keep-drive: current flows on when this program ends;  eitskin board"
    " --no-keep-drive  changes that"
)
T = TypeVar("T")


class Session:
    """A board, set up and followed. ``with`` opens it and lets go of it; ``start`` sets it up,
    takes the reference and begins the scene, and where nobody called it the first frame does.
    ``say`` gets lines for whoever looks on, ``progress`` how far and how slow an emulated board is.
    ``speed``: of what is simulated, emulated or recorded,
    where the URL does not say; 0 is as fast as it can.

    ``ask``, ``tare`` and ``stop`` may be called from any thread; all else belongs to the one that
    iterates.

    Attributes:
        device, known, truth: the board, its model and its scene's truth, where the host has those.
        solver: the solver's options as set; None where the board's model is not known here.
        summary, score: what the frames amounted to so far.
        recorder: where every packet is recorded.
        pacer: holds what is simulated, emulated or recorded until it is due; not a real board.
    """

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
    ) -> None:
        self.url, self.settings, self._say = url, settings or SessionSettings(), say
        self._progress = progress
        named = split_timing(url)[1]
        self._loops = named.loop
        self.pacer = Pacer(speed if named.speed is None else named.speed, clock)
        self._slowness = Slowness(clock)
        self._reconnect = reconnect
        self.known: KnownModel | None = None
        self.truth: SceneTruth | None = None
        self.solver: Options | None = None
        self.recorder: Recorder | None = None
        self.summary, self.score = LiveSummary(), TruthScore()
        self._asked: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stopping, self._started, self._every = threading.Event(), False, 1

    def __enter__(self) -> "Session":
        self.device = self._open()
        try:
            self._find()
        except BaseException:
            self.device.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the board and the recording; may be called twice."""
        if self.recorder is not None:
            self.recorder.close()
        self.device.close()

    @property
    def name(self) -> str:
        """The board, in a word or two."""
        return self.device.transport.name

    @property
    def replays(self) -> bool:
        """It is a recording: nothing can be asked of it."""
        return self.device.transport.replays

    @property
    def timed(self) -> bool:
        """It is simulated, emulated or recorded: ``pacer`` says when frames come."""
        return self.device.transport.synchronous

    @property
    def patient(self) -> bool:
        """No clock is kept: whoever takes its frames may take as long as they like."""
        return self.timed and not self.pacer.speed

    def start(self) -> None:
        """Set up, take the reference, begin the scene; once."""
        if not self._started:
            self._started = True
            if self.known is not None:
                refuse_off_skin(self.settings.zones, self.known.model.grid)
            self._set_up()

    # ---- from any thread ----

    def stop(self) -> None:
        """End after the frame that comes next."""
        self._stopping.set()
        self.pacer.wake()

    def ask(self, action: Callable[[Device], T]) -> Future[T]:
        """Let ``action`` talk to the board between two frames; the stream stops meanwhile."""
        answer: Future[T] = Future()

        def run() -> None:
            if not answer.set_running_or_notify_cancel():
                return
            try:
                answer.set_result(action(self.device))
            except BaseException as error:
                answer.set_exception(error)

        self._asked.put(run)
        self.pacer.wake()
        return answer

    def tare(self, frames: int = TARE_FRAMES) -> Future[None]:
        """Take the reference again, from frames of the untouched skin."""
        return self.ask(lambda device: device.tare(frames))

    def change_mode(self, mode: Stream) -> None:
        """Stream something else from the next frame on; to be called in ``ask``."""
        self.settings = replace(self.settings, mode=mode)
        if not self.replays:
            self._every = self.settings.every or self._carried()

    # ---- what comes ----

    def items(self) -> Generator[Item, None, None]:
        """Frames, faults and events of the link as they come, until the scene, the recording or the
        number of frames is over."""
        self.start()
        clock, count = Clock(), 0
        while True:
            again = False
            inner = self._follow(clock, count)
            try:
                for item in inner:
                    if isinstance(item, LiveFrame):
                        if self._over(item):
                            return
                        count += 1
                    if isinstance(item, LiveFrame | LiveDrive) and self.timed:
                        self.pacer.hold(item.time_us)
                    yield item
                    if self._stopping.is_set() or 0 < self.settings.frames <= count:
                        return
                    if not self._asked.empty():
                        if self.replays:
                            self._carry_out()
                        else:
                            again = True
                            break
            finally:
                inner.close()  # the board gets its stop before anything is asked of it
            if not again or (self.settings.frames and count >= self.settings.frames):
                return
            self._carry_out()

    def frames(self) -> Generator[Frame | Report | Notice, None, None]:
        """The same as frames beside the truth, touches after drives where they were asked for, and
        notices of what is new, summed up in ``summary`` and ``score``."""
        self.start()
        watcher, events, last = Watcher(self.known, self.truth), Events(), None
        gestures = GestureTeller(self.settings.zones)
        watcher.score = self.score
        items = self.items()
        try:
            for item in items:
                now_s = None if self.replays else time.time()
                arrived_ns = time.monotonic_ns()
                if isinstance(item, LiveDrive):
                    self.summary.drives += 1
                    yield Report(item, now_s)
                    continue
                if isinstance(item, LiveFrame):
                    last = item.time_us / 1e6
                    if self.url.startswith("emu:"):
                        for text in self._slowness.lines(item.time_us):
                            self._progress(text)
                notices = [Notice(_kind(item), text, last, now_s) for text in events.lines(item)]
                yield from notices
                if isinstance(item, LiveFrame):
                    self.summary.add(item)
                    watcher.known = self.known  # another one where a model was uploaded
                    happened = gestures.take(item)
                    if not self.settings.mode & Stream.TOUCHES and item.touches is not None:
                        item = replace(item, touches=None)  # read for the gestures alone
                    yield Frame(item, watcher.see(item), self.known, now_s, arrived_ns, happened)
                elif isinstance(item, Fault):
                    self.summary.faults += item.raised
        finally:
            items.close()

    def finish(self) -> LiveSummary:
        """The summary, with what the link and the board counted."""
        return finish(self.summary, self.device)

    # ---- steps ----

    def _open(self) -> Device:
        how = self.settings
        return open_with_files(self.url, how.model, how.firmware, reconnect=self._reconnect)

    def _find(self) -> None:
        """The board's model, and the truth of its scene."""
        how, board = self.settings, self.device.board
        if how.model_for:
            self.known = need_model(board, how.model, self.name, how.model_for)
        else:
            self.known = find_model(board, how.model, self.name)
        if self.replays:
            how.refuse_of_recording(self.name)
            self.truth = _recorded_truth(self.url) if self._solves else None
        else:
            self.truth = truth_of(self.url, how.solver.sign or "increase")

    def _set_up(self) -> None:
        how = self.settings
        if self.replays:
            return
        if self.device.board.settings & Setting.KEEP_DRIVE:
            self._say(KEPT_ON)
        self._look_on()
        self.solver = set_up(self.device, *self.scan_and_solver(), self.known)
        if how.record is not None:
            self.recorder = Recorder(how.record, self.device, self.solver, overwrite=True)
        self._take_reference()
        began_us, meanwhile = begin_scene(self.device)
        if hasattr(self.device.transport, "looking_on"):
            self.device.transport.looking_on = None
        if self.truth is not None and began_us is not None:
            self.truth.began_us = began_us
        events = Events()
        for item in meanwhile:
            for text in events.lines(item):
                self._say(text)
        self._every = how.every or self._carried()

    def _look_on(self) -> None:
        """Say how far an emulated board is, until its scene begins."""
        transport = self.device.transport
        if hasattr(transport, "looking_on"):
            start = time.monotonic()

            def looking_on(board_s: float) -> None:
                self._progress(
                    f"the emulated board starts: {board_s:.2f} s of its time in"
                    f" {time.monotonic() - start:.0f} s"
                )

            transport.looking_on = looking_on

    @property
    def _solves(self) -> bool:
        return bool(self.settings.mode & ~Stream.RAW)

    def _take_reference(self) -> None:
        how, simulated = self.settings, self.device.transport.synchronous
        recorded = self.recorder is not None
        needed = self._solves and not self.device.board.tared
        if how.tare is None and not (simulated or recorded or needed):
            return
        frames = TARE_FRAMES if how.tare is None else how.tare
        if not simulated:
            self._say(f"leave the skin untouched: taking the reference from {frames} frames")
        take_reference(self.device, frames, streamed=recorded or how.quiet_frames)
        if not simulated:
            self._say("touch it")

    def scan_and_solver(self) -> tuple[ScanSettings, SolverSettings]:
        """As named; with a target those of the measured point that it chooses."""
        return self.settings.scan_and_solver(self.device.board, self.known, self.name, self._say)

    def _carried(self) -> int:
        """Every how manieth frame the line carries; with touches after each drive all are asked
        for."""
        if self.settings.report == "drive":
            return 1
        mode = self.settings.mode
        carried = carried_every(self.device, mode)
        if carried > 1:
            kinds = ",".join(kind for kind in KINDS if mode & Stream[kind.upper()])
            self._say(
                f"the line carries one frame in {carried} of {kinds}; name another number with"
                "  --every"
            )
        return carried

    def _follow(self, clock: Clock, count: int) -> Generator[Item, None, None]:
        how = self.settings
        if self.replays:
            return self._replayed()
        frames = max(how.frames - count, 1) if how.frames and how.report == "frame" else 0
        stream = self.device.stream(self._streamed, every=self._every, frames=frames)
        return put_together(stream, self._streamed, clock)

    def _replayed(self) -> Generator[Item, None, None]:
        """The recording; with ``loop`` again and again, as if it went on."""
        how, offset_us, what = self.settings, 0, self._streamed
        if what & Stream.EVENTS:
            what |= Stream.TOUCHES  # of which gestures are made where none were recorded
        while True:
            last_us = step_us = 0
            every, frames = how.every or 1, how.frames
            items = replayed(self.device, what, every=every, frames=frames)
            for item in items:
                if isinstance(item, LiveFrame):
                    if self._over(item):
                        break
                    step_us, last_us = item.time_us - last_us, item.time_us
                if isinstance(item, LiveFrame | LiveDrive):
                    item = replace(item, time_us=item.time_us + offset_us)
                yield item
            items.close()
            if not (self._loops and last_us):
                return
            offset_us += last_us + step_us
            self.device.close()
            self.device = self._open()

    @property
    def _streamed(self) -> Stream:
        drives = self.settings.report == "drive"
        return self.settings.mode | (Stream.FOLLOWED if drives else Stream(0))

    def _over(self, frame: LiveFrame) -> bool:
        """The scene has ended; an emulated board would hold its last frame for ever."""
        if self.settings.frames or self.truth is None:
            return False
        return self.truth.over(frame.board_us)

    def _carry_out(self) -> None:
        with suppress(queue.Empty):
            while True:
                self._asked.get_nowait()()


def _kind(item: Item) -> str:
    if isinstance(item, LinkEvent):
        return "link"
    return "fault" if isinstance(item, Fault) else "diagnostic"


def _recorded_truth(url: str) -> SceneTruth | None:
    """Of the scene that the recorded board saw, where that is still to be found."""
    path = split_timing(url)[0].partition(":")[2]
    solver = recorded_options(path)
    try:
        match([], [])  # scipy, which every comparison with the truth needs
        was = str(read_head(path).get("url", ""))
        return truth_of(was, "increase" if solver is None else solver.sign)
    except EitskinError:
        return None
