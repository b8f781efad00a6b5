"""Messages of several threads, each with a lane of its own, taken in the order of one clock."""

import threading
import time
from collections import deque
from collections.abc import Callable

from eitskin.session.frame import Message, Notice

LOOK_S = 0.25  # how soon a thread that waits for room notices a request to its board
AT_ONCE = -1  # in place of a time: before all that have one


class Lane:
    """The messages of one skin that wait to be taken, at most ``room``.

    Attributes:
        timed: they are taken in the order of their times; else as soon as they come.
        started, over: the thread that puts them has begun, or puts no more.
    """

    def __init__(self, queue: "RobotQueue", room: int) -> None:
        self._queue, self._room = queue, room
        self._waiting: deque[tuple[tuple[int, int], Message]] = deque()
        self._taken = threading.Condition(queue.lock)
        self.timed = self.started = self.over = False

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def first(self) -> tuple[int, int]:
        """The time of the oldest message, and what decides among equal times: of messages to be
        taken at once, the number by which they came."""
        return self._waiting[0][0]

    def put(self, message: Message, asked: Callable[[], bool]) -> bool:
        """Put ``message`` when there is room, or when ``asked`` says that the thread is needed
        elsewhere; False once the queue ends."""
        queue = self._queue
        with queue.lock:
            while len(self._waiting) >= self._room and not asked():
                if queue.ending.is_set():
                    return False
                self._taken.wait(LOOK_S)
            queue.count += 1
            first = (AT_ONCE, queue.count)
            if self.timed and not isinstance(message, Notice):
                first = (message.time_us, 0)
            self._waiting.append((first, message))
            if len(self._waiting) == 1:  # nothing else lets the reader continue
                queue.changed.notify()
        return not queue.ending.is_set()

    def take(self) -> Message:
        """The oldest message, with the queue's lock held."""
        message = self._waiting.popleft()[1]
        if 2 * len(self._waiting) <= self._room:  # so that the thread wakes for several at once
            self._taken.notify()
        return message

    def wake(self) -> None:
        """Make the thread check again whether to continue; the queue's lock must be held."""
        self._taken.notify()


class RobotQueue:
    """The lanes of a robot's skins, read by one thread.

    Attributes:
        begun: the skins' clock runs, from ``began_ns``.
        ending: nothing is taken any more.
        error: what ended a skin's thread.
        count: messages that came.
    """

    def __init__(self, lanes: int, room: int) -> None:
        self.lock = threading.Lock()
        self.changed = threading.Condition(self.lock)
        self.begun, self.ending = threading.Event(), threading.Event()
        self.began_ns = 0
        self.error: BaseException | None = None
        self.count = 0
        self.lanes = [Lane(self, room) for _ in range(lanes)]

    def begin(self) -> None:
        """Start the clock."""
        self.began_ns = time.monotonic_ns()
        self.begun.set()

    def end(self) -> None:
        """From any thread; it may be called twice."""
        self.ending.set()
        self.begun.set()
        with self.lock:
            self.changed.notify_all()
            for lane in self.lanes:
                lane.wake()

    def note(
        self,
        lane: Lane,
        *,
        started: bool = False,
        over: bool = False,
        error: BaseException | None = None,
    ) -> None:
        """Take note that a lane's thread has started, is over or has failed."""
        with self.lock:
            lane.started, lane.over = lane.started or started, lane.over or over
            if not self.ending.is_set():
                self.error = self.error or error
            self.changed.notify_all()

    def wait_started(self) -> None:
        """Return once all threads have started, one has failed, or the queue ends."""
        with self.lock:
            while not (
                self.error is not None
                or self.ending.is_set()
                or all(lane.started for lane in self.lanes)
            ):
                self.changed.wait(LOOK_S)

    def next(self) -> tuple[int, Message] | None:
        """The next message and its lane's number; None when all lanes are over, or the queue ends.
        What has no time goes first; the others come in the order of their times, once the next one
        of each is there.

        Raises:
            BaseException: ``error``.
        """
        with self.lock:
            while not self.ending.is_set():
                if self.error is not None:
                    raise self.error
                number = self._first()
                if number is not None:
                    return number, self.lanes[number].take()
                if all(lane.over for lane in self.lanes):
                    return None
                self.changed.wait(LOOK_S)
        return None

    def _first(self) -> int | None:
        """Return the lane whose message is next; None while a lane with times has no message."""
        best, first, complete = None, (0, 0), True
        for number, lane in enumerate(self.lanes):
            if len(lane):
                if best is None or lane.first < first:  # at equal times the first lane's
                    best, first = number, lane.first
            elif lane.timed and not lane.over:
                complete = False
        return best if complete or first[0] == AT_ONCE else None
