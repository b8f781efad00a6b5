"""An exact forward model of an even disk with round touches, for derivatives that no mesh disturbs.

Complete electrode model by boundary integrals; lengths in units of the radius, potentials in units
of 1 A over the sheet's conductance. The current density on an electrode is expanded in ORDERS
functions, each the answer of that electrode's own integral equation (logarithmic kernel and
contact impedance) to a Legendre polynomial; Galerkin's method couples the electrodes. A touch of
another conductivity carries a charge density phi on its edge, which solves

    (k_in + k_out) / (2 (k_in - k_out)) phi + K' phi = -du0/dn

with the Neumann kernel of the disk (Nystroem's method, trapezoidal rule on the circle).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.skin.skin import Skin

PANELS, ORDERS, NODES = 32, 6, 40  # of an electrode; of a touch's edge
NEAR = 2.5  # half widths of an electrode: within them the kernel is integrated over each panel

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Disc:
    """A touch: its centre and radius in mm, and its contrast, its conductivity over the skin's."""

    x_mm: float
    y_mm: float
    radius_mm: float
    contrast: float


class ExactDisk:
    """The electrodes' potentials on the disk ``skin`` with any touches.

    Raises:
        UsageError: the skin is not a disk.
    """

    def __init__(self, skin: Skin) -> None:
        if skin.outline.diameter_mm is None:
            raise UsageError("exact disk: the skin must be a disk; give one with diameter_mm")
        self._radius_mm = skin.outline.diameter_mm / 2
        self._sheet_s = skin.conductivity_s_per_m * skin.thickness_mm * 1e-3
        self.electrodes = skin.electrodes.count
        x, y = (skin.electrode_centres_mm() - skin.outline.centre_mm).T
        self._middle = np.arctan2(y, x)
        self._half = skin.electrodes.width_mm / 2 / self._radius_mm
        area_m = skin.thickness_mm * 1e-3 * self._radius_mm * 1e-3
        self._contact = skin.electrodes.contact_impedance_ohm_m2 / area_m * self._sheet_s
        edges = -np.cos(np.linspace(0, np.pi, PANELS + 1))
        self._place = 0.5 * (edges[1:] + edges[:-1])
        self._low = (self._middle[:, None] + self._half * edges[:-1]).ravel()
        self._high = (self._middle[:, None] + self._half * edges[1:]).ravel()
        self._angle = (self._middle[:, None] + self._half * self._place).ravel()
        self._rim = np.exp(1j * self._angle)

    def transfer_ohm(self, touches: Sequence[Disc], nodes: int = NODES) -> FloatArray:
        """Return the potential of each electrode (n, n) in V for 1 A into each."""
        own, into, out, currents = self._electrodes
        if not len(touches):
            return np.asarray(own / self._sheet_s)
        z, normal, weight, curvature, ratio = _edges(touches, self._radius_mm, nodes)
        apart = z[:, None] - z
        np.fill_diagonal(apart, 1)
        direct = normal[:, None] / apart
        np.fill_diagonal(direct, curvature / 2)
        image = -z.conj() / (1 - z[:, None] * z.conj())
        kernel = -(direct + normal[:, None] * image).real / (2 * np.pi) * weight
        to_rim = z[:, None] - self._rim
        slope = -((normal[:, None] / to_rim).real / np.pi) @ currents
        potential = currents.T @ -(np.log(np.abs(to_rim)).T / np.pi * weight)
        coupled = np.diag(ratio) + kernel - slope @ (self._inverse @ potential)
        charge = np.linalg.solve(coupled, -slope @ into)
        return np.asarray((own - out @ (potential @ charge)) / self._sheet_s)

    @cached_property
    def _electrodes(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The untouched disk: potentials (n, n), currents for the electrodes' total currents and
        potentials for charges, and the weighted current functions (panels, functions)."""
        n, widths = self.electrodes, self._high - self._low
        functions = np.zeros((n * PANELS, n * ORDERS))
        polynomials = np.polynomial.legendre.legvander(self._place, ORDERS - 1)
        kernel, contact = self._rim_kernel(), np.full(n * PANELS, self._contact)
        for k in range(n):
            own = slice(k * PANELS, (k + 1) * PANELS)
            alone = kernel[own, own] * widths[own] + self._contact * np.eye(PANELS)
            functions[own, k * ORDERS : (k + 1) * ORDERS] = np.linalg.solve(alone, polynomials)
        currents = widths[:, None] * functions
        galerkin = currents.T @ (kernel @ currents + contact[:, None] * functions)
        totals = currents.T @ np.repeat(np.eye(n), PANELS, axis=0)
        size = len(galerkin)
        system = np.zeros((size + n + 1, size + n + 1))
        system[:size, :size] = 0.5 * (galerkin + galerkin.T)
        system[:size, size:-1], system[size:-1, :size] = -totals, totals.T
        system[-1, size:-1] = system[size:-1, -1] = 1  # the mean potential is zero
        inverse: FloatArray = np.asarray(np.linalg.inv(system), dtype=np.float64)
        self._inverse = inverse[:size, :size]
        return (
            inverse[size:-1, size:-1],
            inverse[:size, size:-1],
            inverse[size:-1, :size],
            currents,
        )

    def _rim_kernel(self) -> FloatArray:
        """The Neumann kernel between panels of the rim: its mean over the panel nearby."""
        apart = np.angle(np.exp(1j * (self._angle[:, None] - self._angle)))
        far = -np.log(np.abs(2 * np.sin(apart / 2)) + np.eye(len(apart)))
        ends = apart + (self._angle - self._low), apart - (self._high - self._angle)
        means = [end * np.log(np.abs(end) + 1e-300) - end for end in ends]
        safe = np.where(apart == 0, 1, apart)
        curved = np.where(apart == 0, 1, np.abs(2 * np.sin(apart / 2)))
        near = -(means[0] - means[1]) / (self._high - self._low) + np.log(np.abs(safe) / curved)
        return np.asarray(np.where(np.abs(apart) < NEAR * self._half, near, far) / np.pi)


def _edges(
    touches: Sequence[Disc], radius_mm: float, nodes: int
) -> tuple[ComplexArray, ComplexArray, FloatArray, FloatArray, FloatArray]:
    """Nodes, normals, weights, curvatures and conductivity ratios of all touches' edges."""
    turn = np.exp(2j * np.pi * (np.arange(nodes) + 0.5) / nodes)
    radii = np.repeat([one.radius_mm / radius_mm for one in touches], nodes)
    centres = np.repeat([complex(one.x_mm, one.y_mm) / radius_mm for one in touches], nodes)
    normal = np.tile(turn, len(touches))
    ratio = [(one.contrast + 1) / (2 * (one.contrast - 1)) for one in touches]
    return (
        centres + radii * normal,
        normal,
        radii * 2 * np.pi / nodes,
        1 / radii,
        np.repeat(ratio, nodes),
    )


def row_voltages(transfer_ohm: FloatArray, rows: npt.ArrayLike) -> FloatArray:
    """Return the voltage per ampere of each row (..., m) of ``transfer_ohm`` (..., n, n)."""
    i_plus, i_minus, v_plus, v_minus = np.asarray(rows, dtype=np.int64).T
    u = transfer_ohm
    return np.asarray(
        u[..., v_plus, i_plus] - u[..., v_minus, i_plus]
        - u[..., v_plus, i_minus] + u[..., v_minus, i_minus]
    )  # fmt: skip
