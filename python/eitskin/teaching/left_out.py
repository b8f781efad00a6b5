"""Leave each press out: where the others place it, how certainly, and whether it fits them."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray, IntArray
from eitskin.fem.grid import Grid
from eitskin.teaching.fit import PLACE_KEPT, PLACE_ROUNDS, Learned, learn

CHI2_90 = 4.605  # the .9 quantile of chi squared with two degrees of freedom
MISFIT = 4.0  # in medians; a press with a greater misfit does not fit the others
MOST_OF_NOISE = 0.95  # greatest share of one press's residual in the noise along itself
TEMPERATURE = 2.0  # for scores as probabilities, because residuals have heavier tails than normal


@dataclass(frozen=True, eq=False)
class LeftOut:
    """n presses, each placed by the others. ``place_mm`` is (n, 2), ``error_mm`` is (n,), and
    ``score`` (n, k) is chi^2 minus its least value on the grid. ``misfit`` (n,) is the residual at
    the press's given place over the median. ``explained`` (m,) is the explained fraction of each
    row's energy."""

    place_mm: FloatArray
    error_mm: FloatArray
    score: npt.NDArray[np.float32]
    misfit: FloatArray
    explained: FloatArray


def leave_one_out(learned: Learned, grid: Grid) -> LeftOut:
    """Place each press by the others, at the minimum of |W (y - a s(q))|^2 over q and a > 0. W is
    also made from the others' residuals, except for ``score``, for which ``TEMPERATURE`` was chosen
    with the full W."""
    process, whitening = learned.process, learned.noise.whitening
    at = grid.centres_mm()
    mean = process.mean(at)
    h, v, w = process.corrections(at)
    residual = process.left_out()
    seen, white_residual = process.data @ whitening.T, residual @ whitening.T
    count = len(seen)
    misfit = np.sum(white_residual**2, axis=1)
    found = np.zeros((count, 2))
    scores = np.zeros((count, grid.n_pixels), dtype=np.float32)
    for i in range(count):
        answer = (mean - (h[:, i : i + 1] + v[i] * w) * residual[i]) @ whitening.T
        scores[i] = _scores(answer, seen[i])
        both = np.vstack([answer, seen[i]])
        both += without_own(white_residual[i], (1 - learned.noise.shrinkage) / count, both)
        found[i] = _middle(_scores(both[:-1], both[-1]), at)
    explained = 1 - np.sum(residual**2, axis=0) / np.maximum(
        np.sum(process.data**2, axis=0), 1e-300
    )
    return LeftOut(
        found, np.linalg.norm(found - process.place_mm, axis=1), scores,
        misfit / np.median(misfit), explained,
    )  # fmt: skip


def chance_share(left_out_mm: FloatArray, place_mm: FloatArray) -> float:
    """Return how far the others place each press (n, 2) from its own place, relative to the
    distance from their places: near 0 if places explain the voltages, about 1 if they do not."""
    away = np.linalg.norm(left_out_mm[:, None] - place_mm, axis=2)
    own = float(np.diag(away).mean())
    return own * (len(away) - 1) / max(float(away.mean()) * len(away) - own, 1e-300)


def without_own(residual: FloatArray, share: float, data: FloatArray) -> FloatArray:
    """Return what to add to whitened data (k, m) so that they are whitened by a covariance without
    the ``share`` that the whitened ``residual`` r (m,) of one press contributes: multiplication by
    (I - share r r')^-1/2."""
    energy = max(float(residual @ residual), 1e-300)
    factor = 1 / np.sqrt(1 - min(share * energy, MOST_OF_NOISE)) - 1
    return np.outer(data @ residual, residual * (factor / energy))


def ellipse_factor(mahalanobis2: FloatArray) -> float:
    """Return the factor for the covariance of a place with which 90 % ellipses cover 90 % of new
    presses (split conformal): it is from the ceil(.9 (n + 1))-th least of ``mahalanobis2`` (n,)."""
    count = len(mahalanobis2)
    rank = min(int(np.ceil(0.9 * (count + 1))), count)
    return float(np.sort(mahalanobis2)[rank - 1] / CHI2_90)


def _scores(answer: FloatArray, seen: FloatArray) -> FloatArray:
    """Return chi^2 (k,) minus its least value, for whitened data (m,) explained as a press at each
    of k places with whitened responses (k, m). The scale of the noise is the press's own: its
    residual at the best place."""
    energy = np.maximum(np.sum(answer**2, axis=1), 1e-300)
    score = seen @ seen - np.maximum(answer @ seen, 0) ** 2 / energy
    scale = max(float(score.min()) / max(len(seen) - 3, 1), 1.0)
    return np.asarray((score - score.min()) / scale)


def _middle(score: FloatArray, at: FloatArray) -> FloatArray:
    """Return the mean place (2,) of a press by its scores on the grid."""
    chance = np.exp(-0.5 * np.minimum(score, 1400))
    return np.asarray(chance @ at / chance.sum())


def stranger_note(strangers: IntArray) -> str:
    """Return a note about presses that do not fit the others."""
    return (
        "presses that do not fit the others (two fingers at once, a slip, a wrong place); leave"
        " them out or record them again: " + ", ".join(map(str, strangers[:12]))
    )


def refined_places(
    learned: Learned,
    grid: Grid,
    given_mm: FloatArray,
    sd_mm: float,
    difference: FloatArray,
    depth: FloatArray | None,
    width_mm: float,
) -> Learned:
    """Move places that were given by hand, with an error of ``sd_mm`` per axis, towards where the
    other presses put them, and learn the responses again."""
    at = grid.centres_mm()
    prior = -0.5 * np.sum((at[None] - given_mm[:, None]) ** 2, axis=2) / sd_mm**2
    for round_ in range(PLACE_ROUNDS):
        log_chance = prior - 0.5 * leave_one_out(learned, grid).score / TEMPERATURE
        chance = np.exp(log_chance - log_chance.max(axis=1, keepdims=True))
        chance /= chance.sum(axis=1, keepdims=True)
        place = PLACE_KEPT * learned.process.place_mm + (1 - PLACE_KEPT) * chance @ at
        learned = learn(
            learned.kernel, place, difference, depth, width_mm,
            choose=round_ == PLACE_ROUNDS - 1, angles=1, amplitude=learned.process.amplitude,
        )  # fmt: skip
    return learned
