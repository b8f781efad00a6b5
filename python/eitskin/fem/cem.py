"""The complete electrode model on linear triangles (Somersalo, Cheney and Isaacson, SIAM J. Appl.
Math. 52, 1992).

A skin of thickness t carries currents in its plane only. With the potential phi inside and U_l on
electrode l, the weak form is

    sum_e sigma_e t int grad phi . grad v  +  sum_l (t / z_l) int_{E_l} (phi - U_l)(v - V_l)
        =  sum_l I_l V_l .

An electrode without contact impedance is an ideal shunt: its nodes and U_l are one unknown. The U
of the last electrode is fixed at 0, which leaves the matrix symmetric positive definite; afterwards
the potentials are shifted to zero mean over the electrodes.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray, BoolArray, ComplexArray, FloatArray, IntArray
from eitskin.errors import ProtocolError, UsageError, missing_extra
from eitskin.fem.mesh import Mesh, flat_gradients
from eitskin.fem.patterns import Patterns, patterns_for
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

try:
    from scipy.sparse import csc_matrix, csr_matrix
    from scipy.sparse.linalg import splu
except ModuleNotFoundError as error:
    raise missing_extra("model", "scipy") from error


@dataclass
class Counters:
    """The work of a forward model so far: the numbers of sparsity patterns, factorisations and
    solved right-hand sides."""

    patterns: int = 0
    factorisations: int = 0
    solves: int = 0


@dataclass(frozen=True, eq=False)
class Solution:
    """Potentials in V per A of each solved pattern (``ForwardModel.patterns``), with zero mean over
    the electrodes.

    ``nodes`` is (N, P) and ``electrodes`` is (L, P); ``factors`` are the factors of the matrix
    (``factorise``).
    """

    nodes: FloatArray
    electrodes: FloatArray
    factors: Any


@dataclass(frozen=True, eq=False)
class System:
    """The sparsity pattern of the matrix for one choice of shunted electrodes, and the map that
    fills it.

    ``unknown`` (N + L,) numbers the unknown of each node, then of each electrode; the number
    ``size`` stands for the grounded electrode. The stored values of the matrix are ``filling``
    (nnz, E + L) times the conductivities followed by the electrodes' admittances 1 / z.
    """

    shunted: BoolArray
    unknown: IntArray
    size: int
    indices: npt.NDArray[np.int32]
    indptr: npt.NDArray[np.int32]
    filling: csr_matrix

    def matrix(self, conductivity: AnyArray, impedance: AnyArray) -> csc_matrix:
        """Return the symmetric matrix, (size, size) in S. It is positive definite if all values are
        real."""
        return self._with(self._values(conductivity, impedance))

    def matrix_with(
        self, conductivity: AnyArray, impedance: AnyArray, unknowns: IntArray, added: AnyArray
    ) -> csc_matrix:
        """Return the matrix of ``conductivity``, to which the small matrices ``added`` (e, k, k) on
        ``unknowns`` (e, k) of elements are added."""
        values = self._values(conductivity, impedance)
        rows, columns = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
        free = (rows < self.size) & (columns < self.size)
        column_of_value = np.repeat(np.arange(self.size), np.diff(self.indptr))
        stored = column_of_value * self.size + self.indices
        place = np.searchsorted(stored, columns[free] * self.size + rows[free])
        np.add.at(values, place, added[free])
        return self._with(values)

    def _values(self, conductivity: AnyArray, impedance: AnyArray) -> AnyArray:
        admittance = np.divide(1.0, impedance, out=np.zeros_like(impedance), where=~self.shunted)
        return np.asarray(self.filling @ np.concatenate([conductivity, admittance]))

    def _with(self, values: AnyArray) -> csc_matrix:
        return csc_matrix((values, self.indices, self.indptr), shape=(self.size, self.size))


class ForwardModel:
    """Calculates the boundary voltages of a skin for any conductivity of the mesh's elements. The
    sparsity pattern is made only once.

    A conductivity is one number; one for each element, (E,); or a symmetric tensor for each
    element, (E, 3), in the order xx, yy, xy.

    ``contact_impedance_ohm_m2`` is one number or (L,); None takes the skin's value. ``counters``
    counts the work done.

    Raises:
        ProtocolError: the protocol and the skin have different numbers of electrodes.
        UsageError: a contact impedance is negative or not finite, or there is not one for each
            electrode.
    """

    def __init__(
        self,
        mesh: Mesh,
        skin: Skin,
        protocol: Protocol,
        contact_impedance_ohm_m2: npt.ArrayLike | None = None,
    ) -> None:
        count = skin.electrodes.count
        if protocol.n_electrodes != count:
            raise ProtocolError(
                f"protocol for {protocol.n_electrodes} electrodes, but skin {skin.name!r} has"
                f" {count}; make them agree"
            )
        self.mesh, self.skin, self.protocol = mesh, skin, protocol
        self.patterns: Patterns = patterns_for(protocol)
        self.counters = Counters()
        self.thickness_m = skin.thickness_mm * 1e-3
        self.gradients_per_m = shape_gradients(mesh)
        if contact_impedance_ohm_m2 is None:
            contact_impedance_ohm_m2 = skin.electrodes.contact_impedance_ohm_m2
        self._impedance = _checked_impedance(contact_impedance_ohm_m2, count)
        self._system = self._make_system(self._impedance == 0)

    def solve(
        self,
        conductivity_s_per_m: npt.ArrayLike,
        contact_impedance_ohm_m2: npt.ArrayLike | None = None,
    ) -> Solution:
        """Solve every pattern with a single factorisation.

        ``contact_impedance_ohm_m2`` replaces the model's values for this call; a different set of
        zero impedances needs a new sparsity pattern.
        """
        conductivity = self._checked_conductivity(conductivity_s_per_m)
        impedance = self._impedance
        if contact_impedance_ohm_m2 is not None:
            impedance = _checked_impedance(contact_impedance_ohm_m2, len(impedance))
        system, n_nodes = self.system_for(impedance == 0), self.mesh.n_nodes
        currents = self.patterns.right_hand_sides(len(impedance))
        right_sides = np.zeros((system.size + 1, currents.shape[1]))
        right_sides[system.unknown[n_nodes:]] = currents
        factors = factorise(self.matrix(system, conductivity, impedance))
        potentials = np.zeros_like(right_sides)
        potentials[: system.size] = factors.solve(right_sides[: system.size])
        self.counters.factorisations += 1
        self.counters.solves += right_sides.shape[1]
        electrodes = potentials[system.unknown[n_nodes:]]
        shift = electrodes.mean(axis=0)
        return Solution(potentials[system.unknown[:n_nodes]] - shift, electrodes - shift, factors)

    def system_for(self, shunted: BoolArray) -> System:
        """Return the system in which the electrodes ``shunted`` (L,) are ideal. It is made again
        only if they change."""
        if not np.array_equal(shunted, self._system.shunted):
            self._system = self._make_system(shunted)
        return self._system

    def voltages_of(self, solution: Solution) -> FloatArray:
        """Return the boundary voltages (m,) in V that the protocol measures for ``solution``, at
        the protocol's current."""
        return self.patterns.voltages(solution.electrodes) * self.protocol.current_a

    def voltages(
        self,
        conductivity_s_per_m: npt.ArrayLike,
        contact_impedance_ohm_m2: npt.ArrayLike | None = None,
    ) -> FloatArray:
        """Return the boundary voltages (m,) in V; arguments and errors are those of ``solve``."""
        return self.voltages_of(self.solve(conductivity_s_per_m, contact_impedance_ohm_m2))

    def _checked_conductivity(self, given: npt.ArrayLike) -> FloatArray:
        conductivity = np.asarray(given, dtype=np.float64)
        if conductivity.ndim == 0:
            conductivity = np.full(self.mesh.n_elements, float(conductivity))
        count = self.mesh.n_elements
        if conductivity.shape not in ((count,), (count, 3)):
            raise UsageError(
                f"forward model: conductivity of shape {conductivity.shape} for"
                f" {count} elements; give one value for each element or one for all, or"
                " a tensor (xx, yy, xy) for each element"
            )
        least, most = conductivity, conductivity
        if conductivity.ndim == 2:
            mean, off = mean_and_deviation(conductivity)
            least, most = mean - np.abs(off), mean + np.abs(off)
        if not (least.min() > 0 and most.max() < np.inf):
            raise UsageError("forward model: every conductivity must be finite and above 0 S/m")
        return conductivity

    def matrix(self, system: System, conductivity: AnyArray, impedance: AnyArray) -> csc_matrix:
        """Return the matrix of ``system`` for conductivities (E,) or (E, 3), real or complex, and
        contact impedances (L,)."""
        if conductivity.ndim == 1:
            return system.matrix(conductivity, impedance)
        mean = (conductivity[:, 0] + conductivity[:, 1]) / 2
        uneven = np.flatnonzero(
            (conductivity[:, 0] != conductivity[:, 1]) | (conductivity[:, 2] != 0)
        )
        rest = conductivity[uneven] - mean[uneven, None] * np.array([1.0, 1.0, 0.0])
        unknowns = system.unknown[self.mesh.triangles[uneven]]
        return system.matrix_with(mean, impedance, unknowns, self.element_matrices(uneven, rest))

    def element_matrices(self, elements: IntArray, conductivity: AnyArray) -> AnyArray:
        """Return the matrices (e, 3, 3) in S of ``elements`` (e,) with tensors (e, 3)."""
        x, y = np.moveaxis(self.gradients_per_m[elements], 2, 0)
        xx, yy, xy = (conductivity[:, k, None] for k in range(3))
        along_x, along_y = xx * x + xy * y, xy * x + yy * y
        products = x[:, :, None] * along_x[:, None, :] + y[:, :, None] * along_y[:, None, :]
        volumes_m3 = self.mesh.true_areas_mm2[elements] * (1e-6 * self.thickness_m)
        return np.asarray(products * volumes_m3[:, None, None])

    def _make_system(self, shunted: BoolArray) -> System:
        self.counters.patterns += 1
        every = np.arange(self.mesh.n_elements)
        stiffness = self.element_matrices(every, np.tile([1.0, 1.0, 0.0], (len(every), 1)))
        return _system(self.mesh, shunted, stiffness, self.thickness_m)


def factorise(matrix: csc_matrix) -> Any:
    """Factorise a symmetric ``matrix``, real or complex, that needs no pivoting; return scipy's
    SuperLU object."""
    return splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )


def shape_gradients(mesh: Mesh) -> FloatArray:
    """Return the gradients of the three hat functions of each triangle in its true shape, (E, 3, 2)
    in 1/m."""
    gradients = flat_gradients(mesh)
    if mesh.stretch is None:
        return gradients
    return np.asarray(gradients @ np.linalg.inv(mesh.stretch))


def mean_and_deviation(tensor: FloatArray) -> tuple[FloatArray, ComplexArray]:
    """Return the mean (e,) of the two principal values of symmetric tensors (e, 3), and half their
    difference times the squared direction of the greater one as a complex number, (e,)."""
    xx, yy, xy = np.moveaxis(tensor, -1, 0)
    return (xx + yy) / 2, (xx - yy) / 2 + 1j * xy


def _checked_impedance(given: npt.ArrayLike, count: int) -> FloatArray:
    impedance = np.asarray(given, dtype=np.float64)
    if impedance.ndim == 0:
        impedance = np.full(count, float(impedance))
    if impedance.shape != (count,):
        raise UsageError(
            f"forward model: contact impedance of shape {impedance.shape} for {count} electrodes"
        )
    if not (impedance.min() >= 0 and impedance.max() < np.inf):
        raise UsageError(
            "forward model: every contact impedance must be finite and at least 0 ohm m2"
        )
    return impedance.copy()


def _number_unknowns(mesh: Mesh, shunted: BoolArray) -> tuple[IntArray, int]:
    """Number the unknowns: return the number for each node, then for each electrode, (N + L,), and
    their count. The count itself stands for the grounded electrode."""
    count = len(shunted)
    leader = np.arange(mesh.n_nodes + count)
    for k in np.flatnonzero(shunted):
        leader[mesh.electrode_edges[k].ravel()] = mesh.n_nodes + k
    is_unknown = leader == np.arange(len(leader))
    is_unknown[-1] = False
    number = np.cumsum(is_unknown) - 1
    number[-1] = size = int(np.count_nonzero(is_unknown))
    return number[leader], size


def _contact_terms(
    mesh: Mesh, shunted: BoolArray, thickness_m: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the matrices of the rim edges on (node, node, electrode): their unknowns (B, 3), their
    electrodes (B,), and values (B, 3, 3) in m2 per 1/z."""
    touching = np.flatnonzero(~shunted)
    owner = np.repeat(touching, [len(mesh.electrode_edges[k]) for k in touching])
    edges = np.concatenate(
        [np.zeros((0, 2), np.int64), *(mesh.electrode_edges[k] for k in touching)]
    )
    steps = mesh.nodes_mm[edges[:, 1]] - mesh.nodes_mm[edges[:, 0]]
    area_m2 = np.hypot(steps[:, 0], steps[:, 1]) * 1e-3 * thickness_m
    one = np.array([[2, 1, -3], [1, 2, -3], [-3, -3, 6]]) / 6
    return np.column_stack([edges, mesh.n_nodes + owner]), owner, area_m2[:, None, None] * one


def _system(mesh: Mesh, shunted: BoolArray, stiffness: FloatArray, thickness_m: float) -> System:
    unknown, size = _number_unknowns(mesh, shunted)
    contact_places, contact_owner, contact_values = _contact_terms(mesh, shunted, thickness_m)
    places = unknown[np.concatenate([mesh.triangles, contact_places])]
    rows, columns = np.repeat(places, 3, axis=1).ravel(), np.tile(places, (1, 3)).ravel()
    owners = np.repeat(
        np.concatenate([np.arange(mesh.n_elements), mesh.n_elements + contact_owner]), 9
    )
    values = np.concatenate([stiffness.ravel(), contact_values.ravel()])
    kept = np.flatnonzero((rows < size) & (columns < size))
    order = kept[_counting_order(rows[kept], size)]
    order = order[_counting_order(columns[order], size)]
    rows, columns = rows[order], columns[order]
    is_first = np.append(True, (np.diff(rows) != 0) | (np.diff(columns) != 0))
    begins = np.append(np.flatnonzero(is_first), len(order))
    shape = (len(begins) - 1, mesh.n_elements + len(shunted))
    return System(
        shunted=shunted,
        unknown=unknown,
        size=size,
        indices=rows[is_first].astype(np.int32),
        indptr=np.searchsorted(columns[is_first], np.arange(size + 1)).astype(np.int32),
        filling=csr_matrix((values[order], owners[order], begins), shape=shape),
    )


def _counting_order(keys: IntArray, size: int) -> IntArray:
    """Return the stable order of ``keys`` in [0, size). scipy converts rows to columns by a
    counting sort, which is faster than a comparison sort."""
    one_a_row = csr_matrix(
        (np.ones(len(keys), np.int8), keys, np.arange(len(keys) + 1)), shape=(len(keys), size)
    )
    return np.asarray(one_a_row.tocsc().indices)
