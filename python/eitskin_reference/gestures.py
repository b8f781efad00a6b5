"""The numpy reference of the core's gestures (csrc/src/gesture): the same events and the same bits
in float32, written for reading. Times are whole microseconds modulo 2^32."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eitskin.core.diagnostics_table import Touch
from eitskin.core.gestures import GestureEvent
from eitskin.core.gestures_table import EventKind, EventPhase
from eitskin_reference import constants_table as c

MAX_CONTACTS, TRAIL = 32, 8
R = np.float32
NONE, NEW, DOWN, LIFTED = range(4)
ZERO = R(0)


def apart(dx: Any, dy: Any) -> Any:
    """Length of (dx, dy)."""
    return np.sqrt(dx * dx + dy * dy)


def angle_deg(y: Any, x: Any) -> Any:
    """Of (x, y) from the first axis, -180 to 180; Abramowitz and Stegun 4.4.47."""
    high, wide = np.abs(y), np.abs(x)
    if high == 0 and wide == 0:
        return R(0)
    t = high / wide if high <= wide else wide / high
    s, total = t * t, R(0.0208351)
    for factor in (-0.0851330, 0.1801410, -0.3302995, 0.9998660):
        total = R(factor) + total * s
    angle = total * t * R(57.29577951308232)
    angle = angle if high <= wide else R(90) - angle
    angle = R(180) - angle if x < 0 else angle
    return -angle if y < 0 else angle


@dataclass
class Contact:
    """A finger, as eits_contact."""

    state: int = NONE
    id: int = 0
    touch_id: int = 0
    born_us: int = 0
    seen_us: int = 0
    x: Any = ZERO
    y: Any = ZERO
    seen_x: Any = ZERO
    seen_y: Any = ZERO
    strength: Any = ZERO
    explained: Any = ZERO
    start_x: Any = ZERO
    start_y: Any = ZERO
    told_x: Any = ZERO
    told_y: Any = ZERO
    farthest: Any = ZERO
    trail: list[tuple[int, Any, Any]] = field(default_factory=list)
    seen: bool = False
    company: bool = False
    done: bool = False
    tapped: bool = False
    dubious: bool = False
    going: bool = False
    renamed: bool = False


@dataclass
class Pair:
    """Two fingers, as eits_finger_pair."""

    on: bool = False
    first: int = 0
    second: int = 0
    first_id: int = 0
    second_id: int = 0
    kind: int = 0
    base: Any = ZERO
    turned: Any = ZERO
    dx: Any = ZERO
    dy: Any = ZERO
    extreme: Any = ZERO
    told: Any = ZERO
    told_turn: Any = ZERO


def since(now_us: int, then_us: int) -> int:
    """Microseconds, over the wrap."""
    return (now_us - then_us) % 2**32


class ReferenceGestures:
    """As ``core.gestures.Gestures`` with the usual options and no zones."""

    def __init__(self) -> None:
        self.contacts = [Contact() for _ in range(MAX_CONTACTS)]
        self.pair = Pair()
        self.now, self.begun = 0, False
        self.tap: tuple[int, Any, Any] | None = None
        self.out: list[GestureEvent] = []

    def update(self, touches: Sequence[Touch], time_us: int) -> list[GestureEvent]:
        """What the frame at ``time_us`` tells."""
        self.out, time_us = [], time_us % 2**32
        elapsed = since(time_us, self.now)
        if self.begun and elapsed == 0:
            return self.out
        with np.errstate(over="ignore"):
            if self.begun and elapsed > c.LONGEST_GAP_US:
                self._begin_again()
            self.now, self.begun = time_us, True
            self._match(touches)
            self._note_company()
            self._end_lost()
            self._pair_step()
            self._hold()
        return self.out

    def _tell(
        self, kind: int, x: Any, y: Any, first: int, second: int = 0, phase: int = 0,
        direction: Any = ZERO, value: Any = ZERO,
    ) -> None:  # fmt: skip
        self.out.append(
            GestureEvent(
                EventKind(kind), EventPhase(phase), first, second, 0, self.now,
                float(x), float(y), float(direction), float(value),
            )
        )  # fmt: skip

    # ---- which is which ----

    def _waits(self, one: Contact, touch: Touch) -> bool:
        if one.seen or one.state == NONE:
            return False
        recent = since(self.now, one.seen_us) <= c.REJOIN_US
        return one.state != LIFTED or (touch.explained > 0 and recent)

    def _of_id(self, touch: Touch) -> Contact | None:
        same = (one for one in self.contacts if one.touch_id == touch.id)
        return next((one for one in same if self._waits(one, touch)), None)

    def _of_place(self, touch: Touch) -> Contact | None:
        nearest, found = R(c.REJOIN_MM), None
        for one in self.contacts:
            distance = apart(R(touch.x_mm) - one.x, R(touch.y_mm) - one.y)
            lifted = one.state == LIFTED and one.going
            if not lifted and self._waits(one, touch) and distance <= nearest:
                nearest, found = distance, one
        return found

    def _free_place(self) -> int | None:
        found, longest = None, 0
        for k, one in enumerate(self.contacts):
            if one.state == NONE:
                return k
            age = since(self.now, one.seen_us)
            if one.state == LIFTED and not one.seen and age >= longest:
                found, longest = k, age
        return found

    def _match(self, touches: Sequence[Touch]) -> None:
        for one in self.contacts:
            one.seen = one.renamed = False
        rest = [touch for touch in touches if _is_touch(touch)]
        for find in (self._of_id, self._of_place):
            left = []
            for touch in rest:
                found = find(touch)
                if found is None:
                    left.append(touch)
                else:
                    self._go_on(found, touch)
            rest = left
        for touch in rest:
            if touch.explained > 0:
                self._begin(touch)

    # ---- a finger's life ----

    def _note_place(self, one: Contact, touch: Touch) -> None:
        strength, explained = np.abs(R(touch.strength_s_per_m_mm2)), R(touch.explained)
        firm = strength >= R(c.FIRM) * one.strength
        if explained > 0:
            one.going = bool(not firm or explained < R(c.GOING) * one.explained)
            one.explained = explained
        elif one.going:
            return
        one.touch_id, one.seen_us, one.seen = touch.id, self.now, True
        one.seen_x, one.seen_y = R(touch.x_mm), R(touch.y_mm)
        one.strength = strength if firm else one.strength + (strength - one.strength) * R(0.25)
        if not firm or not explained > 0:
            return
        one.x, one.y = one.seen_x, one.seen_y
        one.trail = [*one.trail[1 - TRAIL :], (self.now, one.x, one.y)]
        if one.state not in (DOWN, LIFTED):
            one.start_x, one.start_y = one.x, one.y
            return
        far = apart(one.x - one.start_x, one.y - one.start_y)
        one.farthest = max(far, one.farthest)

    def _tell_place(self, one: Contact, kind: int) -> None:
        one.told_x, one.told_y = one.x, one.y
        self._tell(kind, one.x, one.y, one.id)

    def _go_on(self, one: Contact, touch: Touch) -> None:
        self._note_place(one, touch)
        wait = c.DOUBT_US if one.dubious else c.SETTLE_US
        old = since(self.now, one.born_us) >= wait
        if one.state == LIFTED or (one.state == NEW and old):
            one.state = DOWN
            self._tell_place(one, EventKind.DOWN)
        elif one.state == DOWN and apart(one.x - one.told_x, one.y - one.told_y) >= R(c.MOVE_MM):
            self._tell_place(one, EventKind.MOVE)

    def _begin(self, touch: Touch) -> None:
        place = self._free_place()
        if place is None:
            return
        strength, x, y = np.abs(R(touch.strength_s_per_m_mm2)), R(touch.x_mm), R(touch.y_mm)
        dubious = any(
            one.state == DOWN
            and (
                apart(x - one.x, y - one.y) < R(c.SPLIT_MM) or strength < R(c.FAINT) * one.strength
            )
            for one in self.contacts
        )
        one = self.contacts[place] = Contact(NEW, touch.id, born_us=self.now, dubious=dubious)
        self._note_place(one, touch)

    def _note_company(self) -> None:
        for one in self.contacts:
            for other in self.contacts:
                if other is one or one.state != DOWN or other.state != DOWN:
                    continue
                age, its = since(self.now, one.born_us), since(self.now, other.born_us)
                one.company |= its > age or its >= c.DOUBT_US

    def _lift(self, place: int) -> None:
        one = self.contacts[place]
        if self.pair.on and place in (self.pair.first, self.pair.second):
            if self.pair.kind:
                self._tell_pair(EventPhase.END)
            self.pair.on = False
        self._tell_place(one, EventKind.UP)
        one.state = LIFTED

    def _is_renamed(self, one: Contact) -> bool:
        for other in self.contacts:
            far = apart(other.x - one.x, other.y - one.y) > R(c.REJOIN_MM)
            if other.state != NEW or not other.seen or far:
                continue
            touch = Touch(
                other.touch_id, float(other.x), float(other.y), 0.0, float(other.strength),
                float(other.explained),
            )  # fmt: skip
            self._note_place(one, touch)
            one.renamed, other.state = True, NONE
            if since(self.now, one.born_us) <= 2 * c.DOUBT_US and not one.going:
                one.start_x, one.start_y, one.farthest = one.x, one.y, R(0)
            return True
        return False

    def _end_lost(self) -> None:
        for place, one in enumerate(self.contacts):
            age = since(self.now, one.seen_us)
            if one.seen or (one.state == DOWN and self._is_renamed(one)):
                continue
            if one.state == DOWN and age >= c.LOST_US:
                self._lift(place)
                self._lifted(one)
            elif (one.state == NEW and age >= c.LOST_US) or (
                one.state == LIFTED and age > c.REJOIN_US
            ):
                one.state = NONE

    def _begin_again(self) -> None:
        for place, one in enumerate(self.contacts):
            if one.state == DOWN:
                self._lift(place)
            self.contacts[place] = Contact()
        self.pair, self.tap = Pair(), None

    # ---- one finger ----

    def _outlived(self, one: Contact) -> bool:
        return any(
            other is not one
            and other.state in (DOWN, LIFTED)
            and since(self.now, other.seen_us) <= since(self.now, one.seen_us)
            and since(self.now, other.born_us) >= since(self.now, one.born_us)
            for other in self.contacts
        )

    def _lifted(self, one: Contact) -> None:
        lasted = since(one.seen_us, one.born_us)
        going = apart(one.seen_x - one.start_x, one.seen_y - one.start_y)
        if self._outlived(one) or one.company or one.done:
            return
        still = one.farthest <= R(c.STILL_MM) and going <= R(2) * R(c.STILL_MM)
        long_enough = lasted >= c.SHORT_US or one.explained >= R(c.TAP_CLEAR)
        if not one.tapped and still and long_enough and lasted <= c.TAP_US:
            self._tap(one)
        elif lasted <= c.SWIPE_US:
            self._swipe(one)

    def _tap(self, one: Contact) -> None:
        again = False
        if self.tap is not None:
            then, x, y = self.tap
            near = apart(one.start_x - x, one.start_y - y) <= R(c.DOUBLE_MM)
            again = bool(since(one.born_us, then) <= c.DOUBLE_US and near)
        self._tell(
            EventKind.DOUBLE_TAP if again else EventKind.TAP, one.start_x, one.start_y, one.id
        )
        one.tapped = True
        self.tap = None if again else (one.seen_us, one.start_x, one.start_y)

    def _swipe(self, one: Contact) -> None:
        last, x, y = one.trail[-1]
        at = one.trail[-1]
        for before in one.trail[-2::-1]:
            if since(last, before[0]) > c.SPEED_US:
                break
            at = before
        span = since(last, at[0])
        speed = apart(x - at[1], y - at[2]) / (R(span) * R(1e-6)) if span else R(0)
        if self._is_swipe(one, x - one.start_x, y - one.start_y, speed):
            return
        if one.seen_us != last and since(one.seen_us, one.born_us) <= c.TAP_US:
            going = apart(one.seen_x - one.x, one.seen_y - one.y)
            speed = going / (R(since(one.seen_us, last)) * R(1e-6))
            self._is_swipe(one, one.seen_x - one.start_x, one.seen_y - one.start_y, speed)

    def _is_swipe(self, one: Contact, dx: Any, dy: Any, speed: Any) -> bool:
        length, angle = apart(dx, dy), angle_deg(dy, dx)
        before = speed * R(c.SETTLE_US) * R(1e-6)
        if (
            length + before < R(c.SWIPE_MM)
            or speed < R(c.SWIPE_MM_PER_S)
            or length < R(c.SWIPE_STRAIGHT) * one.farthest
        ):
            return False
        one.done = True
        self._tell(
            EventKind.SWIPE, one.start_x, one.start_y, one.id,
            direction=angle + R(360) if angle < 0 else angle, value=length,
        )  # fmt: skip
        return True

    def _hold(self) -> None:
        for one in self.contacts:
            age = since(self.now, one.born_us)
            if one.state != DOWN or one.company or one.done or age < c.HOLD_US:
                continue
            if one.farthest <= R(c.STILL_MM):
                one.done = True
                value = R(age) * R(1e-6)
                self._tell(EventKind.HOLD, one.start_x, one.start_y, one.id, value=value)

    # ---- two fingers ----

    def _tell_pair(self, phase: int) -> None:
        p = self.pair
        one, other = self.contacts[p.first], self.contacts[p.second]
        turn = p.kind == EventKind.ROTATE
        self._tell(
            p.kind, (one.x + other.x) * R(0.5), (one.y + other.y) * R(0.5), p.first_id,
            p.second_id, phase, value=p.turned if turn else _distance(p.dx, p.dy) / p.base,
        )  # fmt: skip

    def _look_for_pair(self) -> None:
        found = [
            k
            for k, one in enumerate(self.contacts)
            if one.state == DOWN and one.seen and since(self.now, one.born_us) >= c.SETTLE_US
        ]
        if len(found) != 2:
            return
        one, other = (self.contacts[k] for k in found)
        dx, dy = other.x - one.x, other.y - one.y
        base = _distance(dx, dy)
        self.pair = Pair(True, found[0], found[1], one.id, other.id, 0, base, R(0), dx, dy, base)

    def _take_up(self) -> bool:
        p = self.pair
        one, other = self.contacts[p.first], self.contacts[p.second]
        p.on = bool(
            p.kind != 0
            and one.state == other.state == DOWN
            and (one.id, other.id) == (p.first_id, p.second_id)
        )
        return p.on

    def _pair_step(self) -> None:
        if not self.pair.on and not self._take_up():
            self._look_for_pair()
            return
        p = self.pair
        one, other = self.contacts[p.first], self.contacts[p.second]
        if not (one.seen and other.seen):
            return
        if (one.renamed or other.renamed) and p.kind == 0:
            p.on = False
            return
        dx, dy = other.x - one.x, other.y - one.y
        p.turned = p.turned + angle_deg(p.dx * dy - p.dy * dx, p.dx * dx + p.dy * dy)
        p.dx, p.dy = dx, dy
        distance = _distance(dx, dy)
        if p.kind == 0:
            self._recognise(distance)
        else:
            self._pair_on(distance)

    def _begin_kind(self, kind: int, distance: Any) -> None:
        p = self.pair
        p.kind, p.extreme, p.told, p.told_turn = kind, distance, distance, p.turned
        self._tell_pair(EventPhase.BEGIN)

    def _recognise(self, distance: Any) -> None:
        p = self.pair
        along, about = np.abs(distance - p.base), _way_round(p.turned, distance)
        if along < R(c.PAIR_MM) and about < R(c.PAIR_MM):
            return
        nearer = EventKind.PINCH if distance < p.base else EventKind.SPREAD
        self._begin_kind(EventKind.ROTATE if about > along else nearer, distance)

    def _pair_on(self, distance: Any) -> None:
        p = self.pair
        pinch, turn = p.kind == EventKind.PINCH, p.kind == EventKind.ROTATE
        back = distance - p.extreme if pinch else p.extreme - distance
        if not turn and back >= R(c.PAIR_MM):
            self._tell_pair(EventPhase.END)
            p.base = p.extreme
            self._begin_kind(EventKind.SPREAD if pinch else EventKind.PINCH, distance)
            return
        p.extreme = distance if back < 0 else p.extreme
        moved = _way_round(p.turned - p.told_turn, distance) if turn else np.abs(distance - p.told)
        if moved < R(c.MOVE_MM):
            return
        p.told, p.told_turn = distance, p.turned
        self._tell_pair(EventPhase.CHANGE)


def _is_touch(touch: Touch) -> bool:
    place = max(abs(R(touch.x_mm)), abs(R(touch.y_mm)))
    known = not (np.isnan(touch.x_mm) or np.isnan(touch.y_mm))
    return bool(known and place <= c.MAX_PLACE_MM and np.isfinite(R(touch.strength_s_per_m_mm2)))


def _distance(dx: Any, dy: Any) -> Any:
    return max(apart(dx, dy), R(c.MIN_APART_MM))


def _way_round(degrees: Any, distance: Any) -> Any:
    return np.abs(degrees) * R(0.017453292519943295) * distance
