"""The streams of moving fingers by which the study of constants judges."""

import numpy as np

from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments.constants.streams import (
    FRAMES,
    GAP_MM,
    RATE_HZ,
    passing_streams,
    random_streams,
)


def test_streams_are_those_of_their_seed_and_fingers_stay_apart():
    outline = paper_skin().outline
    drawn = random_streams(outline, 3, "test", 200, 6)
    again = random_streams(outline, 3, "test", 200, 2)
    assert [one.facts() for one in drawn[:2]] == [one.facts() for one in again]
    assert drawn[0].facts() != random_streams(outline, 4, "test", 200, 1)[0].facts()
    for one in drawn:
        for frame in range(FRAMES):
            _, places, radii = one.true_mm(frame)
            assert (np.hypot(*places.T) + radii <= 97.0 - 3.99).all()
            for k, (place, radius) in enumerate(zip(places, radii, strict=True)):
                for other, further in zip(places[:k], radii[:k], strict=True):
                    assert np.hypot(*(place - other)) - radius - further >= GAP_MM - 1e-9
        for finger in one.samples:
            both = finger.there[1:] & finger.there[:-1]
            step = np.hypot(np.diff(finger.x_mm), np.diff(finger.y_mm))[both]
            assert (step <= 200 / RATE_HZ + 1e-9).all() and np.median(step) > 0.9 * 200 / RATE_HZ
            there = finger.contrast[finger.there]
            assert there.max() > 1.1 * there[0] > 1  # it lands lightly


def test_fingers_that_pass_come_near():
    for one in passing_streams(1, 50, 3):
        nearest = min(
            np.hypot(*np.diff(one.true_mm(k)[1], axis=0)[0]) - one.true_mm(k)[2].sum()
            for k in range(FRAMES)
        )
        assert 4.9 < nearest < 6.0
