"""Touches whose size the joint fit does not expect: places stay right, radii of small ones do not.

The table is in docs/design/joint-fit.md, "Outside the expected sizes".
"""

import numpy as np
import pytest

import eitskin
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TouchRules, random_touches
from eitskin.scoring.matching import match
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor

SCENES, SNR_DB = 20, 60.0


@pytest.fixture(scope="module")
def session() -> tuple[RoundSkin, Reconstructor, float, np.random.Generator]:
    """A round skin with spread contacts, and its tare."""
    random, skin = np.random.default_rng(1), paper_skin()
    contacts = skin.electrodes.contact_impedance_ohm_m2 * random.uniform(0.8, 1.2, 16)
    exact = RoundSkin(skin, adjacent(16), contacts)
    untouched_v = exact.voltages(())
    noise_v = 10 ** (-SNR_DB / 20) * float(np.sqrt(np.mean(untouched_v**2)))
    reconstructor = Reconstructor(eitskin.load_model())
    reconstructor.tare(untouched_v + noise_v * random.standard_normal((64, 208)))
    return exact, reconstructor, noise_v, random


@pytest.mark.parametrize(
    ("radius_mm", "least_off_mm", "most_off_mm", "most_place_off_mm"),
    [((12.0, 20.0), -0.3, 0.3, 0.2), ((3.0, 4.5), 1.5, 4.0, 1.0)],
    ids=["large", "small"],
)
def test_places_hold_and_radii_follow_the_prior(
    radius_mm, least_off_mm, most_off_mm, most_place_off_mm, session
):
    exact, reconstructor, noise_v, random = session
    drawn = random_touches(paper_skin().outline, 1, SCENES, "test", TouchRules(radius_mm=radius_mm))
    place_off_mm, radius_off_mm, right = [], [], 0
    for scene in drawn.scenes:
        frame_v = exact.voltages(scene.touches) + noise_v * random.standard_normal(208)
        reconstructor.forget()
        found = reconstructor.reconstruct(frame_v).touches
        matching = match(scene.centres_mm(), np.array([(t.x_mm, t.y_mm) for t in found]))
        right += matching.exact
        place_off_mm += list(matching.distances_mm)
        radius_off_mm += [
            found[k].radius_mm - scene.touches[i].radius_mm for i, k in matching.pairs
        ]
    assert right >= SCENES - 2
    assert float(np.median(place_off_mm)) < most_place_off_mm
    assert least_off_mm < float(np.median(radius_off_mm)) < most_off_mm
