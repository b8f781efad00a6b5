"""The clock that keeps to a speed: when simulated, emulated and recorded frames are given on."""

import threading
import time

MAX_BEHIND_S = 0.25  # beyond this delay, the lost time is not caught up


class WallClock:
    """The clock of this computer, from which a pacer has its time."""

    def now_s(self) -> float:
        """Return seconds since an arbitrary beginning."""
        return time.monotonic()

    def wait(self, changed: threading.Condition, timeout_s: float | None) -> None:
        """Wait on ``changed``, which is held, at most ``timeout_s``."""
        changed.wait(timeout_s)


class Pacer:
    """Holds each frame until it is due; any thread may pause it, step it, or set another speed. A
    late frame is passed on at once; far behind schedule, the schedule starts again from there."""

    def __init__(self, speed: float = 0.0, clock: WallClock | None = None) -> None:
        self._speed, self._clock = speed, clock or WallClock()
        self._changed = threading.Condition()
        self._paused, self._steps, self._woken = False, 0, False
        self._start: tuple[float, int] | None = None  # host's seconds, frame's us

    @property
    def speed(self) -> float:
        """The speed; 0: as fast as possible."""
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
        """Release the frame that is held, or the next one."""
        self._change(woken=True)

    def pause(self) -> None:
        """Hold every frame from now on."""
        self._change(paused=True)

    def play(self) -> None:
        self._change(paused=False)

    def step(self) -> None:
        """Pause, and release one frame."""
        self._change(paused=True, steps=1)

    def jump(self) -> None:
        """The frames continue at another time; during a pause one frame is shown."""
        with self._changed:
            self._start, self._woken = None, False
            self._steps = 1 if self._paused else 0
            self._changed.notify_all()

    def set_speed(self, speed: float) -> None:
        """Set the speed from the next frame on."""
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
    """Reports once, after ``AFTER_S``, how much slower than real time frames are made."""

    AFTER_S = 0.5

    def __init__(self, clock: WallClock | None = None) -> None:
        self._clock, self._reported = clock or WallClock(), False
        self._start: tuple[float, int] | None = None

    def lines(self, time_us: int) -> list[str]:
        """Return what is to be reported with the frame at ``time_us``."""
        now = self._clock.now_s()
        if self._start is None:
            self._start = now, time_us
        made_s = (time_us - self._start[1]) / 1e6
        if self._reported or made_s < self.AFTER_S:
            return []
        self._reported = True
        times = (now - self._start[0]) / made_s
        return [f"emulated: {times:.1f} times slower than real time"] if times > 1.2 else []
