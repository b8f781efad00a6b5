"""The numpy reference of the off-grid fit of discs in csrc/src/touch/disc_fit.c, keep.c and disc.c:
the same steps, written for reading."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.results import Options
from eitskin.model.model import Model
from eitskin_reference.constants_table import (
    DAMPING,
    DROP_SWEEPS,
    GAIN_LIFT,
    MAX_RADIUS_STEP_PIXELS,
    NO_DIRECTION,
    RADIUS_DEVIATION,
    SETTLED_PIXELS,
    STANDS_OUT_NEAR,
    STEP_TRIALS,
    STRENGTH_PASSES,
)


@dataclass(frozen=True, eq=False)
class Reduced:
    """A frame as the fit sees it: data ``y`` (r,), which ``seen`` (r, n) explains; ``straight``
    (r,), the same of v0 log(v / v0), None where that is not asked for; ``basis`` (k, r) of what is
    ignored; ``threshold``, what S'y of a touch exceeds; ``noise``, what of |y|^2 noise gives."""

    y: FloatArray
    straight: FloatArray | None
    seen: FloatArray
    basis: FloatArray
    threshold: float
    noise: float


@dataclass(frozen=True)
class Disc:
    """A disc of uniform conductivity ``change`` (S/m), whose sign is ``polarity``. ``whole``: two
    were fitted in its place, and were no better."""

    x_mm: float
    y_mm: float
    radius_mm: float
    change: float
    polarity: float
    whole: bool = False


class Fit:
    """One frame's discs: their answers in reduced space, and what they leave of y."""

    def __init__(self, model: Model, frame: Reduced, options: Options) -> None:
        self.model, self.seen, self.basis, self.options = model, frame.seen, frame.basis, options
        self.data, self.whole, self.noise = (
            frame.y,
            float(frame.y @ frame.y),
            frame.noise / model.rank,
        )
        self.threshold = frame.threshold
        self.radius_weight = options.touch_radius_weight
        self.centres = model.grid.centres_mm()
        weight = model.column_weight.astype(np.float64)
        self.per_change = frame.seen / np.where(weight != 0, weight, np.inf)
        self.discs: list[Disc] = []
        self.moves = 0  # steps of single discs so far

    def answers(self, disc: Disc) -> tuple[FloatArray, FloatArray]:
        """The atom (r,) and its derivatives by x, y and radius (3, r)."""
        reduced = self.shaped(disc, edges=False)
        return reduced[0], reduced[1:]

    def shaped(self, disc: Disc, *, edges: bool = True) -> FloatArray:
        """The atom, its derivatives by x, y and radius, and with ``edges`` those by how far out the
        rim is moved, times cos and sin of twice the angle: an ellipse (4 or 6, r)."""
        pixel = self.model.grid.pixel_mm
        offset = self.centres - (disc.x_mm, disc.y_mm)
        distance = np.hypot(offset[:, 0], offset[:, 1])
        share = 0.5 + (disc.radius_mm - distance) / pixel
        cover = np.clip(share, 0.0, 1.0)
        ramp = np.where((share > 0) & (share < 1), 1.0 / pixel, 0.0)
        toward = np.where(
            distance[:, None] > NO_DIRECTION * pixel,
            offset / np.maximum(distance, 1e-300)[:, None],
            0.0,
        )
        x, y = toward.T
        shapes = [ramp * (x**2 - y**2), ramp * 2 * x * y] if edges else []
        reduced = self.per_change @ np.column_stack([cover, ramp * x, ramp * y, ramp, *shapes])
        return np.asarray((reduced - self.basis.T @ (self.basis @ reduced)).T)

    def area_mm2(self, disc: Disc) -> float:
        """What the disc's covers add up to on the pixels that count."""
        distance = np.hypot(*(self.centres - (disc.x_mm, disc.y_mm)).T)
        cover = np.clip(0.5 + (disc.radius_mm - distance) / self.model.grid.pixel_mm, 0.0, 1.0)
        return float(cover[self.model.column_weight != 0].sum()) * self.model.grid.pixel_mm**2

    def best_change(self, disc: Disc, atom: FloatArray, target: FloatArray) -> float:
        """The change that explains ``target`` best along ``atom``, of the disc's own sign."""
        energy = float(atom @ atom)
        change = float(atom @ target) / energy if energy > 0 else 0.0
        return change if change * disc.polarity > 0 else 0.0

    def residual(self, leave_out: int = -1) -> FloatArray:
        """What the discs, but for one, leave of the data."""
        left = self.data.copy()
        for k, disc in enumerate(self.discs):
            if k != leave_out:
                left -= disc.change * self.answers(disc)[0]
        return left

    def seed(self, image: FloatArray) -> None:
        """The greatest local maxima of |image|, in descending order, become discs without
        strength."""
        o, grid = self.options, self.model.grid
        height = np.zeros((grid.ny + 2, grid.nx + 2))
        height[grid.index[:, 1] + 1, grid.index[:, 0] + 1] = np.abs(image)
        number = np.pad(grid.number, 1, constant_values=-1)
        least = o.touch_threshold * np.abs(image).max()
        peaks = []
        for j, (ix, iy) in enumerate(grid.index):
            here = abs(image[j])
            around, who = height[iy : iy + 3, ix : ix + 3], number[iy : iy + 3, ix : ix + 3]
            if (
                here <= 0
                or here < least
                or around.max() > here
                or ((around == here) & (who >= 0) & (who < j)).any()
            ):
                continue
            peaks.append((-here, j))
        for _, j in sorted(peaks)[: o.max_touches]:
            x, y = self.centres[j]
            self.discs.append(
                Disc(float(x), float(y), o.touch_seed_radius_mm, 0.0, -1.0 if image[j] < 0 else 1.0)
            )

    def fit_strengths(self) -> None:
        """All strengths at once by coordinate descent."""
        atoms = [self.answers(disc)[0] for disc in self.discs]
        self.discs = [replace(disc, change=0.0) for disc in self.discs]
        left = self.data.copy()
        for _ in range(STRENGTH_PASSES):
            for k, atom in enumerate(atoms):
                left += self.discs[k].change * atom
                self.discs[k] = replace(
                    self.discs[k], change=self.best_change(self.discs[k], atom, left)
                )
                left -= self.discs[k].change * atom

    def expected_radius(self, disc: Disc) -> float:
        """What strength suggests where the change is known, else the seed's."""
        o = self.options
        if o.touch_change_s_per_m <= 0:
            return o.touch_seed_radius_mm
        ratio = disc.change * disc.polarity / o.touch_change_s_per_m
        return float(
            np.clip(disc.radius_mm * np.sqrt(ratio), o.touch_min_radius_mm, o.touch_max_radius_mm)
        )

    def on_skin(self, disc: Disc) -> bool:
        """Whether a kept pixel is there or next to it."""
        grid = self.model.grid
        cell = np.floor((np.array([disc.x_mm, disc.y_mm]) - grid.origin_mm) / grid.pixel_mm)
        return bool((np.abs(grid.index - cell) <= 1).all(axis=1).any())

    def move(self, k: int) -> float:
        """One damped Gauss-Newton step of disc k, others held; returns how far it went, mm."""
        o, target = self.options, self.residual(leave_out=k)
        self.moves += 1
        atom, slope = self.answers(self.discs[k])
        disc = replace(self.discs[k], change=self.best_change(self.discs[k], atom, target))
        self.discs[k] = disc
        left = target - disc.change * atom
        expected = self.expected_radius(disc)
        energy = disc.change**2 * float(atom @ atom)
        weight = max(self.radius_weight * energy, self.noise) / (RADIUS_DEVIATION * expected) ** 2
        columns = disc.change * np.vstack([slope, atom])
        h, g = columns @ columns.T, columns @ left
        h[2, 2] += weight
        g[2] += weight * (expected - disc.radius_mm)
        step = damped_step(h, g)
        reach = self.model.grid.pixel_mm
        limit = reach * np.array([1.0, 1.0, MAX_RADIUS_STEP_PIXELS])
        step = np.clip(step[:3], -limit, limit)
        cost = float(left @ left) + weight * (disc.radius_mm - expected) ** 2
        for share in (0.5**trial for trial in range(STEP_TRIALS)):
            radius = float(
                np.clip(
                    disc.radius_mm + share * step[2], o.touch_min_radius_mm, o.touch_max_radius_mm
                )
            )
            trial = replace(
                disc,
                x_mm=disc.x_mm + share * step[0],
                y_mm=disc.y_mm + share * step[1],
                radius_mm=radius,
            )
            if not self.on_skin(trial):
                continue
            trial_atom, _ = self.answers(trial)
            trial = replace(trial, change=self.best_change(trial, trial_atom, target))
            rest = target - trial.change * trial_atom
            if float(rest @ rest) + weight * (radius - expected) ** 2 < cost:
                self.discs[k] = trial
                return max(
                    abs(trial.x_mm - disc.x_mm),
                    abs(trial.y_mm - disc.y_mm),
                    abs(radius - disc.radius_mm),
                )
        return 0.0

    def settle(self, which: Sequence[int], sweeps: int) -> None:
        """Sweeps over the discs ``which`` until they settle."""
        for _ in range(sweeps):
            if (
                max((self.move(k) for k in which), default=0.0)
                < SETTLED_PIXELS * self.model.grid.pixel_mm
            ):
                break

    def move_all(self, sweeps: int) -> None:
        """Sweeps over all discs until they settle."""
        self.settle(range(len(self.discs)), sweeps)

    def left(self) -> float:
        """What the discs leave, squared."""
        residual = self.residual()
        return float(residual @ residual)

    def explained(self) -> FloatArray:
        """What leaving each disc alone out would add to |residual|^2, relative to |y|^2."""
        if not self.discs:
            return np.zeros(0)
        atoms = np.array([self.answers(disc)[0] for disc in self.discs])
        norm = np.linalg.norm(atoms, axis=1)
        unit = atoms / np.maximum(norm, 1e-300)[:, None]
        inverse = np.linalg.inv(unit @ unit.T + GAIN_LIFT * np.eye(len(norm)))
        size = np.array([disc.change for disc in self.discs]) * norm
        return np.asarray(size**2 / np.diag(inverse) / self.whole)

    def stands_out(self, k: int) -> bool:
        """Whether disc k passes the frame's own threshold at its place."""
        if self.threshold <= 0:
            return True
        disc, reach = self.discs[k], STANDS_OUT_NEAR * self.model.grid.pixel_mm
        near = (np.abs(self.centres - (disc.x_mm, disc.y_mm)) <= reach).all(axis=1)
        seen = disc.polarity * (self.seen[:, near].T @ self.residual(leave_out=k))
        return bool(seen.max(initial=0.0) >= self.threshold)

    def keep_real(self) -> FloatArray:
        """Drop what explains too little or does not stand out; returns what the others explain."""
        while self.discs:
            explained = self.explained()
            weakest = int(np.argmin(explained))
            enough = (
                explained[0] > 0
                if len(self.discs) == 1
                else explained[weakest] >= self.options.touch_min_fraction
            )
            if enough and self.stands_out(weakest):
                return explained
            del self.discs[weakest]
            self.move_all(min(self.options.touch_sweeps, DROP_SWEEPS))
        return np.zeros(0)


def damped_step(h: FloatArray, g: FloatArray) -> FloatArray:
    """Solve H s = g (4, 4) scaled to a unit diagonal and damped; a parameter nothing depends on
    stays."""
    diagonal = np.diag(h)
    scale = np.where(diagonal > 0, 1 / np.sqrt(np.maximum(diagonal, 1e-300)), 0.0)
    scaled = h * np.outer(scale, scale)
    np.fill_diagonal(scaled, 1 + DAMPING)
    return np.asarray(scale * np.linalg.solve(scaled, scale * g))
