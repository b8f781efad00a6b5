"""The figures of merit of GREIT: how a method shows one small target.

A. Adler et al., "GREIT: a unified approach to 2D linear EIT reconstruction of lung images",
Physiol. Meas. 30 (2009) S35-S55, doi 10.1088/0967-3334/30/6/S03, section 3. With an image x of a
target at the distance r_t from the middle, the pixels x_q of at least a quarter of its peak, and
the circle C around their centroid with their area A_q:

    amplitude response  AR = sum x, of the mean over all targets
    position error      PE = r_t - r_q, mm; positive: shown too near to the middle
    resolution          RES = sqrt(A_q / A_0), A_0 the area of the skin
    shape deformation   SD = sum of x_q outside C / sum of x_q
    ringing             RNG = sum of -x outside C where x < 0 / sum of x inside C

AR is given by its standard deviation, which is 0 for a method that shows a target alike everywhere.
Frames are simulated without noise on the finer mesh; what noise does is seen in MIoU.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.grid import Grid
from eitskin.fem.mesh import Mesh
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch, rim_distance_mm
from eitskin.scene.simulate import Measurement, Simulated, simulate
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

TARGETS = 40
TARGET_RADIUS = 0.05  # of the greatest distance from the middle to the rim, as in the article
CONTRAST = 2.0
RIM_MARGIN = 2.0  # radii of a target between its middle and the rim, at least
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True)
class Figures:
    """The figures of one method: means over targets, and the spread of the amplitude."""

    amplitude_spread: float
    position_error_mm: float
    resolution: float
    shape_deformation: float
    ringing: float


def small_targets(skin: Skin, protocol: Protocol, mesh: Mesh) -> Simulated:
    """Simulate frames of small targets, one each, spread evenly over the skin (a sunflower's
    points)."""
    middle, outline = np.array(skin.outline.centre_mm), skin.outline
    rim_mm = outline.points_at(np.linspace(0.0, outline.perimeter_mm, 400, endpoint=False))
    reach_mm = float(np.hypot(*(rim_mm - middle).T).max())
    radius_mm = TARGET_RADIUS * reach_mm
    number = np.arange(4 * TARGETS)
    away_mm = reach_mm * np.sqrt((number + 0.5) / len(number))
    turned = np.stack([np.cos(GOLDEN_ANGLE * number), np.sin(GOLDEN_ANGLE * number)], axis=1)
    places_mm = middle + away_mm[:, None] * turned
    inside = outline.contains(places_mm)
    inside[inside] = rim_distance_mm(outline, places_mm[inside]) >= RIM_MARGIN * radius_mm
    kept = places_mm[inside][:: max(1, int(inside.sum()) // TARGETS)]
    touches = [TrueTouch(float(x), float(y), radius_mm, CONTRAST) for x, y in kept]
    scenes = tuple(TouchScene(f"target-{k}", (touch,)) for k, touch in enumerate(touches))
    still = Measurement(snr_db=None, adc_bits=None, contact_spread=0.0, quiet_frames=4)
    return simulate(skin, protocol, TouchSet("targets", 0, scenes), measurement=still, mesh=mesh)


def figures(grid: Grid, images: FloatArray, targets: Simulated) -> Figures:
    """Return the figures of images (k, n) of ``targets``. An image without a positive pixel counts
    as amplitude 0 and is left out of the other figures."""
    middle = np.array(targets.skin.outline.centre_mm)
    places_mm = np.array([scene.centres_mm()[0] for scene in targets.touches.scenes])
    away_mm = np.hypot(*(places_mm - middle).T)
    amplitude = images.sum(axis=1)
    shown = [
        _of_one(grid, image, middle, float(r))
        for image, r in zip(images, away_mm, strict=True)
        if image.max() > 0
    ]
    spread = float(amplitude.std() / max(abs(float(amplitude.mean())), 1e-300))
    means = np.mean(shown, axis=0) if shown else np.full(4, np.nan)
    return Figures(spread, *map(float, means))


def _of_one(grid: Grid, image: FloatArray, middle_mm: FloatArray, r_mm: float) -> Sequence[float]:
    """Return PE in mm, RES, SD and RNG of one image (n,)."""
    centres_mm = grid.centres_mm()
    weight = np.where(image >= image.max() / 4, image, 0.0)
    centroid_mm = weight @ centres_mm / weight.sum()
    pixels = int(np.count_nonzero(weight))
    circle_mm = np.sqrt(pixels * grid.pixel_area_mm2 / np.pi)
    inside = np.hypot(*(centres_mm - centroid_mm).T) <= circle_mm
    error_mm = r_mm - float(np.hypot(*(centroid_mm - middle_mm)))
    deformation = float(weight[~inside].sum() / weight.sum())
    rings = float(-np.minimum(image[~inside], 0.0).sum() / max(image[inside].sum(), 1e-300))
    return error_mm, float(np.sqrt(pixels / grid.n_pixels)), deformation, rings
