"""A GREIT-like reconstruction: one matrix, trained to show small targets as blurred discs of one
size everywhere.

After A. Adler et al., "GREIT: a unified approach to 2D linear EIT reconstruction of lung images",
Physiol. Meas. 30 (2009) S35-S55, doi 10.1088/0967-3334/30/6/S03: with the frames Y (m, K) of K
training targets, the images D (n, K) that they should give, and white noise,

    R = D Y' (Y Y' + noise)^-1,    noise = w s^2 I,  s^2 the largest eigenvalue of Y Y'

which has the least expected |D - R (Y + noise)|. GREIT-like, not GREIT: frames come from the linear
Jacobian of the sheet instead of a solved model, the noise is white, and w is chosen on scenes
instead of for a noise figure.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.fem.grid import Grid
from eitskin_studies.compare.baselines import LinearMethod

TARGETS = 4000
TARGET_RADIUS = 0.05  # of half the grid's longer side: a fifth of a touch's area or less
# 0.05 to 0.3 were tried on training scenes of one to three touches, each at its best weight and
# threshold
DISC_RADIUS = 0.2
EDGE = 0.02  # width of the disc's edge, a logistic step
POINTS = 24  # of a target, spread evenly over its disc


@dataclass(frozen=True, eq=False)
class GreitTraining:
    """The properties of the targets that training needs, whatever the noise.

    Attributes:
        shown: D Y', (n, m).
        spread: Y Y', (m, m).
        largest: the largest eigenvalue of Y Y'.
    """

    shown: FloatArray
    spread: FloatArray
    largest: float

    def method(self, weight: float) -> LinearMethod:
        """The reconstruction for a noise of ``weight``: large is smooth, small is sharp and
        amplifies noise.

        Raises:
            UsageError: the weight is not above 0.
        """
        if not weight > 0:
            raise UsageError(f"GREIT-like: noise weight {weight!r} must be above 0")
        noisy = self.spread + weight * self.largest * np.eye(len(self.spread))
        return LinearMethod("GREIT-like", np.asarray(np.linalg.solve(noisy, self.shown.T).T))


def train_greit(
    jacobian: FloatArray,
    grid: Grid,
    *,
    targets: int = TARGETS,
    disc_radius: float = DISC_RADIUS,
    seed: int = 0,
) -> GreitTraining:
    """Train on ``targets`` random places, uniform over the kept pixels; the same ``seed`` gives the
    same matrix.

    Args:
        jacobian: J (m, n), V per (S/m), on ``grid``.
        grid: its pixels.
        disc_radius: of the desired discs, of half the grid's longer side.

    Raises:
        UsageError: no targets, or the Jacobian is of another grid.
    """
    if targets < 1 or not disc_radius > 0:
        raise UsageError(
            "GREIT-like: training needs at least 1 target and a disc with a radius above 0"
        )
    if jacobian.shape[1] != grid.n_pixels:
        raise UsageError(
            f"GREIT-like: a Jacobian of {jacobian.shape[1]} pixels on a grid of {grid.n_pixels};"
            " give its own grid"
        )
    half_mm = max(grid.nx, grid.ny) * grid.pixel_mm / 2
    generator = np.random.default_rng(seed)
    pixel = generator.integers(0, grid.n_pixels, targets)
    places_mm = (
        grid.centres_mm()[pixel] + generator.uniform(-0.5, 0.5, (targets, 2)) * grid.pixel_mm
    )
    cover = _cover(grid, places_mm, TARGET_RADIUS * half_mm)
    # as much change in the disc as in the target; one height everywhere, so that one touch looks
    # alike everywhere
    height = (TARGET_RADIUS / disc_radius) ** 2
    away_mm = np.sqrt(((grid.centres_mm()[:, None] - places_mm[None]) ** 2).sum(axis=2))
    desired = height / (1 + np.exp((away_mm - disc_radius * half_mm) / (EDGE * half_mm)))
    frames = jacobian @ cover
    spread = frames @ frames.T
    return GreitTraining(
        np.asarray(desired @ frames.T), spread, float(np.linalg.eigvalsh(spread)[-1])
    )


def _cover(grid: Grid, places_mm: FloatArray, radius_mm: float) -> FloatArray:
    """The part of each pixel that each target covers, (n, K); what lies outside the kept pixels is
    left out."""
    turn = (
        np.pi * (3 - np.sqrt(5)) * np.arange(POINTS)
    )  # a sunflower's points lie evenly over a disc
    reach = radius_mm * np.sqrt((np.arange(POINTS) + 0.5) / POINTS)
    points = places_mm[:, None] + (reach * np.array([np.cos(turn), np.sin(turn)])).T[None]
    pixel = grid.locate(points)
    target = np.repeat(np.arange(len(places_mm)), POINTS)
    cover = np.zeros((grid.n_pixels, len(places_mm)))
    np.add.at(
        cover,
        (pixel[pixel >= 0], target[pixel >= 0]),
        np.pi * radius_mm**2 / POINTS / grid.pixel_area_mm2,
    )
    return cover
