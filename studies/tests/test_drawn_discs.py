"""How much the MIoU of another method's images rises if its touches are drawn as discs, without
eitskin's fit.

The table is in docs/reference/metrics.md, "Discs at the touches of other methods".
"""

import numpy as np

import eitskin
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import random_touches
from eitskin.scoring import metrics
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.image_touches import touches_in_image
from eitskin_studies.compare import baselines
from eitskin_studies.compare.families import setup_for
from eitskin_studies.compare.run import truth_masks
from eitskin_studies.harness.thresholds import miou_curves

SCENES, SNR_DB = 20, 60.0
STRENGTH, CENTROID_THRESHOLD, RADIUS_MM, OUR_RADIUS_MM = 1e-5, 0.4, 10.0, 9.0  # of the page


def test_discs_help_other_methods_and_places_help_more():
    random, skin, protocol = np.random.default_rng(1), paper_skin(), adjacent(16)
    contacts = skin.electrodes.contact_impedance_ohm_m2 * random.uniform(0.8, 1.2, 16)
    exact = RoundSkin(skin, protocol, contacts)
    untouched_v = exact.voltages(())
    noise_v = 10 ** (-SNR_DB / 20) * float(np.sqrt(np.mean(untouched_v**2)))
    tare_v = untouched_v + noise_v * random.standard_normal((64, 208))
    drawn = random_touches(skin.outline, 1, SCENES, "test")
    frames_v = np.array([exact.voltages(scene.touches) for scene in drawn.scenes])
    frames_v += noise_v * random.standard_normal(frames_v.shape)

    setup = setup_for(skin, protocol, elements=3000)
    scorer = metrics.judge_for(skin.outline, setup.grid)
    truths = truth_masks(drawn, scorer.raster.points_mm)
    images = baselines.gauss_newton(setup.jacobian, STRENGTH).reconstruct(
        frames_v - tare_v.mean(axis=0)
    )
    index, centres_mm = setup.grid.index, setup.grid.centres_mm()
    theirs = [touches_in_image(image, index, centres_mm, CENTROID_THRESHOLD) for image in images]
    reconstructor = eitskin.Reconstructor(eitskin.load_model())
    reconstructor.tare(tare_v)
    ours = []
    for frame_v in frames_v:
        reconstructor.forget()
        touches = reconstructor.reconstruct(frame_v).touches
        ours.append(np.array([(one.x_mm, one.y_mm) for one in touches]))

    def of_discs(places_mm: list[np.ndarray], radius_mm: float) -> float:
        points_mm = scorer.raster.points_mm
        masks = [metrics.disc_mask(points_mm, found, radius_mm) for found in places_mm]
        return float(np.mean([metrics.miou(*pair) for pair in zip(masks, truths, strict=True)]))

    image = float(miou_curves(scorer, images, truths).mean(axis=0).max())
    assert 0.65 < image < of_discs(theirs, RADIUS_MM) - 0.02
    assert of_discs(theirs, RADIUS_MM) < of_discs(ours, OUR_RADIUS_MM) - 0.02 < 0.9
