"""Learn how a skin responds to a press anywhere: geometry and hyperparameters by marginal
likelihood, amplitudes and noise from presses left out."""

from dataclasses import dataclass, replace
from math import exp, log
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import FrameError, missing_extra
from eitskin.progress import Progress, silent
from eitskin.teaching.kernel import Kernel, Placement
from eitskin.teaching.process import Process, condition

START_ANGLES = 32
MAX_FOR_LIKELIHOOD = 150
KNOWN_ROUNDS, UNKNOWN_ROUNDS = 3, 8
NEAR = 0.18  # relative to the skin's width: first amplitudes compare presses within this distance
SCALE_SD = 0.05  # standard deviation of the log scale: descriptions give about the right size
LOG_BOUND = 12.0
LEAST_SHRINKAGE = 0.5  # the formula shrinks too little, because residuals are not normal
# A row's variance is less certain than from independent residuals, by this factor: they are
# dependent.
UNKNOWN = 1.5
DRIFT = 0.3  # weight of the drift's covariance, which rests on few presses with long tails
PLACE_ROUNDS, PLACE_KEPT = 5, 0.3


@dataclass(frozen=True, eq=False)
class Noise:
    """The covariance of the noise of rows over their units: ``whitening`` W (m, m) with W C W' = I,
    ``covariance`` C, and the ``shrinkage`` of the correlations (1: they are all ignored)."""

    whitening: FloatArray
    covariance: FloatArray
    shrinkage: float


def differences(difference: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each row over its rms, (n, m), and the rms (m,). Rows without signal get the greatest
    rms, which keeps them at zero.

    Raises:
        FrameError: no row has a signal.
    """
    rms = np.sqrt(np.mean(difference**2, axis=0))
    if not rms.max() > 0:
        raise FrameError(
            "presses: no row differs between untouched and pressed; record both frames of a press"
        )
    unit = np.where(rms > 1e-9 * rms.max(), rms, rms.max())
    return difference / unit, unit


def chosen_kernel(
    kernel: Kernel,
    place_mm: FloatArray,
    amplitude: FloatArray,
    data: FloatArray,
    *,
    angles: int = START_ANGLES,
    progress: Progress = silent,
) -> tuple[Kernel, float]:
    """Return ``kernel`` with the placement, own-row term and noise of the greatest likelihood, and
    the logarithm of that likelihood."""
    try:
        from scipy.optimize import minimize
    except ImportError:
        raise missing_extra("model", "scipy") from None
    count = min(len(place_mm), MAX_FOR_LIKELIHOOD)
    few = np.linspace(0, len(place_mm) - 1, count).astype(int)
    place, size, rows = place_mm[few], amplitude[few], data[few]
    stationary = kernel.sensitivity is None

    def at(numbers: FloatArray) -> Kernel:
        turn, log_scale, log_noise, log_own = np.clip(numbers, -1e3, 1e3).tolist()
        bounded = [min(max(one, -LOG_BOUND), LOG_BOUND) for one in (log_scale, log_noise, log_own)]
        return replace(
            kernel,
            placement=replace(kernel.placement, turn_deg=turn, scale=exp(bounded[0])),
            noise=exp(bounded[1]),
            own=0.0 if stationary else exp(bounded[2]),
        )

    def cost(numbers: FloatArray) -> float:
        spread = 1.0 if stationary else SCALE_SD
        try:
            found = condition(at(numbers), place, size, rows).log_likelihood
        except np.linalg.LinAlgError:
            return 1e30
        return -found + 0.5 * (float(numbers[1]) / spread) ** 2

    begin = [log(kernel.placement.scale), log(kernel.noise), log(max(kernel.own, 1e-3))]
    if stationary or angles == 1:
        starts = [np.array([kernel.placement.turn_deg, *begin])]
    else:
        starts = [np.array([360 * k / angles, *begin]) for k in range(angles)]
    costs = [cost(one) for one in progress(starts)]
    best = None
    for k in np.argsort(costs)[:4]:
        start = starts[k]
        simplex = start + np.vstack([np.zeros(4), np.diag([6.0, 0.04, 0.7, 0.7])])
        found = minimize(
            cost, start, method="Nelder-Mead",
            options={"initial_simplex": simplex, "xatol": 0.02, "fatol": 0.05, "maxfev": 250},
        )  # fmt: skip
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    return at(best.x), -float(best.fun)


def first_amplitudes(
    place_mm: FloatArray, data: FloatArray, given: FloatArray | None, near_mm: float
) -> FloatArray:
    """Return the amplitudes (n,) from which a fit starts, with mean 1: in proportion to ``given``
    depths or forces, otherwise |y| over its mean nearby."""
    size = np.linalg.norm(data, axis=1)
    away = np.linalg.norm(place_mm[:, None] - place_mm[None], axis=-1)
    near = (away < near_mm) * 1.0
    amplitude = size / np.maximum(near @ size / near.sum(axis=1), 1e-300)
    if given is not None:
        known = np.isfinite(given) & (given > 0)
        if known.any():
            amplitude = np.where(known, given / np.mean(given[known]), amplitude)
    return np.asarray(np.clip(amplitude, 0.05, 20) / np.mean(np.clip(amplitude, 0.05, 20)))


def noise_of(residual: FloatArray, unit: FloatArray) -> Noise:
    """Return the covariance of residuals (n, m) of rows over their ``unit`` (m,). Correlations are
    shrunk as in Schaefer and Strimmer (Stat. Appl. Genet. Mol. Biol. 4, 2005, article 32)."""
    count, rows = residual.shape
    squares = residual**2
    x = residual / np.sqrt(np.maximum(squares.mean(axis=0), 1e-300))
    correlation = x.T @ x / count
    second = (x**2).T @ (x**2) / count
    off = ~np.eye(rows, dtype=bool)
    uncertain = (second - correlation**2)[off].sum() / max(count - 1, 1)
    shrinkage = float(
        np.clip(uncertain / max((correlation[off] ** 2).sum(), 1e-300), LEAST_SHRINKAGE, 1)
    )
    correlation = np.where(off, (1 - shrinkage) * correlation, 1.0)
    sd = np.sqrt(_variances(squares, unit))
    covariance = sd[:, None] * correlation * sd
    return Noise(whitening_of(covariance), covariance, shrinkage)


def _variances(squares: FloatArray, unit: FloatArray) -> FloatArray:
    """Return the variance (m,) of each row from squared residuals (n, m). Its logarithm is shrunk
    towards that of rows with the same ``unit``, as far as n residuals leave it uncertain; weak rows
    have more noise relative to their unit."""
    variance, count = squares.mean(axis=0), len(squares)
    median = float(np.median(variance[variance > 0])) if (variance > 0).any() else 1.0
    known = variance > 1e-6 * median
    if count < 2 or not known.any():
        return np.full(len(variance), median)
    y, x = np.log(variance[known]), np.log(unit)
    mean, x = float(y.mean()), x - float(x[known].mean())
    slope = float(x[known] @ y) / max(float(x[known] @ x[known]), 1e-300)
    expected = mean + slope * x
    unknown = np.mean(squares[:, known].var(axis=0, ddof=1) / variance[known] ** 2) / count
    spread = np.mean((y - expected[known]) ** 2)
    towards = min(1.0, UNKNOWN * float(unknown / max(spread, 1e-300)))
    expected[known] += (1 - towards) * (y - expected[known])
    return np.asarray(np.exp(expected))


def whitening_of(covariance: FloatArray) -> FloatArray:
    """Return W (m, m) with W C W' = I for the covariance C."""
    sd = np.sqrt(np.diag(covariance))
    lower = np.linalg.cholesky(covariance / sd / sd[:, None])
    return np.asarray(np.linalg.inv(lower) / sd)


def suiting_amplitudes(answer: FloatArray, data: FloatArray, whitening: FloatArray) -> FloatArray:
    """Return the amplitude (n,) at which each of ``answer`` (n, m) fits ``data`` (n, m) best."""
    expected, seen = answer @ whitening.T, data @ whitening.T
    energy = np.maximum((expected**2).sum(axis=1), 1e-300)
    return np.asarray(np.clip((seen * expected).sum(axis=1) / energy, 0.05, 20))


def left_out_amplitudes(process: Process, noise: Noise, given: FloatArray | None) -> FloatArray:
    """Return the amplitude of each press as predicted by the others. Presses with the same given
    depth get their median; depths that hardly repeat get a power law."""
    answer = (process.data - process.left_out()) / process.amplitude[:, None]
    amplitude = suiting_amplitudes(answer, process.data, noise.whitening)
    return amplitude if given is None else by_given(amplitude, given)


def refitted_amplitudes(process: Process, noise: Noise, given: FloatArray | None) -> FloatArray:
    """Return ``left_out_amplitudes`` scaled to mean 1."""
    amplitude = left_out_amplitudes(process, noise, given)
    return np.asarray(amplitude / amplitude.mean())


def by_given(amplitude: FloatArray, given: FloatArray) -> FloatArray:
    """Return amplitudes (n,) that follow only from the given depth or force, where that is
    known."""
    known = np.isfinite(given) & (given > 0)
    levels, which, counts = np.unique(given[known], return_inverse=True, return_counts=True)
    if not len(levels):
        return amplitude
    out, logs = amplitude.copy(), np.log(amplitude[known])
    if counts.mean() >= 3:
        out[known] = np.exp([np.median(logs[which == k]) for k in range(len(levels))])[which]
    elif len(levels) >= 3:
        x = np.log(given[known])
        slope = float(np.clip(np.polyfit(x, logs, 1)[0], 0, 3))
        out[known] = np.exp(slope * (x - x.mean()) + np.median(logs - slope * (x - x.mean())))
    return out


@dataclass(frozen=True, eq=False)
class Learned:
    """The result of learning from presses: ``process`` and ``noise`` for rows over ``unit`` (m,) in
    V, and the likelihood. The process holds the kernel, and the places as refined."""

    process: Process
    noise: Noise
    unit: FloatArray
    log_likelihood: float

    @property
    def kernel(self) -> Kernel:
        return self.process.kernel

    def whitened(self, difference: FloatArray) -> FloatArray:
        """Return differences (n, m) in V in the metric of the noise."""
        return np.asarray((difference / self.unit) @ self.noise.whitening.T)


def with_drift(learned: Learned, untouched: FloatArray, age: int) -> Learned:
    """Return ``learned`` with noise that includes the drift between ``untouched`` frames (n, m) in
    V, in order of time, that are ``age`` presses apart; 0 adds none."""
    if age == 0:
        return learned
    drift = (untouched[age:] - untouched[:-age]) / learned.unit
    covariance = learned.noise.covariance + DRIFT * drift.T @ drift / len(drift)
    return replace(learned, noise=replace(
        learned.noise, whitening=whitening_of(covariance), covariance=covariance
    ))  # fmt: skip


def learn(
    kernel: Kernel,
    place_mm: FloatArray,
    difference: FloatArray,
    given: FloatArray | None,
    width_mm: float,
    *,
    choose: bool = True,
    angles: int = START_ANGLES,
    amplitude: FloatArray | None = None,
    progress: Progress = silent,
) -> Learned:
    """Learn from presses; with ``choose`` False the numbers of the kernel stay, as for held-out
    presses."""
    data, unit = differences(difference)
    if amplitude is None:
        amplitude = first_amplitudes(place_mm, data, given, NEAR * width_mm)
    likelihood = 0.0
    if choose:
        kernel, likelihood = chosen_kernel(
            kernel, place_mm, amplitude, data, angles=angles, progress=progress
        )
    process = condition(kernel, place_mm, amplitude, data)
    noise = noise_of(process.left_out(), unit)
    for _ in range(KNOWN_ROUNDS if given is not None else UNKNOWN_ROUNDS):
        amplitude = refitted_amplitudes(process, noise, given)
        process = condition(kernel, place_mm, amplitude, data)
        noise = noise_of(process.left_out(), unit)
    if choose:
        kernel, likelihood = chosen_kernel(kernel, place_mm, amplitude, data, angles=1)
        process = condition(kernel, place_mm, amplitude, data)
        noise = noise_of(process.left_out(), unit)
    return Learned(process, noise, unit, likelihood)


def default_kernel(
    skin_kernel: tuple[Any, tuple[float, float]] | None, place_mm: FloatArray
) -> Kernel:
    """Return the kernel before the likelihood is maximised: from a skin's sensitivity and centre,
    or stationary."""
    if skin_kernel is not None:
        return Kernel(skin_kernel[0], skin_kernel[1])
    middle = place_mm.mean(axis=0)
    reach = float(np.linalg.norm(place_mm - middle, axis=1).max())
    return Kernel(None, (float(middle[0]), float(middle[1])), 0.5 * reach, Placement(), own=0.0)
