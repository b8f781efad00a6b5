"""When simulated, emulated and recorded frames are given on: ``?speed=1&loop=1`` after a device's
URL, and the clock that keeps to it."""

import math
import threading
import time
from dataclasses import dataclass

from eitskin.errors import UsageError

TIMED = ("sim", "emu", "file")  # schemes whose frames come whenever they are asked for
MAX_SPEED = 1000.0
MAX_BEHIND_S = 0.25  # further behind, what is lost is not caught up


@dataclass(frozen=True)
class Timing:
    """How fast frames are given on: ``speed`` 1 is as they were scanned, 0 as fast as they can be
    made, None is not named; ``loop``: from the beginning again at the end."""

    speed: float | None = None
    loop: bool = False


def split_timing(url: str) -> tuple[str, Timing]:
    """A device's URL without what follows '?', and what that says. Of other schemes than sim, emu
    and file the URL stays as it is."""
    scheme, _, _ = url.partition(":")
    bare, mark, query = url.rpartition("?")
    if scheme not in TIMED or not mark:
        return url, Timing()
    named: dict[str, str] = {}
    for pair in query.split("&"):
        key, _, value = pair.partition("=")
        if key not in ("speed", "loop") or key in named:
            raise UsageError(f"device {url!r}: {pair!r} after '?'; use speed=1, loop=1, or both")
        named[key] = value
    if named.get("loop", "0") not in ("0", "1"):
        raise UsageError(f"device {url!r}: loop must be 0 or 1, not {named['loop']!r}")
    speed = None if "speed" not in named else read_speed(named["speed"], f"device {url!r}")
    return bare, Timing(speed, named.get("loop") == "1")


def read_speed(text: str, where: str) -> float:
    """The speed in "2", "0.5" or "max" (0)."""
    try:
        speed = 0.0 if text == "max" else float(text)
    except ValueError:
        speed = math.nan
    if not 0 <= speed <= MAX_SPEED:
        raise UsageError(
            f"{where}: speed must be 0 to {MAX_SPEED:g} (0 or max: as fast as it can), not {text!r}"
        )
    return speed


class WallClock:
    """Where a pacer has its time from: this computer's."""

    def now_s(self) -> float:
        """Seconds from any beginning."""
        return time.monotonic()

    def wait(self, changed: threading.Condition, timeout_s: float | None) -> None:
        """Wait on ``changed``, which is held, at most ``timeout_s``."""
        changed.wait(timeout_s)


class Pacer:
    """Holds each frame until it is due; may be paused, stepped and set to another speed from any
    thread. What comes late is given on at once, and far behind time begins anew from there."""

    def __init__(self, speed: float = 0.0, clock: WallClock | None = None) -> None:
        self._speed, self._clock = speed, clock or WallClock()
        self._changed = threading.Condition()
        self._paused, self._steps, self._woken = False, 0, False
        self._start: tuple[float, int] | None = None  # host's seconds, frame's us

    @property
    def speed(self) -> float:
        """0: as fast as it can."""
        return self._speed

    @property
    def paused(self) -> bool:
        return self._paused

    def hold(self, time_us: int) -> None:
        """Return when the frame at ``time_us`` is due, or ``wake`` was called."""
        with self._changed:
            while not self._woken:
                if self._paused:
                    if self._steps:
                        self._steps -= 1
                        break
                    self._start = None
                    self._clock.wait(self._changed, None)
                    continue
                rest_s = self._rest_s(time_us)
                if rest_s <= 0:
                    break
                self._clock.wait(self._changed, rest_s)
            self._woken = False

    def _rest_s(self, time_us: int) -> float:
        if not self._speed:
            return 0.0
        now = self._clock.now_s()
        if self._start is None:
            self._start = now, time_us
        rest_s = self._start[0] + (time_us - self._start[1]) / 1e6 / self._speed - now
        if rest_s < -MAX_BEHIND_S:
            self._start = now, time_us
        return rest_s

    def wake(self) -> None:
        """Let the frame that is held go, or the next one."""
        self._change(woken=True)

    def pause(self) -> None:
        """Hold every frame from now on."""
        self._change(paused=True)

    def play(self) -> None:
        self._change(paused=False)

    def step(self) -> None:
        """Pause, and let one frame go."""
        self._change(paused=True, steps=1)

    def set_speed(self, speed: float) -> None:
        """From the next frame on."""
        self._change(speed=speed)

    def _change(
        self,
        *,
        paused: bool | None = None,
        steps: int = 0,
        speed: float | None = None,
        woken: bool = False,
    ) -> None:
        with self._changed:
            if paused is not None:
                self._paused = paused
            self._steps = self._steps + steps if self._paused else 0
            if speed is not None:
                self._speed = speed
                self._start = None
            self._woken = self._woken or woken
            self._changed.notify_all()


class Slowness:
    """Says once how much slower than real time frames are made, after ``AFTER_S`` of them."""

    AFTER_S = 0.5

    def __init__(self, clock: WallClock | None = None) -> None:
        self._clock, self._told = clock or WallClock(), False
        self._start: tuple[float, int] | None = None

    def lines(self, time_us: int) -> list[str]:
        """What is to be said with the frame at ``time_us``."""
        now = self._clock.now_s()
        if self._start is None:
            self._start = now, time_us
        made_s = (time_us - self._start[1]) / 1e6
        if self._told or made_s < self.AFTER_S:
            return []
        self._told = True
        times = (now - self._start[0]) / made_s
        return [f"emulated: {times:.1f} times slower than real time"] if times > 1.2 else []
