"""Methods that make images of the tank's frames: every baseline on every kind of data, and the core
with its levers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.fem.grid import Grid
from eitskin.model.build import BuildSettings, Linearisation, make_model
from eitskin.model.model import Model
from eitskin.model.reduction import fold_rows
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.protocol import Protocol as Scan
from eitskin.skin.skin import Skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.compare.families import Family, Method
from eitskin_studies.compare.methods import baseline_methods

DISCS = "eitskin, touches as discs"
TUNED_DISCS = "eitskin, touches as discs, change from simulation"
KINDS = ("difference", "normalised", "log-ratio")
TOUCH_CHANGE_RATIO = 2.0  # metal in water: a disc of contrast c answers as 2 (c - 1) / (c + 1)
CHANGE_RATIOS = (1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 4.0)
MIN_RATIO, MAX_RATIO = 1 / 16, 16.0


@dataclass(frozen=True, eq=False)
class Shown:
    """Images (k, n), what one costs in MACs (0: not counted), and touches where they are found
    directly."""

    images: FloatArray
    macs: float
    touches: tuple[tuple[Touch, ...], ...] | None = None


class Imager(Protocol):
    """Turns frames into images. If not ``signed``, only increases of conductivity are looked for,
    if the method has that option."""

    def show(self, untouched_v: FloatArray, frames_v: FloatArray, signed: bool) -> Shown:
        """Images of ``frames_v`` (k, m) against the mean of ``untouched_v`` (q, m)."""


@dataclass(frozen=True)
class Entry:
    """An imager with one parameter, to be chosen on simulated scenes. ``both_signs``: resistive
    objects can be seen."""

    name: str
    kind: str
    parameter: str
    values: tuple[float, ...]
    make: Callable[[float], Imager]
    both_signs: bool = True


@dataclass(frozen=True)
class Levers:
    """The settings that were tried for images of large objects.

    Attributes:
        kind: of the data.
        regularisation, lambda_rel, iterations: of whitening and solver.
        atom: radius in pixels of the discs that an image is made of; 0 for single pixels.
        blur: radius in pixels of the disc over which the finished image is averaged; 0 for none.
    """

    kind: str = "difference"
    regularisation: float = 0.01
    lambda_rel: float = 0.03
    iterations: int = 60
    atom: float = 0.0
    blur: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulatedTank:
    """Skin, protocol and its linearisation; kernels and models that were made are kept."""

    skin: Skin
    protocol: Scan
    linear: Linearisation
    kernels: dict[float, FloatArray] = field(default_factory=dict)
    models: dict[tuple[str, float, float], Model] = field(default_factory=dict)

    @property
    def grid(self) -> Grid:
        """The grid of all images."""
        return self.linear.grid

    def kernel(self, radius_pixels: float) -> FloatArray:
        """:func:`disc_kernel` on this grid."""
        if radius_pixels not in self.kernels:
            self.kernels[radius_pixels] = disc_kernel(self.grid, radius_pixels)
        return self.kernels[radius_pixels]

    def model(self, kind: str, regularisation: float, atom: float) -> Model:
        """A model for metal in this tank, whose coefficients are discs of ``atom`` pixels' radius,
        or single pixels."""
        key = kind, regularisation, atom
        if key not in self.models:
            linear = self.linear
            if atom:
                linear = Linearisation(
                    linear.grid, linear.jacobian @ self.kernel(atom), linear.v0_v, linear.elements
                )
            settings = BuildSettings(
                data_kind=kind, regularisation=regularisation, touch_change_ratio=TOUCH_CHANGE_RATIO
            )
            self.models[key] = make_model(self.skin, self.protocol, linear, settings)
        return self.models[key]


def disc_kernel(grid: Grid, radius_pixels: float) -> FloatArray:
    """Column j: the part of each pixel that a disc about pixel j covers, (n, n); the identity for
    radius 0."""
    if radius_pixels == 0:
        return np.eye(grid.n_pixels)
    radius = [radius_pixels * grid.pixel_mm]
    return np.array([pixel_cover(grid, centre[None], radius, 8) for centre in grid.centres_mm()]).T


def datum(kind: str, frames_v: FloatArray, reference_v: FloatArray) -> FloatArray:
    """Frames (k, m) as data of ``kind``; the logarithm has the reference's size, as in the core."""
    if kind == "difference":
        return frames_v - reference_v
    if kind == "normalised":
        return (frames_v - reference_v) / reference_v
    return np.asarray(reference_v * np.log(np.clip(frames_v / reference_v, MIN_RATIO, MAX_RATIO)))


class BaselineImager:
    """A method of ``eitskin_studies.compare.baselines`` on folded data of one kind."""

    def __init__(self, tank: SimulatedTank, kind: str, method: Method) -> None:
        self._kind, self._method = kind, method
        self._fold = tank.protocol.reciprocal_pairs()

    def show(self, untouched_v: FloatArray, frames_v: FloatArray, signed: bool) -> Shown:
        """As :class:`Imager`; ``signed`` changes nothing."""
        data = datum(self._kind, frames_v, untouched_v.mean(axis=0))
        sign = np.ones_like(self._fold.sign) if self._kind == "normalised" else self._fold.sign
        first, second = data[:, self._fold.first], data[:, self._fold.second]
        folded = np.where(self._fold.second >= 0, 0.5 * (first + sign * second), first)
        return Shown(
            np.asarray(self._method.reconstruct(folded)), float(getattr(self._method, "macs", 0))
        )


class CoreImager:
    """The C core in float32, cold for each frame, with ``levers`` and ``options``; images, or its
    touches as discs."""

    def __init__(
        self,
        tank: SimulatedTank,
        levers: Levers,
        painted: bool = False,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        self._grid, self._painted = tank.grid, painted
        blur = tank.kernel(levers.blur)
        self._paint = (blur / blur.sum(axis=1, keepdims=True)) @ tank.kernel(levers.atom)
        self._solver = Reconstructor(tank.model(levers.kind, levers.regularisation, levers.atom))
        self._solver.set_options(
            iterations=levers.iterations, lambda_rel=levers.lambda_rel, **(options or {})
        )

    def show(self, untouched_v: FloatArray, frames_v: FloatArray, signed: bool) -> Shown:
        """As :class:`Imager`."""
        self._solver.set_options(sign="both" if signed else "increase")
        self._solver.tare(untouched_v)
        results = []
        for frame in frames_v:
            self._solver.forget()
            results.append(self._solver.reconstruct(frame, touches=self._painted))
        macs = float(np.mean([one.info.macs + one.info.touch_macs for one in results]))
        if not self._painted:
            return Shown(
                np.array([one.solver_image for one in results], dtype=np.float64) @ self._paint.T,
                macs,
            )
        touches = tuple(one.touches for one in results)
        return Shown(np.array([painted_touches(self._grid, one) for one in touches]), macs, touches)


def painted_touches(grid: Grid, touches: Sequence[Touch]) -> FloatArray:
    """Discs of +1 and -1 by their touches' signs, as the part of each pixel that they cover:
    (n,)."""
    image = np.zeros(grid.n_pixels)
    for sign in (1, -1):
        own = [touch for touch in touches if touch.strength_s_per_m_mm2 * sign > 0]
        if own:
            image += sign * pixel_cover(
                grid, np.array([(t.x_mm, t.y_mm) for t in own]), [t.radius_mm for t in own]
            )
    return image


def baseline_entries(tank: SimulatedTank, kind: str) -> tuple[Entry, ...]:
    """All of ``baseline_methods`` on data of ``kind``, reciprocal rows folded, which loses
    nothing."""
    jacobian, fold = tank.linear.jacobian, tank.protocol.reciprocal_pairs()
    folded = fold_rows(jacobian, fold)
    if kind == "normalised":
        folded = folded / fold_rows(tank.linear.v0_v, fold)[:, None]

    def entry(family: Family) -> Entry:
        name = family.make(family.values[0]).name
        signs = "non-negative" not in name
        return Entry(
            name,
            kind,
            family.parameter,
            family.values,
            lambda v: BaselineImager(tank, kind, family.make(v)),
            signs,
        )

    return tuple(entry(family) for family in baseline_methods(folded, tank.grid))


def core_entries(tank: SimulatedTank, kind: str) -> tuple[Entry, ...]:
    """The core on data of ``kind``: its image, its touches as discs, and where their radius is tied
    to their strength, on ratios, these with the expected change of a touch over the water's
    conductivity chosen like any other parameter.
    """
    levers, water = Levers(kind=kind), tank.skin.conductivity_s_per_m

    def entry(name: str, painted: bool) -> Entry:
        return Entry(name, kind, "", (0.0,), lambda _: CoreImager(tank, levers, painted))

    def with_change(ratio: float) -> CoreImager:
        return CoreImager(tank, levers, True, {"touch_change_s_per_m": ratio * water})

    tuned = Entry(TUNED_DISCS, kind, "expected change", CHANGE_RATIOS, with_change)
    plain = entry("eitskin, image", False), entry(DISCS, True)
    return (*plain, tuned) if kind == "log-ratio" else plain
