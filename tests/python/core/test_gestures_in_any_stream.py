"""Properties of events that hold for any stream of touches, sensible or not."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.core.gestures import GestureEvent, Gestures, event_numbers
from eitskin.core.gestures_table import EventKind, EventPhase

FRAMES = 700
Stream = list[tuple[int, list[Touch]]]


def wild_stream(seed: int) -> list[tuple[int, list[Touch]]]:
    """Fingers that come, wander, turn about each other and go; some lost, split, renamed, held, not
    numbers; times of 48 and 96 frames a second, now and then none or backwards."""
    g = np.random.default_rng(seed)
    now, number, frames = int(g.integers(2**32)), 1, []
    fingers: list[list[float]] = []  # id, x, y, dx, dy, strength, frames left
    for _ in range(FRAMES):
        now += int(g.choice([20833, 10417, 0, -30000, 1_500_000], p=[0.6, 0.37, 0.01, 0.01, 0.01]))
        if len(fingers) < 4 and g.uniform() < 0.15:
            x, y = g.uniform(-80, 80, 2)
            speed, angle = g.choice([0.0, 2.0, 8.0]), g.uniform(0, 2 * np.pi)
            fingers.append([number, x, y, speed * np.cos(angle), speed * np.sin(angle),
                            g.uniform(0.2, 5), g.integers(1, 50)])  # fmt: skip
            number += 1
        touches = []
        for one in fingers:
            one[1] += one[3] + g.normal(0, 0.5)
            one[2] += one[4] + g.normal(0, 0.5)
            one[6] -= 1
            if g.uniform() < 0.03:
                one[0], number = number, number + 1
            if g.uniform() < 0.05:
                continue
            strength = one[5] * g.choice([1.0, 0.9, 0.5], p=[0.8, 0.15, 0.05])
            explained = g.choice([0.9, 0.4, 0.1, 0.0, np.nan], p=[0.7, 0.1, 0.1, 0.09, 0.01])
            x = one[1] if g.uniform() > 0.01 else g.choice([np.nan, np.inf, 1e30])
            touches.append(Touch(int(one[0]), x, one[2], 8.0, strength, explained))
            if g.uniform() < 0.03:
                touches.append(Touch(number, x + 9, one[2], 8.0, strength, 0.3))
                number += 1
        fingers = [one for one in fingers if one[6] > 0]
        frames.append((now % 2**32, touches))
    return frames


def events(stream: Iterable[tuple[int, list[Touch]]]) -> list[GestureEvent]:
    core = Gestures()
    return [event for now, touches in stream for event in core.update(touches, now)]


@pytest.mark.parametrize("seed", range(6))
def test_a_finger_lands_moves_and_lifts_in_this_order(seed):
    """Each id is down before it moves or lifts, and lifts no oftener than it lands; each gesture
    that goes on has begun before it changes or ends, and began with fingers that were down; after
    an end, fingers that are found again soon may go on with it. Numbers are finite."""
    landed, lifted = Counter[int](), Counter[int]()
    begun, kinds = set[EventKind](), set[EventKind]()
    for event in events(wild_stream(seed)):
        kinds.add(event.kind)
        assert np.isfinite([event.x_mm, event.y_mm, event.value, event.direction_deg]).all()
        landed[event.first_id] += event.kind == EventKind.DOWN
        lifted[event.first_id] += event.kind == EventKind.UP
        assert landed[event.first_id] >= max(1, lifted[event.first_id])
        if event.phase == EventPhase.BEGIN:
            assert landed[event.second_id] > 0
            begun.add(event.kind)
        elif event.phase in (EventPhase.CHANGE, EventPhase.END):
            assert event.kind in begun
    assert {EventKind.DOWN, EventKind.MOVE, EventKind.UP} < kinds


@pytest.mark.parametrize("seed", range(3))
def test_the_clock_may_start_anywhere(seed):
    """Also where it wraps in the middle of the stream."""
    stream = wild_stream(seed)
    by = 2**32 - stream[FRAMES // 2][0] + 5
    later = [((now + by) % 2**32, touches) for now, touches in stream]
    shifted = [replace(e, time_us=(e.time_us - by) % 2**32) for e in events(later)]
    assert event_numbers(shifted).tobytes() == event_numbers(events(stream)).tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_names_of_fingers_are_names(seed):
    """Other ids, in the same order: the same events of the others."""
    stream = wild_stream(seed)
    renamed = [(now, [replace(t, id=t.id + 1000) for t in touches]) for now, touches in stream]
    back = [
        replace(e, first_id=e.first_id - 1000, second_id=max(0, e.second_id - 1000))
        for e in events(renamed)
    ]
    assert event_numbers(back).tobytes() == event_numbers(events(stream)).tobytes()


def test_an_untouched_skin_has_no_events():
    assert events((20_000 * k, []) for k in range(500)) == []


@pytest.mark.parametrize("turn_deg", [0.0, 90.0, 180.0, 250.0])
@pytest.mark.parametrize("speed_mm_s", [200.0, 400.0])
def test_a_swipe_is_a_swipe_whichever_way(turn_deg, speed_mm_s):
    """One, along its way, and no tap or hold beside it; the same at any time."""
    along = np.array([np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))])
    for begin_us in (0, 2**32 - 100_000):
        stream: Stream = []
        for k in range(12):
            x, y = (-30 + 0.02 * speed_mm_s * k) * along
            stream.append(((begin_us + 20_000 * k) % 2**32, [Touch(1, x, y, 8.0, 1.0, 0.9)]))
        stream += [((begin_us + 20_000 * k) % 2**32, []) for k in range(12, 40)]
        found = [event for event in events(stream) if event.is_gesture]
        assert [event.kind for event in found] == [EventKind.SWIPE]
        off = (found[0].direction_deg - turn_deg + 180) % 360 - 180
        assert abs(off) < 1 and found[0].value > 30
