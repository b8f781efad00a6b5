"""Compare reported events with the true gestures: right, invented, and their latency."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from eitskin.core.gestures import Gestures
from eitskin.core.gestures_table import EventKind, EventPhase
from eitskin_studies.gestures.drawn import DrawnGesture, DrawnSession
from eitskin_studies.gestures.simulated import RATE_HZ, TouchedFrame
from eitskin_studies.gestures.stages import failed_stage

# of a gesture: what must be reported, in this order
EXPECTED = {
    "tap": ("tap",),
    "double-tap": ("tap", "double-tap"),
    "hold": ("hold",),
    "swipe": ("swipe",),
    "pinch": ("pinch",),
    "spread": ("spread",),
    "rotate": ("rotate",),
    "drag": (),
    "press": (),
}
SLACK_S = 0.2  # after its end an event is still its own
MAX_TURN_DEG = 30.0  # of a swipe's direction from the true one


@dataclass(frozen=True)
class ReportedGesture:
    """A gesture as it was reported: ``first_s`` when it was recognised, ``last_s`` when its end was
    reported, both at the end of the scan that showed it."""

    kind: str
    first_s: float
    last_s: float
    direction_deg: float


@dataclass
class GestureCount:
    """Counts of one session, or of several added up: ``done`` gestures of each kind, ``right``
    ones, ``invented`` ones that no gesture accounts for, ``reported`` in all, gestures by whether a
    finger is light, what was taken for what, at which stages gestures and others failed, and the
    latency in s of each right one."""

    done: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)
    invented: Counter[str] = field(default_factory=Counter)
    reported: int = 0
    light: Counter[bool] = field(default_factory=Counter)
    light_right: Counter[bool] = field(default_factory=Counter)
    taken_for: Counter[tuple[str, str]] = field(default_factory=Counter)
    stages: Counter[str] = field(default_factory=Counter)
    late_s: dict[str, list[float]] = field(default_factory=dict)

    @property
    def gestures(self) -> int:
        """Return the true gestures, without other events."""
        return sum(n for kind, n in self.done.items() if EXPECTED[kind])

    @property
    def right_gestures(self) -> int:
        """The number of right gestures of the kinds that are expected."""
        return sum(n for kind, n in self.right.items() if EXPECTED[kind])

    def add(self, other: "GestureCount") -> None:
        """Count ``other`` in."""
        self.done += other.done
        self.right += other.right
        self.invented += other.invented
        self.reported += other.reported
        self.light += other.light
        self.light_right += other.light_right
        self.taken_for += other.taken_for
        self.stages += other.stages
        for kind, late in other.late_s.items():
            self.late_s.setdefault(kind, []).extend(late)


def reported_gestures(frames: Iterable[TouchedFrame], gestures: Gestures) -> list[ReportedGesture]:
    """Return what ``gestures`` reports for the frames."""
    reported: list[ReportedGesture] = []
    for frame in frames:
        now_s = frame.time_us * 1e-6 + 1 / RATE_HZ
        for event in gestures.update(frame.touches, frame.time_us):
            if event.phase == EventPhase.BEGIN:
                reported.append(ReportedGesture(event.name, now_s, float("inf"), 0.0))
            elif event.phase == EventPhase.END:
                k = max(i for i, one in enumerate(reported) if one.kind == event.name)
                reported[k] = ReportedGesture(event.name, reported[k].first_s, now_s, 0.0)
            elif event.phase == EventPhase.ONCE and event.kind > EventKind.UP:
                reported.append(ReportedGesture(event.name, now_s, now_s, event.direction_deg))
    return reported


def judge(
    session: DrawnSession,
    reported: Sequence[ReportedGesture],
    frames: Sequence[TouchedFrame] = (),
) -> GestureCount:
    """Each reported gesture belongs to the gesture in whose time it was recognised. A gesture is
    right where exactly what is expected was reported, and a swipe's direction fits. With the
    ``frames`` from which it was reported, the stages at which the others failed are counted."""
    count, rest = GestureCount(reported=len(reported)), list(reported)
    for one in session.gestures:
        mine = [t for t in rest if one.start_s <= t.first_s <= _until(one) + SLACK_S]
        rest = [t for t in rest if t not in mine]
        kinds, wanted = tuple(t.kind for t in mine), EXPECTED[one.kind]
        right = kinds == wanted and all(_fits(one, t) for t in mine)
        count.done[one.kind] += 1
        count.right[one.kind] += right
        if wanted:
            count.light[one.is_light] += 1
            count.light_right[one.is_light] += right
        count.taken_for[one.kind, " + ".join(kinds) or "nothing"] += 1
        if not right and frames:
            count.stages[failed_stage(one, frames)] += 1
        surplus = Counter(kinds) - Counter(wanted)
        count.invented += surplus
        if right and mine:
            count.late_s.setdefault(one.kind, []).append(mine[-1].last_s - _end(one))
    count.invented += Counter(t.kind for t in rest)
    return count


def _until(one: DrawnGesture) -> float:
    return max((float(finger.at_s[-1]) for finger in one.fingers), default=one.end_s)


def _end(one: DrawnGesture) -> float:
    """A hold's end is when it has lasted long enough."""
    from eitskin.core.constants_table import HOLD_US

    return one.start_s + HOLD_US * 1e-6 if one.kind == "hold" else one.end_s


def _fits(one: DrawnGesture, reported: ReportedGesture) -> bool:
    if one.direction_deg is None:
        return True
    off = (reported.direction_deg - one.direction_deg + 180) % 360 - 180
    return abs(off) <= MAX_TURN_DEG
