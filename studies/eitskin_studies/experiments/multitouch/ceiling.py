"""The limits of the count, by fits that begin at the true places of all touches.

*Discs*: the oracle's fit of discs, begun at the true centres: if this is exact where the core is
not, its search is at fault. *Nonlinear*: least squares on the
finite-element solution of another mesh, with nominal contacts and the true contrast: if this is
exact where the core's fit is not, linearising is at fault; if it is not either, the data are.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fem.sensitivity import element_fields
from eitskin.model.model import Model
from eitskin.oracle.discs import Disc, DiscFit
from eitskin.oracle.engine import OracleEngine
from eitskin.scene.cover import ISOTROPIC, Cover, with_touches
from eitskin.scene.random_touches import TouchScene, TrueTouch
from eitskin.scoring.matching import GATE_MM, match
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin_studies.harness.sessions import MeasuredFrames

ELEMENTS = 3000
STEPS = 12
STEP_MM = 0.5
MIN_RADIUS_MM, MAX_RADIUS_MM = 1.0, 30.0
CLEAR_DEVIATIONS = 3.0


class GivenPlaces(OracleEngine):
    """The oracle, whose fit starts at the places that it is given."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.places_mm: FloatArray = np.zeros((0, 2))

    def starts(self, fit: DiscFit, image: FloatArray) -> list[Disc]:
        """Discs of the seed's radius at those places."""
        radius_mm = self.options.touch_seed_radius_mm
        return [Disc(float(x), float(y), radius_mm, 1.0) for x, y in self.places_mm]


def core_told(model: Model, measured: MeasuredFrames, scenes: Sequence[TouchScene]) -> list[bool]:
    """Return whether the fit that begins at the truth is exact, for each scene."""
    engine = GivenPlaces(model)
    engine.set_reference(measured.untouched_v)
    exact = []
    for frame_v, scene in zip(measured.frames_v[:, -1], scenes, strict=True):
        engine.forget()
        engine.places_mm = scene.centres_mm()
        touches = engine.reconstruct(frame_v).touches
        exact.append(match(scene.centres_mm(), [(t.x_mm, t.y_mm) for t in touches]).exact)
    return exact


@dataclass(frozen=True)
class FittedDiscs:
    """A nonlinear fit: whether each touch stayed within 10 mm and is there beyond doubt (radius
    over its deviation 3 or more); the error of the worst place, and the deviation that noise alone
    gives the worst, both mm."""

    exact: bool
    worst_mm: float
    deviation_mm: float


class Truthful:
    """Fits x, y and radius of discs whose number and contrast are known, nonlinearly, on its own
    mesh."""

    def __init__(self, skin: Skin, protocol: Protocol) -> None:
        self._mesh = mesh_for_elements(skin, ELEMENTS)
        self._forward, self._cover = ForwardModel(self._mesh, skin, protocol), Cover(self._mesh)
        self._sheet = skin.conductivity_s_per_m
        self._untouched_v = self._forward.voltages(self._sheet)
        self._last: tuple[bytes, tuple[FloatArray, FloatArray]] | None = None

    def fit(
        self, frame_v: FloatArray, untouched_v: FloatArray, noise_v: float, scene: TouchScene
    ) -> FittedDiscs:
        """From the true places on. Rows are scaled to this mesh's own V0, which takes contacts and
        mesh out to first order."""
        from scipy.optimize import least_squares

        contrasts = [touch.contrast for touch in scene.touches]
        target = frame_v * self._untouched_v / untouched_v
        begin = np.array([(t.x_mm, t.y_mm, t.radius_mm) for t in scene.touches]).ravel()
        low = np.tile([-np.inf, -np.inf, MIN_RADIUS_MM], len(contrasts))
        high = np.tile([np.inf, np.inf, MAX_RADIUS_MM], len(contrasts))

        def residual(parameters: FloatArray) -> FloatArray:
            return np.asarray((self._answer(parameters, contrasts)[0] - target) / noise_v)

        def slope(parameters: FloatArray) -> FloatArray:
            return np.asarray(self._answer(parameters, contrasts)[1] / noise_v)

        found = least_squares(residual, begin, slope, bounds=(low, high), max_nfev=STEPS)
        values = found.x.reshape(-1, 3)
        jacobian = np.asarray(found.jac)
        spread = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian))).reshape(-1, 3)
        errors = np.hypot(*(values[:, :2] - scene.centres_mm()).T)
        there = bool((values[:, 2] >= CLEAR_DEVIATIONS * spread[:, 2]).all())
        deviation = float(np.hypot(spread[:, 0], spread[:, 1]).max())
        return FittedDiscs(
            there and bool((errors <= GATE_MM).all()), float(errors.max()), deviation
        )

    def _answer(
        self, parameters: FloatArray, contrasts: Sequence[float]
    ) -> tuple[FloatArray, FloatArray]:
        """Voltages (m,) V and their derivatives (m, 3 k) V/mm, by the adjoint method on the
        elements under a disc's edge."""
        key = parameters.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1]
        discs = [
            TrueTouch(float(x), float(y), float(radius), contrast)
            for (x, y, radius), contrast in zip(parameters.reshape(-1, 3), contrasts, strict=True)
        ]
        sheet = np.full(self._mesh.n_elements, self._sheet)
        solution = self._forward.solve(with_touches(sheet, self._cover.change(discs)))
        fields, patterns = element_fields(self._forward, solution), self._forward.patterns
        scale = (
            -self._forward.protocol.current_a
            * self._forward.thickness_m
            * patterns.drive_sign
            * patterns.measure_sign
        )
        slopes = []
        for disc in discs:
            for name in ("x_mm", "y_mm", "radius_mm"):
                change = self._edge(disc, name)
                mine = np.flatnonzero(change.any(axis=1))
                weight = self._sheet * self._mesh.areas_mm2[mine] * 1e-6
                tensors = change[mine][:, [[0, 2], [2, 1]]] * weight[:, None, None]
                product = np.einsum(
                    "edp,edq->pq", fields[mine], tensors @ fields[mine], optimize=True
                )
                slopes.append(scale * product[patterns.drive, patterns.measure])
        answer = self._forward.voltages_of(solution), np.array(slopes).T
        self._last = key, answer
        return answer

    def _edge(self, disc: TrueTouch, name: str) -> FloatArray:
        """How the conductivity of each element over the sheet's changes with one of the lengths of
        ``disc``, (E, 3) 1/mm."""
        change = np.zeros((self._mesh.n_elements, 3))
        for sign in (1.0, -1.0):
            moved = replace(disc, **{name: getattr(disc, name) + sign * STEP_MM})
            found = self._cover.change([moved])
            change[found.elements] += sign * (found.tensor - ISOTROPIC) / (2 * STEP_MM)
        return change


def untouched_mean(measured: MeasuredFrames) -> FloatArray:
    """(m,) V."""
    mean = np.asarray(measured.untouched_v.mean(axis=0))
    return np.where(np.abs(mean) > 0, mean, math.inf)
