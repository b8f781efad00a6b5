"""The numpy reference makes the core's events, bit for bit, of any stream of touches."""

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.core.gestures import Gestures, event_numbers
from eitskin_reference.gestures import ReferenceGestures

FRAMES = 700


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


@pytest.mark.parametrize("seed", range(6))
def test_the_reference_has_the_cores_bits(seed):
    core, reference = Gestures(), ReferenceGestures()
    kinds = set()
    for number, (now, touches) in enumerate(wild_stream(seed)):
        here, there = core.update(touches, now), reference.update(touches, now)
        assert event_numbers(here).tobytes() == event_numbers(there).tobytes(), (seed, number)
        kinds |= {event.name for event in here}
    assert {"down", "move", "up"} < kinds
