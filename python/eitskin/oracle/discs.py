"""Touches as discs: their answers, their interaction, the cost of a fit, and the best fit from
several starts. docs/design/oracle.md, "Touches", has the formulas."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eitskin.arrays import ComplexArray, FloatArray
from eitskin.core.constants_table import RADIUS_DEVIATION
from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin.model.model import Model
from eitskin.oracle.lasso import pull

DERIVATIVE_STEP = 1e-4  # pixels, and of the change
STARTING_SIZES = (1.0, 0.6, 1.6)  # of the seed's radius
ITERATIONS = 60
MORE_THAN_NOISE = 4.0  # directions of noise that a disc must explain: it has as many numbers
NEAREST_MM2 = 1e-6  # discs nearer than the root of this do not change each other's field
SETTLED = 1e-5  # a step that gains less of the cost ends a fit


@dataclass(frozen=True)
class Disc:
    """A disc of uniform conductivity ``change``, S/m."""

    x_mm: float
    y_mm: float
    radius_mm: float
    change: float

    @property
    def numbers(self) -> tuple[float, float, float, float]:
        """x, y, radius, change."""
        return self.x_mm, self.y_mm, self.radius_mm, self.change


def cover(grid: Grid, x_mm: float, y_mm: float, radius_mm: float) -> FloatArray:
    """Return the fraction of each pixel (n,) that the disc covers: 1/2 + (radius - distance) /
    pixel, limited to 0 to 1."""
    distance = np.linalg.norm(grid.centres_mm() - (x_mm, y_mm), axis=1)
    return np.asarray(np.clip(0.5 + (radius_mm - distance) / grid.pixel_mm, 0.0, 1.0))


def drawn(model: Model, touches: Sequence[Touch]) -> FloatArray:
    """The image of touches that were found, (n,) S/m: what of each pixel they cover, at most all of
    it, times one height: the expected change, without one the touches' mean. An ellipse's edge is
    (1 - rho) / |gradient of rho| away, where rho is 1 on it."""
    grid, expected = model.grid, model.defaults.touch_change_s_per_m
    covers = np.zeros(grid.n_pixels)
    for t in touches:
        offset = grid.centres_mm() - (t.x_mm, t.y_mm)
        axis = np.array([t.long_x_mm or 0.0, t.long_y_mm or 0.0])
        a = float(np.linalg.norm(axis)) or t.radius_mm
        b, along = t.radius_mm**2 / a, axis / a if axis.any() else np.array([1.0, 0.0])
        u = offset @ along, offset @ (-along[1], along[0])
        rho = np.hypot(u[0] / a, u[1] / b)
        slope = np.hypot(u[0] / a**2, u[1] / b**2) / np.maximum(rho, 1e-9)
        inside = np.where(rho > 1e-6, (1 - rho) / np.maximum(slope, 1e-9), min(a, b))
        cover = np.clip(0.5 + inside / grid.pixel_mm, 0.0, 1.0)
        covers = np.clip(covers + np.sign(t.strength_s_per_m_mm2) * cover, -1.0, 1.0)
    if expected > 0:
        return covers * expected
    strength = sum(abs(t.strength_s_per_m_mm2) for t in touches)
    return covers * (strength / (np.pi * sum(t.radius_mm**2 for t in touches)))


def area_mm2(model: Model, disc: Disc) -> float:
    """Return the area that the disc covers on the pixels that count, in mm^2."""
    counted = cover(model.grid, disc.x_mm, disc.y_mm, disc.radius_mm)[model.column_weight != 0]
    return float(counted.sum()) * model.grid.pixel_area_mm2


@dataclass(frozen=True, eq=False)
class DiscFit:
    """Data y (r,), which discs are to explain by S (r, n), both projected; ``noise``: what of
    |y|^2 noise gives, over r."""

    model: Model
    s: FloatArray
    y: FloatArray
    noise: float
    options: Options

    @cached_property
    def per_change(self) -> FloatArray:
        """The change of y for a change of 1 S/m in each pixel (r, n); 0 if it does not count."""
        weight = self.model.column_weight.astype(float)
        return np.asarray(self.s / np.where(weight != 0, weight, np.inf))

    def answer(self, disc: Disc) -> FloatArray:
        """Return the change of y (r,) that the disc causes."""
        covers = cover(self.model.grid, disc.x_mm, disc.y_mm, disc.radius_mm)
        return np.asarray(self.per_change @ covers) * disc.change

    def residual(self, discs: Sequence[Disc]) -> FloatArray:
        """Return y minus the answers of the discs (r,)."""
        return self.y - sum((self.answer(disc) for disc in discs), np.zeros(len(self.y)))

    def prior(self, disc: Disc, answer: FloatArray) -> float:
        """Return the root of the cost of a disc's radius: its distance in deviations from the
        radius that its strength suggests, weighted by the disc's energy, or by that of noise if it
        is greater."""
        o = self.options
        expected = o.touch_seed_radius_mm
        if o.touch_change_s_per_m > 0:
            wanted = disc.radius_mm * np.sqrt(abs(disc.change) / o.touch_change_s_per_m)
            expected = float(np.clip(wanted, o.touch_min_radius_mm, o.touch_max_radius_mm))
        weight = max(o.touch_radius_weight * float(answer @ answer), self.noise)
        off = (disc.radius_mm - expected) / (RADIUS_DEVIATION * expected)
        return float(np.sqrt(weight)) * off

    def parts(self, disc: Disc) -> FloatArray:
        """Return the change of y by the disc, then its prior with a minus sign (r + 1,): the part
        of the cost that depends on the disc."""
        answer = self.answer(disc)
        return np.append(answer, -self.prior(disc, answer))

    def cost(self, discs: Sequence[Disc]) -> float:
        """Return |y - answers of the discs|^2 plus the costs of their radii."""
        parts = np.array([self.parts(disc) for disc in discs]).reshape(-1, len(self.y) + 1)
        left, priors = self.y - parts[:, :-1].sum(axis=0), parts[:, -1]
        return float(left @ left + priors @ priors)

    def within(self, disc: Disc, polarity: float) -> Disc:
        """The nearest allowed disc: radius and sign as the options have them, its centre on a kept
        pixel or next to one."""
        o, grid = self.options, self.model.grid
        low = np.asarray(grid.origin_mm) + grid.pixel_mm * (grid.index - 1.0)
        near = np.clip((disc.x_mm, disc.y_mm), low, low + 3 * grid.pixel_mm)
        x, y = near[np.argmin(np.hypot(*(near - (disc.x_mm, disc.y_mm)).T))]
        radius = float(np.clip(disc.radius_mm, o.touch_min_radius_mm, o.touch_max_radius_mm))
        return Disc(float(x), float(y), radius, polarity * max(0.0, polarity * disc.change))

    def improved(self, discs: Sequence[Disc]) -> list[Disc]:
        """A local minimum of the cost from ``discs`` on, all of them at once, by the method of
        Levenberg and Marquardt with numeric derivatives."""
        now, polarity = list(discs), [1.0 if disc.change >= 0 else -1.0 for disc in discs]
        damping, cost = 1e-3, self.cost(discs)
        for _ in range(ITERATIONS if discs else 0):
            before, (h, g) = cost, self._normal(now)
            size = np.sqrt(np.maximum(np.diag(h), 1e-300))
            scaled = h / np.outer(size, size)
            while damping < 1e8:
                step = np.linalg.solve(scaled + damping * np.eye(len(g)), g / size) / size
                trial = [
                    self.within(Disc(*np.add(disc.numbers, by)), sign)
                    for disc, by, sign in zip(now, step.reshape(-1, 4), polarity, strict=True)
                ]
                if (reached := self.cost(trial)) < cost:
                    now, cost, damping = trial, reached, damping / 5
                    break
                damping *= 4
            if before - cost <= SETTLED * cost:
                break
        return now

    def _normal(self, discs: list[Disc]) -> tuple[FloatArray, FloatArray]:
        """J'J and -J'f of the residuals f, the priors among them."""
        pixel, rank, count = self.model.grid.pixel_mm, len(self.y), len(discs)
        f, j = np.zeros(rank + count), np.zeros((rank + count, 4 * count))
        f[:rank] = self.y
        for k, disc in enumerate(discs):
            here = self.parts(disc)
            f[:rank] -= here[:-1]
            f[rank + k] = -here[-1]
            for at, scale in enumerate((pixel, pixel, pixel, max(abs(disc.change), 1e-9))):
                moved = np.array(disc.numbers)
                moved[at] += DERIVATIVE_STEP * scale
                slope = (self.parts(Disc(*moved.tolist())) - here) / (DERIVATIVE_STEP * scale)
                j[:rank, 4 * k + at], j[rank + k, 4 * k + at] = -slope[:-1], -slope[-1]
        return j.T @ j, -(j.T @ f)

    def best(self, discs: Sequence[Disc]) -> list[Disc]:
        """The best of the minima from several starting radii."""
        starts = [[replace(d, radius_mm=d.radius_mm * f) for d in discs] for f in STARTING_SIZES]
        found = [self.improved(self.with_strengths(start)) for start in starts]
        return min(found, key=self.cost)

    def with_strengths(self, discs: Sequence[Disc]) -> list[Disc]:
        """Changes by least squares, of each disc's own sign."""
        if not discs:
            return []
        signs = [1.0 if disc.change >= 0 else -1.0 for disc in discs]
        unit = [replace(disc, change=1.0) for disc in discs]
        answers = np.array([self.answer(disc) for disc in unit]).T
        changes, *_ = np.linalg.lstsq(answers, self.y, rcond=1e-6)
        least = 1e-3 * float(np.abs(changes).max())
        return [
            replace(disc, change=sign * max(least, sign * float(change)))
            for disc, sign, change in zip(discs, signs, changes, strict=True)
        ]

    def explained(self, discs: Sequence[Disc], whole: float) -> FloatArray:
        """Return by how much |residual|^2 would grow without each disc, as a fraction of ``whole``.
        One disc is left out at a time, and the strengths of the others are fitted again."""
        answers = np.array([self.answer(disc) for disc in discs])
        out = []
        for k, own in enumerate(answers):
            others = np.delete(answers, k, axis=0).T
            left = own - others @ np.linalg.lstsq(others, own, rcond=1e-9)[0]
            out.append(float(left @ left) / whole)
        return np.array(out)

    def peaks(self, image: FloatArray) -> list[Disc]:
        """A disc of the seed's radius at each local maximum of |image| (n,) that counts, the
        greatest first."""
        o, grid, size = self.options, self.model.grid, np.abs(image)
        order = np.lexsort((np.arange(len(size)), -size))
        taken: list[int] = []
        for j in order[size[order] >= max(o.touch_threshold * size.max(), 1e-300)]:
            around = (np.abs(grid.index - grid.index[j]) <= 1).all(axis=1)
            rivals = (size > size[j]) | ((size == size[j]) & (np.arange(len(size)) < j))
            if not (around & rivals).any():
                taken.append(int(j))
        centres = grid.centres_mm()
        return [
            Disc(
                float(centres[j, 0]),
                float(centres[j, 1]),
                o.touch_seed_radius_mm,
                -1.0 if image[j] < 0 else 1.0,
            )
            for j in taken[: o.max_touches]
        ]

    def fitted(self, starts: Sequence[Disc]) -> list[Disc]:
        """Return the best fit from ``starts``. A disc is added if the residual requires one, and
        discs that are not needed are removed: without each remaining disc, the cost of the others,
        fitted again, is higher by at least ``touch_min_fraction`` of |y|^2."""
        discs, whole = self.best(starts), float(self.y @ self.y)
        least = self.options.touch_min_fraction * whole + MORE_THAN_NOISE * self.noise
        while 0 < len(discs) < self.options.max_touches:
            asks = pull(self.s.T @ self.residual(discs), self.options.sign)
            x, y = self.model.grid.centres_mm()[int(np.argmax(asks))].tolist()
            sign = discs[0].change if self.options.sign != "both" else 1.0
            new = Disc(x, y, self.options.touch_seed_radius_mm, sign)
            more = self.improved(self.with_strengths([*discs, new]))
            if self.cost(discs) - self.cost(more) < least:
                break
            discs = more
        while len(discs) > 1:
            rivals = [self.improved(discs[:k] + discs[k + 1 :]) for k in range(len(discs))]
            spare = min(rivals, key=self.cost)
            if self.cost(spare) - self.cost(discs) > least:
                break
            discs = spare
        return discs if self.cost(discs) < whole else []


# ---- what touches do to each other ----


def interaction(model: Model, discs: Sequence[Disc]) -> FloatArray:
    """Return the interaction of the discs in the folded data (k,), in model volts: the effect of
    the field that each disc causes at the others. The model must have fields
    (docs/reference/eitm-format.md, "FLDS")."""
    assert model.fields is not None
    n, fields, out = model.protocol.n_electrodes, model.fields, np.zeros(len(model.fold.first))
    rows = model.protocol.drive_measure.astype(int)[model.fold.first].T
    at = [_mean_over(model, disc) for disc in discs]
    e = [one[:n] + 1j * one[n : 2 * n] for one in at]
    mirrors = [(one[-4] + 1j * one[-3], one[-2] + 1j * one[-1]) for one in at]
    moments = [_moment(model.grid, disc) for disc in discs]
    for i, here in enumerate(discs):
        z = complex(here.x_mm, here.y_mm)
        added: ComplexArray = np.zeros(n, dtype=complex)
        for j, other in enumerate(discs):
            if i == j:
                continue
            away, (a, b) = z - complex(other.x_mm, other.y_mm), mirrors[j]
            overlap = min(1.0, abs(away) / (here.radius_mm + other.radius_mm)) ** 2
            direct, mirrored = overlap * _inverse_square(away), _inverse_square(a - b * z)
            s = moments[j] * fields.per_sheet
            added += np.conj(s * (e[j] * direct - np.conj(e[j]) * mirrored))
        drive, measure = added[rows[0]] - added[rows[1]], e[i][rows[2]] - e[i][rows[3]]
        out -= fields.volts * moments[i] * np.real(drive * np.conj(measure))
    return out


def _moment(grid: Grid, disc: Disc) -> float:
    """The change integrated over the disc with its soft edge, S/m mm^2."""
    return float(disc.change * np.pi * (disc.radius_mm**2 + grid.pixel_area_mm2 / 12))


def _mean_over(model: Model, disc: Disc) -> FloatArray:
    """The fields' numbers, averaged over the disc's covers; zeros where it covers nothing."""
    assert model.fields is not None
    covers = cover(model.grid, disc.x_mm, disc.y_mm, disc.radius_mm)
    covers = np.where(model.column_weight != 0, covers, 0.0)
    return np.asarray(covers @ model.fields.columns.astype(float)) / (covers.sum() or 1.0)


def _inverse_square(z: complex) -> complex:
    return 1 / z**2 if abs(z) ** 2 > NEAREST_MM2 else 0j


def on_skin(grid: Grid, x_mm: float, y_mm: float) -> tuple[float, float]:
    """The nearest place on a kept pixel."""
    low = np.asarray(grid.origin_mm) + grid.pixel_mm * grid.index
    near = np.clip((x_mm, y_mm), low, low + grid.pixel_mm)
    x, y = near[np.argmin(np.hypot(*(near - (x_mm, y_mm)).T))]
    return float(x), float(y)
