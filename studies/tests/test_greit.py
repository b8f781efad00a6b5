"""The GREIT-like matrix: its training, the cost that it minimises, and a small target, which it
shows at its place."""

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.grid import Grid, grid_for
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare import baselines
from eitskin_studies.compare.greit import DISC_RADIUS, train_greit

GRID = grid_for(paper_skin().outline, 16)
HALF_MM = GRID.nx * GRID.pixel_mm / 2


def smooth(grid: Grid, rows: int) -> np.ndarray:
    """A Jacobian whose rows are smooth over the skin, as a real one's."""
    generator = np.random.default_rng(5)
    waves, phases = generator.normal(size=(rows, 2)) * 4 / HALF_MM, generator.uniform(0, 6, rows)
    return np.asarray(np.cos(waves @ grid.centres_mm().T + phases[:, None]))


J = smooth(GRID, 60)


def test_a_small_target_is_shown_as_a_disc_at_its_place():
    method = train_greit(J, GRID).method(1e-6)
    for pixel in (40, 101, 150):
        image = method.reconstruct(J[:, pixel])[0]
        place = GRID.centres_mm()[pixel]
        away = np.hypot(*(GRID.centres_mm() - place).T)
        weight = np.where(image > 0.5 * image.max(), image, 0)
        assert np.hypot(*(weight @ GRID.centres_mm() / weight.sum() - place)) < GRID.pixel_mm
        assert image[away > 2.5 * DISC_RADIUS * HALF_MM].max() < 0.35 * image.max()


def test_it_is_the_closed_form_and_noise_smooths():
    training = train_greit(J, GRID, targets=300)
    noise = 1e-3 * np.linalg.eigvalsh(training.spread).max() * np.eye(60)
    found = training.method(1e-3).matrix @ (training.spread + noise)
    assert found == pytest.approx(training.shown, rel=1e-6, abs=1e-9)
    sizes = [np.linalg.norm(training.method(w).matrix) for w in (1e-6, 1e-4, 1e-2, 1.0)]
    assert sizes == sorted(sizes, reverse=True)


def test_units_and_seeds():
    one, again, other = (
        train_greit(J, GRID, targets=200, seed=seed).method(1e-4).matrix for seed in (3, 3, 4)
    )
    assert (one == again).all() and not np.allclose(one, other)
    scaled = train_greit(1e-6 * J, GRID, targets=200, seed=3).method(1e-4).matrix
    assert 1e-6 * scaled == pytest.approx(one, rel=1e-7)


def test_what_it_refuses():
    with pytest.raises(UsageError, match="a Jacobian of 3 pixels"):
        train_greit(J[:, :3], GRID)
    with pytest.raises(UsageError, match="at least 1 target"):
        train_greit(J, GRID, targets=0)
    with pytest.raises(UsageError, match="noise weight 0 must be above 0"):
        train_greit(J, GRID, targets=9).method(0)


class Counting(np.ndarray):
    """A matrix that counts the multiply-accumulates of the products that it takes part in."""

    macs = 0

    def __matmul__(self, other: np.ndarray) -> np.ndarray:
        Counting.macs += self.shape[0] * np.asarray(other).size
        return np.asarray(self) @ np.asarray(other)

    def __rmatmul__(self, other: np.ndarray) -> np.ndarray:
        Counting.macs += np.asarray(other).size * self.shape[1]
        return np.asarray(other) @ np.asarray(self)


@pytest.mark.parametrize(
    "make",
    [
        lambda j: baselines.LinearMethod("one", j.T),
        lambda j: baselines.ConjugateGradient(j, 7),
        lambda j: baselines.PlainFista(j, 11, 0.1, True),
        lambda j: baselines.PlainFista(j, 5, 0.1),
    ],
)
def test_macs_are_those_of_the_products(make):
    method = make(J.view(Counting))
    Counting.macs = 0
    frames = np.random.default_rng(1).normal(size=(3, 60))
    method.reconstruct(frames)
    assert Counting.macs == 3 * method.macs
