"""The exact voltages of a round skin with touches, from boundary integrals. It shares nothing with
the package's finite elements, so tests of the simulator and of touch fits compare with it.
docs/design/oracle.md, "Round skins", has the formulas and their sources.

Inside, lengths are in radii of the skin, places are complex numbers, and potentials are multiplied
by the sheet's conductance, so that the sheet conducts 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from eitskin.arrays import ComplexArray, FloatArray
from eitskin.errors import GeometryError, UsageError
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_shape import GAUSS_REACH, TouchShape
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

ELECTRODE_POINTS = 12
EDGE_POINTS = 32
RINGS = 8
"""A smooth profile is solved as this many rings, each of the profile's mean over its area."""
RING_POINTS = 1.5
"""The points of a ring's edge per width of a ring: closer edges need more points."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Points of a trapezoidal rule on closed edges between two conductivities: places (n,), outward
    normals (n,), weights (n,) and curvatures (n,), and ``reflection`` (n,), (k_in + k_out) / (2
    (k_in - k_out)) for the relative conductivities inside and outside."""

    z: ComplexArray
    normal: ComplexArray
    weight: FloatArray
    curvature: FloatArray
    reflection: FloatArray


Ellipse: TypeAlias = tuple[TrueTouch, float, float, float]
"""A touch whose axes are multiplied by a number, and the conductivities inside and outside."""


class RoundSkin:
    """Calculates the exact voltages of a round ``skin`` with touches, (m,) in V.

    ``contact_impedance_ohm_m2`` is one number or (L,), 0 for ideal electrodes; None takes the
    skin's value. The contacts are solved once, here. The error of even discs and ellipses is below
    1e-4 of their signal with the numbers of points that are set, that of smooth profiles below 1 %.

    Raises:
        GeometryError: the skin is not round.
        UsageError: a contact impedance is below 0 or not finite.
    """

    def __init__(
        self,
        skin: Skin,
        protocol: Protocol,
        contact_impedance_ohm_m2: npt.ArrayLike | None = None,
        electrode_points: int = ELECTRODE_POINTS,
    ) -> None:
        if skin.outline.diameter_mm is None:
            raise GeometryError(
                f"skin {skin.name!r}: its outline is a polygon, but the exact model is for round"
                " skins only"
            )
        given = skin.electrodes.contact_impedance_ohm_m2
        if contact_impedance_ohm_m2 is not None:
            given = contact_impedance_ohm_m2  # type: ignore[assignment]
        count = skin.electrodes.count
        impedance = np.broadcast_to(np.asarray(given, dtype=np.float64), (count,))
        if not (impedance.min() >= 0 and impedance.max() < np.inf):
            raise UsageError("exact model: every contact impedance must be finite and at least 0")
        self.skin, self.protocol = skin, protocol
        self._radius_mm = skin.outline.diameter_mm / 2
        self._sheet_s = skin.conductivity_s_per_m * skin.thickness_mm * 1e-3
        self._solve_contacts(impedance, electrode_points)

    def voltages(self, touches: Sequence[TrueTouch], edge_points: int = EDGE_POINTS) -> FloatArray:
        """Return the voltages (m,) in V of the skin with ``touches``, which must lie inside the rim
        and not meet. A disc's edge has ``edge_points`` points; other edges have more."""
        transfer = self._electrode_potentials
        if len(touches):
            edges = self._edges(touches, edge_points)
            field, back = self._between(edges)
            inner = np.diag(edges.reflection) + _double_layer(edges)
            inner -= field @ (self._from_rim @ back)
            charge = np.linalg.solve(inner, -field @ self._currents)
            transfer = transfer - self._rim_to_electrodes @ (back @ charge)
        first, second, plus, minus = self.protocol.drive_measure.astype(np.int64).T
        ohm = transfer[plus] - transfer[minus]
        rows = np.arange(len(first))
        return np.asarray(
            (ohm[rows, first] - ohm[rows, second]) * (self.protocol.current_a / self._sheet_s)
        )

    def _solve_contacts(self, impedance: FloatArray, points: int) -> None:
        """Solve the untouched skin: the boundary currents for a unit current into each electrode,
        and the response to potentials on the rim."""
        count = len(impedance)
        turn = np.pi * (np.arange(points) + 0.5) / points
        along, half = np.cos(turn), self.skin.electrodes.width_mm / 2 / self._radius_mm
        centres = self.skin.electrode_centres_mm() / self._radius_mm
        angle = (np.arctan2(centres[:, 1], centres[:, 0])[:, None] + half * along).ravel()
        self._rim = np.exp(1j * angle)
        weight = np.tile(half * np.pi / points * np.sin(turn), count)
        apart = np.abs(self._rim[:, None] - self._rim)
        np.fill_diagonal(apart, 1.0)
        potential = -np.log(apart) / np.pi * weight
        own = _own_potential(turn, half) * weight[:points]
        contact = impedance * self._sheet_s / (self.skin.thickness_mm * self._radius_mm * 1e-6)
        for k in range(count):
            block = slice(k * points, (k + 1) * points)
            potential[block, block] = own + contact[k] * np.eye(points)
        member = np.repeat(np.eye(count), points, axis=0)
        size = len(angle)
        whole = np.block([[potential, -member], [member.T * weight, np.zeros((count, count))]])
        inverse = np.linalg.inv(whole)
        self._from_rim = weight[:, None] * inverse[:size, :size]
        self._currents = weight[:, None] * inverse[:size, size:]
        self._rim_to_electrodes = inverse[size:, :size]
        self._electrode_potentials = inverse[size:, size:]

    def _between(self, edges: Edges) -> tuple[FloatArray, FloatArray]:
        """Return the normal field on the edges of a unit current into each rim point, (n, p), and
        the potential of a unit charge on each edge point at the rim points, (p, n)."""
        apart = edges.z[:, None] - self._rim
        field = -(edges.normal[:, None] / apart).real / np.pi
        return field, -np.log(np.abs(apart)).T / np.pi * edges.weight

    def _edges(self, touches: Sequence[TrueTouch], points: int) -> Edges:
        parts = []
        for touch in touches:
            for ellipse, count in _ellipses(touch, points):
                parts.append(_points_of(ellipse, count, self._radius_mm))
        whole = Edges(*(np.concatenate(column) for column in zip(*parts, strict=True)))
        if not np.abs(whole.z).max() < 1:
            raise UsageError("exact model: a touch reaches the skin's rim; move it inwards")
        return whole


def _own_potential(turn: FloatArray, half: float) -> FloatArray:
    """Return the potential on an electrode's points of a current density on them, per weight (p,
    p).

    In s = cos(turn) the kernel -ln|s - s'| is ln 2 + sum of 2/n cos(n turn) cos(n turn'). The sum
    ends where the points can no longer show it. The rest of the kernel is smooth.
    """
    points = len(turn)
    order = np.arange(1, points)
    waves = np.cos(np.outer(turn, order))
    singular = np.log(2.0) + (waves * (2.0 / order)) @ waves.T
    apart = half * np.abs(np.cos(turn)[:, None] - np.cos(turn))
    np.fill_diagonal(apart, 1.0)
    rest = np.log(2 * np.sin(apart / 2) / apart)
    np.fill_diagonal(rest, 0.0)
    return np.asarray((singular - np.log(half) - rest) / np.pi)


def _double_layer(edges: Edges) -> FloatArray:
    """Return the normal field on the edges of a charge on them, with that of its image in the rim,
    (n, n)."""
    apart = edges.z[:, None] - edges.z
    np.fill_diagonal(apart, 1.0)
    direct = (edges.normal[:, None] / apart).real
    np.fill_diagonal(direct, edges.curvature / 2)
    image = edges.normal[:, None] * -edges.z.conj() / (1 - edges.z[:, None] * edges.z.conj())
    return np.asarray(-(direct + image.real) / (2 * np.pi) * edges.weight)


def _ellipses(touch: TrueTouch, points: int) -> list[tuple[Ellipse, int]]:
    """Return the edges of a touch from the outside to the inside, and the points of each."""
    shape = TouchShape() if touch.shape is None else touch.shape
    more = int(np.ceil(points * shape.aspect**0.7))
    if shape.profile == "flat":
        return [((touch, 1.0, touch.contrast, 1.0), more)]
    sizes = np.linspace(1.0, 0.0, RINGS + 1) * (GAUSS_REACH if shape.profile == "gauss" else 1.0)
    means = np.diff(_integral(shape.profile, sizes)) / np.diff(sizes**2)
    levels = np.concatenate([[1.0], 1.0 + (touch.contrast - 1.0) * means])
    whole = 2 * np.pi * RINGS * RING_POINTS * shape.aspect**0.7
    return [
        (
            (touch, float(sizes[k]), float(levels[k + 1]), float(levels[k])),
            max(more, int(np.ceil(whole * sizes[k] / sizes[0]))),
        )
        for k in range(RINGS)
    ]


def _integral(profile: str, size: FloatArray) -> FloatArray:
    """Return the integral of a profile over rho^2, up to rho = ``size``."""
    if profile == "hertz":
        return np.asarray(-2 / 3 * (1 - size**2) ** 1.5)
    return np.asarray(-np.exp2(-(size**2)) / np.log(2))


def _points_of(
    ellipse: Ellipse, count: int, radius_mm: float
) -> tuple[ComplexArray, ComplexArray, FloatArray, FloatArray, FloatArray]:
    """Return the fields of ``Edges`` for one ellipse."""
    touch, size, inside, outside = ellipse
    shape = TouchShape() if touch.shape is None else touch.shape
    long = touch.radius_mm * size * sqrt(shape.aspect) / radius_mm
    short = touch.radius_mm * size / sqrt(shape.aspect) / radius_mm
    turn = 2 * np.pi * (np.arange(count) + 0.5) / count
    towards = np.exp(1j * radians(shape.angle_deg))
    step = -long * np.sin(turn) + 1j * short * np.cos(turn)
    speed = np.abs(step)
    z = (touch.x_mm + 1j * touch.y_mm) / radius_mm
    z = z + towards * (long * np.cos(turn) + 1j * short * np.sin(turn))
    if inside == outside:
        inside = outside * (1 + 1e-12)
    reflection = (inside + outside) / (2 * (inside - outside))
    return (
        z,
        towards * step / speed / 1j,
        speed * 2 * np.pi / count,
        long * short / speed**3,
        np.full(count, reflection),
    )
