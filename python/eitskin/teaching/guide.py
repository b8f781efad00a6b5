"""Guide a person through the presses of a plan: which place is next, when to press, when to lift,
and whether a press is good. The guide sees nothing but frames, so the command line, the page and
programs can all use it.

A press is detected by its distance from the skin at rest, in units of the noise at rest: the rms
over rows of the change over the row's noise. It counts if it was held, which means that two halves
of the hold differ little, both in strength (otherwise it kept sinking, or was released) and in
direction over the rows (otherwise it moved or slipped). The untouched frame is the mean of the
frames just before. The skin is at rest if it is as when it was last untouched, at first as in the
first frame. If it is not, somebody presses too early, and the guide waits. Otherwise lifting would
count as the press, and each place would get the next one's press.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.device.settings import ScanSettings
from eitskin.device.wire.packets import BoardInfo
from eitskin.errors import UsageError
from eitskin.teaching.plan import PressPlan
from eitskin.teaching.press_file import PressFile

PACE_US = 25_000  # per frame: a hold of twelve frames takes .3 s
JUMPS = 2  # greatest differences between frames at rest that do not count as noise
REST_FRAMES = 12  # the untouched frame is their mean
SETTLE_FRAMES = 8  # frames after contact before the hold begins
HOLD_FRAMES = 12  # the pressed frame is their mean
PATIENCE_FRAMES = 200  # how long to wait for a skin that does not return to rest
PRESS_ABOVE = 8.0  # in units of the noise; a greater change is a press
LIFTED_BELOW = 0.2  # fraction of the press; below it the finger was lifted
HELD_ABOVE = 0.7  # fraction of the press; above it after PATIENCE_FRAMES, nothing was lifted
STRENGTH_CHANGE = 0.1  # greatest change between the halves of a hold
TURN = 0.02  # greatest 1 - cosine between the changes of both halves, in addition to noise


class Step(Enum):
    """The steps that the person is asked to do."""

    REST = "leave the skin untouched"
    PRESS = "press"
    HOLD = "hold still"
    LIFT = "lift"
    DONE = "done"


@dataclass(frozen=True, eq=False)
class GuideEvent:
    """A change in the guidance after a frame: ``step`` is the step to do now, at place ``number``
    (from 0), and ``text`` explains it to the person. ``accepted`` and ``rejected`` state the result
    of a press; ``withdrawn`` states that an accepted press no longer counts."""

    step: Step
    number: int
    text: str
    accepted: bool = False
    rejected: str = ""
    withdrawn: bool = False


class PressGuide:
    """Guides through ``plan`` from place ``start`` on. Pass every frame to ``feed``; ``taken`` is
    the last good press: untouched and pressed frame (m,), and time in s.

    Raises:
        UsageError: the plan has no place ``start``.
    """

    def __init__(self, plan: PressPlan, start: int = 0) -> None:
        if not 0 <= start <= len(plan):
            raise UsageError(f"teach: the plan has {len(plan)} places, so not number {start + 1}")
        self.plan = plan
        self.number = start
        self.taken: tuple[FloatArray, FloatArray, float] | None = None
        self.step = Step.REST if start < len(plan) else Step.DONE
        self._rest: deque[FloatArray] = deque(maxlen=REST_FRAMES)
        self._noise: FloatArray | None = None
        self._untouched: FloatArray | None = None
        self._hold: list[FloatArray] = []
        self._strength, self._good, self._waited = 0.0, True, 0
        self._warned, self._came_back = False, False

    @property
    def place_mm(self) -> tuple[float, float]:
        """The place to press now; at the end, the last place."""
        x, y = self.plan.place_mm[min(self.number, len(self.plan) - 1)]
        return float(x), float(y)

    def back(self, number: int) -> GuideEvent:
        """Ask for place ``number`` again."""
        self.number = number
        return self._rests(f"place {number + 1} again")

    def skip(self) -> GuideEvent:
        """Leave out this place."""
        return self._next("left out")

    def feed(self, voltage_v: npt.ArrayLike, time_s: float) -> GuideEvent | None:
        """Process a frame (m,) at ``time_s``; return None if nothing changed. Frames with rows that
        were not measured are ignored."""
        frame = np.asarray(voltage_v, dtype=np.float64)
        if self.step is Step.DONE or not np.isfinite(frame).all():
            return None
        return {
            Step.REST: self._at_rest,
            Step.PRESS: self._waiting,
            Step.HOLD: self._holding,
            Step.LIFT: self._lifting,
        }[self.step](frame, time_s)

    def _at_rest(self, frame: FloatArray, _: float) -> GuideEvent | None:
        """Wait until the skin rests: two halves of the last frames agree within the noise, and with
        the skin when it was last untouched. A skin that keeps creeping, or rests in another state,
        is accepted after ``PATIENCE_FRAMES``."""
        self._rest.append(frame)
        if self._untouched is None:
            self._untouched = frame
        self._waited += 1
        if len(self._rest) < REST_FRAMES:
            return None
        frames = np.array(self._rest)
        steps = np.diff(frames, axis=0)
        untouched = np.argsort(np.linalg.norm(steps, axis=1))[
            :-JUMPS
        ]  # the jump of a finger is not noise
        spread = steps[untouched].std(axis=0) / np.sqrt(2)
        noise = np.maximum(spread, 0.2 * np.median(spread) + np.finfo(float).tiny)
        noise = noise if self._noise is None else 0.8 * self._noise + 0.2 * noise
        half, mean = len(frames) // 2, frames.mean(axis=0)
        moved = _rms((frames[half:].mean(axis=0) - frames[:half].mean(axis=0)) / noise)
        if self._waited < PATIENCE_FRAMES:
            if moved > PRESS_ABOVE / 4:
                return None
            if _rms((mean - self._untouched) / noise) > self._lifted():
                return self._warns()
        self._noise, self._untouched = noise, mean
        return self._asks(Step.PRESS, "press")

    def _warns(self) -> GuideEvent | None:
        """Warn once that the skin rests in another state; the waiting time starts again."""
        if self._warned:
            return None
        self._warned = True
        return self._asks(
            Step.REST, "too early, or something lies on the skin: lift, and leave it untouched"
        )

    def _waiting(self, frame: FloatArray, _: float) -> GuideEvent | None:
        assert self._noise is not None
        assert self._untouched is not None
        if self._size(frame) <= PRESS_ABOVE:
            self._rest.append(frame)
            self._untouched = np.array(self._rest)[: -(len(self._rest) // 4)].mean(axis=0)
            return None
        self._hold = []
        return self._asks(Step.HOLD, "hold still")

    def _holding(self, frame: FloatArray, time_s: float) -> GuideEvent | None:
        self._hold.append(frame)
        if len(self._hold) < SETTLE_FRAMES + HOLD_FRAMES:
            if self._size(frame) > PRESS_ABOVE / 2:
                return None
            return self._refuses("it was released too early; hold until the guide asks you to lift")
        frames = np.array(self._hold[SETTLE_FRAMES:])
        wrong = self._judged(frames)
        pressed = frames.mean(axis=0)
        self._strength = self._size(pressed)
        if wrong:
            return self._refuses(wrong)
        assert self._untouched is not None
        self.taken = (self._untouched, pressed, time_s)
        self.step, self._waited = Step.LIFT, 0
        return GuideEvent(Step.LIFT, self.number, "good; lift", accepted=True)

    def _judged(self, frames: FloatArray) -> str:
        """Return what is wrong with a hold, or ""."""
        assert self._noise is not None
        assert self._untouched is not None
        half = len(frames) // 2
        first, second = (
            (part.mean(axis=0) - self._untouched) / self._noise
            for part in (frames[:half], frames[half:])
        )
        sizes = np.linalg.norm(first), np.linalg.norm(second)
        change = sizes[1] / sizes[0] - 1
        noisy = len(first) * 2 / half / sizes[0] ** 2  # the effect of the noise of both halves
        if 1 - first @ second / (sizes[0] * sizes[1]) > TURN + noisy:
            return "it moved or slipped"
        if abs(change) > STRENGTH_CHANGE + 2 * np.sqrt(noisy / len(first)):
            return f"it was not held: its strength changed by {100 * change:+.0f} %"
        return ""

    def _lifting(self, frame: FloatArray, _: float) -> GuideEvent | None:
        if self._size(frame) <= self._lifted():
            self._came_back = True
            return self._next("") if self._good else self._rests("")
        self._waited += 1
        held = self._size(frame) > HELD_ABOVE * self._strength
        if self._came_back or not held or self._waited < PATIENCE_FRAMES:
            return None
        why = "the skin is not as it was before this press; perhaps lifting was taken for a press"
        withdrawn, event = self._good, self._rests(f"again, please: {why}")
        return replace(event, rejected=why, withdrawn=withdrawn)

    def _lifted(self) -> float:
        """Return the change over the noise below which the skin counts as untouched."""
        return max(PRESS_ABOVE, LIFTED_BELOW * self._strength)

    def _refuses(self, why: str) -> GuideEvent:
        self._good = False
        self.step, self._waited = Step.LIFT, 0
        self._strength = max(self._strength, self._size(self._hold[-1]))
        return GuideEvent(Step.LIFT, self.number, f"again, please: {why}; lift first", rejected=why)

    def _next(self, text: str) -> GuideEvent:
        self.number += 1
        if self.number < len(self.plan):
            return self._rests(text)
        self.step = Step.DONE
        return GuideEvent(Step.DONE, self.number, "all places are done")

    def _rests(self, text: str) -> GuideEvent:
        self._rest.clear()
        self._good, self._warned = True, False
        return self._asks(
            Step.REST, f"{text}; leave the skin untouched" if text else Step.REST.value
        )

    def _asks(self, step: Step, text: str) -> GuideEvent:
        self.step, self._waited = step, 0
        return GuideEvent(step, self.number, text)

    def _size(self, frame: FloatArray) -> float:
        """Return the change over the noise."""
        assert self._noise is not None
        assert self._untouched is not None
        return _rms((frame - self._untouched) / self._noise)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def scan_of_presses(board: BoardInfo, replays: bool) -> ScanSettings:
    """Return the scan for presses: every row of every frame, no faster than a person presses. A
    board that is given its frames, or a recording, sends what it has."""
    if board.frames_given or replays:
        return ScanSettings()
    slow = board.n_rows * board.slot_us >= PACE_US
    return ScanSettings(check_every=1, frame_period_us=0 if slow else PACE_US)


def guide_presses(
    frames: Iterable[tuple[npt.ArrayLike, float]],
    guide: PressGuide,
    file: PressFile,
    say: Callable[[GuideEvent], None],
    key: Callable[[], str] = lambda: "",
) -> None:
    """Guide until all places are done or ``frames`` (voltages (m,), time in s) end.

    ``key`` is asked before each frame: "b" goes back to the previous press, "s" skips a place, "q"
    quits.
    """
    if guide.step is not Step.DONE:
        say(GuideEvent(guide.step, guide.number, Step.REST.value))
    for voltage_v, time_s in frames:
        pressed = key()
        if pressed == "q" or guide.step is Step.DONE:
            return
        if pressed == "b":
            say(guide.back(file.back()))
        elif pressed == "s":
            say(guide.skip())
        event = guide.feed(voltage_v, time_s)
        if event is None:
            continue
        if event.accepted and guide.taken is not None:
            file.add(event.number, *guide.taken)
        if event.withdrawn:
            file.back()
        say(event)
        if event.step is Step.DONE:
            return
