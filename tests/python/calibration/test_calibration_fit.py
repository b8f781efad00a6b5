"""The fit finds known laws and gains, reports its uncertainty, and refuses presses that cannot
determine them."""

from dataclasses import replace

import numpy as np
import pytest
from known_presses import RADIUS_MM, gain_of, places, presses, saturating

from eitskin.calibration.fit import PLACE_MM, calibrate, places_of, weights_of
from eitskin.calibration.presses import joined
from eitskin.errors import FrameError


def test_a_known_law_and_gain_are_found():
    found = calibrate(presses(), RADIUS_MM)
    seen = found.fitted.form, found.fitted.order, found.groups, found.by_place
    assert seen == ("saturating", 2, 24, True)
    for value, true, (low, high) in zip(
        found.fitted.numbers, (4.0, 1.5), found.interval, strict=True
    ):
        assert value == pytest.approx(true, rel=0.05)
        assert low < true < high and high - low < 0.3 * true
    assert found.scatter[0] > 0.1 and found.scatter[1] < 0.025
    uncertainty = np.quantile(np.abs(found.left_out), 0.95)
    assert found.law.uncertainty == pytest.approx(uncertainty, rel=1e-6)
    assert found.notes == ()
    new = np.array([(10.0, -70.0), (-60.0, 20.0), (0.0, 0.0), (33.0, 44.0)])
    force = np.array([0.6, 1.2, 1.7, 1.9])
    reported = found.law.forces_at(new, saturating(force) / gain_of(new))
    assert reported == pytest.approx(force, rel=0.02)


def test_a_flat_skin_needs_no_gain():
    found = calibrate(presses(bent=False), RADIUS_MM, resamples=0)
    assert found.fitted.order == 0 and found.law.gain.tolist() == [1.0]


@pytest.mark.parametrize("exponent", [0.6, 1.3])
def test_powers_are_told_as_well(exponent):
    known = presses(noise=0.002, bent=False)
    strength = 2.0 * known.force_n**exponent * known.strength / saturating(known.force_n)
    found = calibrate(replace(known, strength=strength), RADIUS_MM, resamples=0)
    seen = 2.0 * np.array([0.7, 1.9]) ** exponent
    assert found.law.forces_at(np.zeros((2, 2)), seen) == pytest.approx([0.7, 1.9], rel=0.01)


def test_the_table_is_the_law():
    law = calibrate(presses(noise=0.0), RADIUS_MM, resamples=0).law
    force = np.linspace(0.02, 2.0, 50)
    reported = law.forces_at(np.zeros((50, 2)), saturating(force))
    assert reported == pytest.approx(force, rel=2e-3, abs=2e-4)
    strong = np.array([1.02 * saturating(np.array(2.0)), 100.0, np.inf])
    beyond = law.forces_at(np.zeros((3, 2)), strong)
    # the last slope, to twice the greatest force
    assert beyond[0] > 2.0 and beyond[1] == beyond[2] == 4.0


def test_beyond_the_outermost_place_the_gain_stays():
    law = calibrate(presses(), RADIUS_MM, resamples=0).law
    assert law.reach == pytest.approx(np.hypot(*places(24).T).max() / RADIUS_MM)
    out = law.gains_at(np.array([(law.reach * RADIUS_MM, 0.0), (200.0, 0.0), (1e9, 0.0)]))
    assert out[1:] == pytest.approx(out[0])


def test_one_place_is_told_to_be_one():
    found = calibrate(presses().take(np.arange(5)), RADIUS_MM, resamples=20)
    assert (found.groups, found.by_place, found.fitted.order) == (1, False, 0)
    said = "1 place: the gain is taken to be the same everywhere; press at 5 or more"
    assert found.notes[0].startswith(said)


def test_unlike_intervals_for_unlike_noise():
    width = []
    for noise in (0.005, 0.05):
        (low, high), *_ = calibrate(presses(noise=noise), RADIUS_MM, resamples=60).interval
        width.append(high - low)
    assert width[1] > 3 * width[0]


def test_the_same_seed_gives_the_same():
    reported = [calibrate(presses(8), RADIUS_MM, seed=4, resamples=20).as_dict() for _ in range(2)]
    assert reported[0] == reported[1]


ALIKE = r"1\.14 times the least, which cannot show a law; use a range of 1\.5 times or more"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda p: p.take(np.arange(3)), "3 presses are too few; record at least 4"),
        (lambda p: p.take(np.arange(0, 120, 5)),
         "1 different weights are too few; use at least 3"),
        (lambda p: p.take(np.flatnonzero(np.isin(p.force_n, [1.0, 1.5]))),
         "2 different weights are too few"),
        (lambda p: replace(p, force_n=1 + 0.1 * p.force_n), ALIKE),
        (lambda p: replace(p, strength=1 / p.force_n), "strength does not grow with force"),
    ],
    ids=["three", "one weight", "two weights", "weights too alike", "falling"],
)  # fmt: skip
def test_what_shows_no_law_is_refused(change, text):
    with pytest.raises(FrameError, match=text):
        calibrate(change(presses()), RADIUS_MM)


def test_places_and_weights_are_told_apart():
    chain = PLACE_MM * np.array([(0.0, 0.0), (0.9, 0.0), (1.8, 0.0), (4, 0.0)])
    assert places_of(chain).tolist() == [0, 0, 0, 1]
    assert weights_of(np.array([2.0, 1.0, 1.001, 2.0])).tolist() == [1.0, 2.0]
    both = joined([presses(3), presses(4)])
    assert len(both) == 35


def test_a_straight_line_is_told_to_have_no_end():
    known = presses(noise=0.0, bent=False)
    line = replace(known, strength=2 * known.force_n)
    found = calibrate(line, RADIUS_MM, resamples=0)
    assert "no saturation" in " ".join(found.notes) or found.fitted.form == "power"
    assert replace(found, notes=()).as_dict()["error_rms"] < 0.01
