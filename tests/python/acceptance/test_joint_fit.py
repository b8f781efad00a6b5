"""Errors of places on frames of the exact model of a round skin, with the joint fit and without
it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.options_table import ALL_TOUCH_FIT, JOINT
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TouchRules, TouchScene, TrueTouch, random_touches
from eitskin.scoring.matching import Matching, match
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

# Contacts are spread by 20 %; the tare has 64 frames.
SCENES, SEED, SNR_DB, BITS, CONTACT_SPREAD, TARE_FRAMES = 12, 3101, 60.0, 12, 0.2, 64
KINDS = {
    "discs": TouchRules(count=(1, 3)),
    "ellipses": TouchRules(count=(1, 3), shape="ellipse", aspect=(1.2, 2.0)),
    "fingers": TouchRules(count=(1, 3), shape="finger", aspect=(1.2, 2.0)),
    "light": TouchRules(count=(1, 3), contrast=(1.15, 2.0)),
    "insulating": TouchRules(count=(1, 3), contrast=(0.1, 0.5)),
}


@dataclass(frozen=True, eq=False)
class Frames:
    """A scene, its untouched frames (n, m) and one touched frame (m,), V."""

    scene: TouchScene
    untouched_v: FloatArray
    touched_v: FloatArray


def measured(scene: TouchScene, number: int) -> Frames:
    skin = paper_skin()
    draw = np.random.default_rng([SEED, number])
    spread = np.exp(CONTACT_SPREAD * draw.standard_normal(skin.electrodes.count))
    contacts = skin.electrodes.contact_impedance_ohm_m2 * spread
    exact = RoundSkin(skin, prebuilt()[0].protocol, contacts)
    untouched_v, touched_v = exact.voltages([]), exact.voltages(scene.touches)
    read = np.vstack([np.tile(untouched_v, (TARE_FRAMES, 1)), touched_v])
    sigma_v = np.sqrt((untouched_v**2).mean()) * 10 ** (-SNR_DB / 20)
    step_v = 2.5 * np.abs(untouched_v).max() / 2**BITS
    read = np.round((read + sigma_v * draw.standard_normal(read.shape)) / step_v) * step_v
    return Frames(scene, read[:-1], read[-1])


@cache
def frames(kind: str) -> tuple[Frames, ...]:
    rules = random_touches(paper_skin().outline, SEED, SCENES, f"joint {kind}", KINDS[kind])
    return tuple(measured(scene, number) for number, scene in enumerate(rules.scenes))


def found_by(
    solver: Reconstructor, kind: str
) -> Iterator[tuple[Frames, Sequence[Touch], Matching]]:
    """Yield each scene of a kind with the touches found in it, and those matched."""
    for one in frames(kind):
        solver.tare(one.untouched_v)
        solver.forget()
        found = solver.reconstruct(one.touched_v).touches
        yield one, found, match(one.scene.centres_mm(), [(t.x_mm, t.y_mm) for t in found])


def found_in(one: Frames) -> Matching:
    """Reconstruct one scene's frame, and match the found touches with the true ones."""
    solver = Reconstructor(prebuilt()[0])
    solver.tare(one.untouched_v)
    found = solver.reconstruct(one.touched_v).touches
    return match(one.scene.centres_mm(), [(t.x_mm, t.y_mm) for t in found])


def errors_mm(kind: str, touch_fit: int) -> tuple[FloatArray, int]:
    """The distances of found touches from true ones, and how many scenes have the right count."""
    solver = Reconstructor(prebuilt()[0])
    solver.set_options(touch_fit=touch_fit)
    distances: list[float] = []
    right = 0
    for _, _, matched in found_by(solver, kind):
        distances += matched.distances_mm
        right += matched.exact
    return np.array(distances), right


# Bounds of the median and of the 95th percentile, mm. Measured on this seed: discs .161 and .72,
# ellipses .110 and .81, fingers .172 and 1.79; without the joint fit the medians are .35, .62 and
# .58. On the four seeds after it: discs .10 to .15 and .41 to 2.0, ellipses .11 to .17 and .34 to
# .49; fingers on one of them .152 and .53. The bounds leave a quarter to a half above this seed's.
@pytest.mark.parametrize(
    ("kind", "median_mm", "p95_mm"),
    [
        ("discs", 0.20, 1.0),
        ("ellipses", 0.16, 1.1),
        pytest.param("fingers", 0.25, 2.3, marks=pytest.mark.long("discs and ellipses")),
    ],
)
def test_the_joint_fit_finds_places(kind, median_mm, p95_mm):
    joint, right = errors_mm(kind, ALL_TOUCH_FIT)
    without, _ = errors_mm(kind, ALL_TOUCH_FIT & ~JOINT)
    assert right >= SCENES - 1
    assert np.median(joint) <= median_mm
    assert np.percentile(joint, 95) <= p95_mm
    assert np.median(joint) <= 0.55 * np.median(without)


# Chords: x, y, radius (mm) and contrast of four or five fingers. In each, one peak of the image
# stands between two of them.
CHORDS = (
    ((3, 18, 8.7, 6.5), (-23, -2, 9.5, 3.8), (-24, 44, 7.2, 4.5),
     (60, 12, 8.4, 5.7), (-50, -25, 7.4, 3.6)),
    ((-27, -64, 7.5, 4.4), (-19, 45, 6.9, 6.3), (32, -25, 7.6, 4.2),
     (0, -46, 9.0, 5.9)),
    ((65, 5, 6.9, 7.5), (31, 41, 8.3, 6.2), (6, -33, 9.5, 4.5),
     (22, 3, 6.6, 3.3)),
    ((-30, -17, 9.4, 7.0), (-37, 53, 7.3, 5.1), (28, -14, 9.3, 4.0),
     (-33, 19, 6.6, 5.0), (7, -71, 9.4, 7.1)),
    ((55, 41, 8.4, 5.9), (-54, 21, 6.6, 4.0), (19, 26, 8.6, 4.6),
     (48, -58, 8.7, 5.5), (-17, 23, 6.5, 3.9)),
    ((36, 15, 8.7, 3.7), (-56, 51, 8.0, 6.4), (-21, 1, 7.3, 4.9),
     (12, -20, 7.2, 4.1), (-55, 13, 8.8, 5.6)),
)  # fmt: skip


# 21 of 24 are counted exactly. When a touch was sought only in crowds of five peaks and by splits
# of long touches, these were 7: one large light ellipse stood for two fingers.
def test_one_peak_between_two_fingers_of_a_chord_becomes_both():
    right = 0
    for number in range(4):
        for chord in CHORDS:
            scene = TouchScene("chord", tuple(TrueTouch(*one) for one in chord))
            right += found_in(measured(scene, number)).exact
    assert right >= 20


# Bounds of the median distance and of the radius error: its median, and the median of its size, mm.
# Measured on this seed: light touches .40, -.33 and .55, insulating ones .13, +.06 and .39. When
# every touch was expected to have a contrast of 3 to 10, radii of light touches came out 2.4 mm too
# small in the median.
@pytest.mark.parametrize(
    ("kind", "median_mm", "bias_mm", "size_mm"),
    [("light", 0.6, 0.6, 1.0), ("insulating", 0.25, 0.3, 0.6)],
)
def test_light_and_insulating_touches_have_their_radii(kind, median_mm, bias_mm, size_mm):
    solver = Reconstructor(prebuilt()[0])
    solver.set_options(sign="both")
    distances: list[float] = []
    radii: list[float] = []
    known: list[float] = []  # errors over the deviation that is reported
    for one, found, matched in found_by(solver, kind):
        distances += matched.distances_mm
        radii += [found[j].radius_mm - one.scene.touches[i].radius_mm for i, j in matched.pairs]
        known += [
            (found[j].radius_mm - one.scene.touches[i].radius_mm) / sd_mm
            for i, j in matched.pairs
            if (sd_mm := found[j].radius_sd_mm) is not None
        ]
    assert np.median(distances) <= median_mm
    assert abs(np.median(radii)) <= bias_mm
    assert np.median(np.abs(radii)) <= size_mm
    assert 0 < len(known) < len(radii)  # of others the data do not tell the radius
    assert np.sqrt(np.mean(np.square(known))) <= 2


# Five discs: x, y, radius in mm, contrast. Without a search one of them was missed.
CROWD = (
    (15.4, -80.6, 9.0, 5.0), (19.2, 18.5, 9.0, 5.0), (-43.1, 34.5, 9.0, 5.0),
    (23.9, -12.1, 9.0, 5.0), (38.4, 49.9, 9.0, 5.0),
)  # fmt: skip


def test_close_touches_of_a_crowd_are_counted():
    scene = TouchScene("crowd", tuple(TrueTouch(*numbers) for numbers in CROWD))
    matched = found_in(measured(scene, 0))
    assert matched.exact
    assert max(matched.distances_mm) < 2


# Places of weights, x and y in mm, as `eitskin study paper` puts them one after another: their
# middles are 6 mm from the rim.
AT_RIM = (
    (-68.2, -59.1), (-59.1, 68.2), (68.2, 59.1), (80.3, -40.9),
    (59.1, -68.2), (40.9, 80.3), (-80.3, 40.9), (-40.9, -80.3),
)  # fmt: skip


# Before starts were middles of the image's peaks, some were missed and others 5 to 9 mm off.
@pytest.mark.parametrize("count", [5, 6, 7, 8])
def test_weights_at_the_rim_are_counted(count):
    weights = tuple(TrueTouch(x, y, 5.0, 5.0) for x, y in AT_RIM[:count])
    matched = found_in(measured(TouchScene("weights", weights), 0))
    assert matched.exact
    assert max(matched.distances_mm) < 2.6
