"""The forward solve of a scene, from conductivity and contacts to the potentials of the electrodes,
by one of two methods.

``Factorise`` solves each distinct state by its own factorisation, exactly as ``ForwardModel`` does.
``Update`` factorises the untouched skin once. A touch changes the matrix K only on the few unknowns
T under it; with G = (K^-1)_TT and the change D on T (Woodbury)

    (K + P D P')^-1 = K^-1 - K^-1 P D (1 + G D)^-1 P' K^-1 .

A column of K^-1 is solved when its unknown is first touched, and kept, so a moving touch pays only
for the unknowns that it newly reaches. The cheaper method is found by counting multiplications
(``count_costs``).
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from eitskin.arrays import AnyArray, BoolArray, FloatArray, IntArray
from eitskin.fem.cem import ForwardModel, System, factorise, mean_and_deviation
from eitskin.scene.cover import ISOTROPIC, Change, with_touches
from eitskin.scene.effect import PhaseStep

# The cost of ordering and symbolic analysis, in multiplications per stored value of the matrix.
# Measured with SuperLU at 3,000 and 10,000 elements: a factorisation takes as long as 50 to 80
# solves, although it needs only the multiplications of 13 to 28.
SYMBOLIC_PER_VALUE = 200


@dataclass
class Work:
    """The work of a forward solve so far."""

    factorisations: int = 0
    complex_factorisations: int = 0
    solves: int = 0
    updates: int = 0


class Forward(Protocol):
    """Calculates the potentials of the electrodes (L, P) in V per A for each pattern of the model,
    with zero mean."""

    def electrodes(
        self, background: FloatArray, change: Change, impedance_ohm_m2: FloatArray
    ) -> AnyArray:
        """Return the potentials for a skin with conductivity ``background`` (E,) in S/m, a
        ``change``, and contact impedances (L,)."""
        ...


@dataclass(frozen=True, eq=False)
class Factorise:
    """Solves by one factorisation per call, with ``ForwardModel`` itself."""

    model: ForwardModel
    work: Work

    def electrodes(
        self, background: FloatArray, change: Change, impedance_ohm_m2: FloatArray
    ) -> AnyArray:
        """Return the potentials, as in :class:`Forward`."""
        before = self.model.counters.solves
        solution = self.model.solve(with_touches(background, change), impedance_ohm_m2)
        self.work.factorisations += 1
        self.work.solves += self.model.counters.solves - before
        return solution.electrodes


@dataclass(frozen=True, eq=False)
class FactoriseComplex:
    """Solves by one complex factorisation per call, with admittivity and interface impedance from
    the phase step of the scene."""

    model: ForwardModel
    phase: PhaseStep
    work: Work

    def electrodes(
        self, background: FloatArray, change: Change, impedance_ohm_m2: FloatArray
    ) -> AnyArray:
        """Return the complex potentials, as in :class:`Forward`."""
        impedance = self.phase.contact(impedance_ohm_m2)
        system = self.model.system_for(np.asarray(impedance == 0))
        admittivity = _admittivity(self.phase, with_touches(background, change))
        factors = factorise(self.model.matrix(system, admittivity, impedance))
        currents = _right_hand_sides(self.model, system).astype(np.complex128)
        self.work.complex_factorisations += 1
        self.work.factorisations += 1
        self.work.solves += currents.shape[1]
        solved = np.zeros((system.size + 1, currents.shape[1]), np.complex128)
        solved[: system.size] = factors.solve(currents)
        return _zero_mean(solved[system.unknown[self.model.mesh.n_nodes :]])


class Update:
    """Solves by one factorisation of the untouched skin and a low-rank update per call; background
    and contacts must stay the same.

    ``reach`` (u,) are all unknowns that a state is known to touch (``touched_unknowns``), so that
    storage is known beforehand; a state that touches others makes all columns be solved again.
    ``base_factors`` are the factors of the untouched skin's matrix, if known.
    """

    def __init__(
        self,
        model: ForwardModel,
        phase: PhaseStep | None,
        reach: IntArray,
        work: Work,
        base_factors: Any = None,
    ) -> None:
        self.model, self.phase, self.work = model, phase, work
        self.reach, self._factors = reach, base_factors
        self._ready = False

    def electrodes(
        self, background: FloatArray, change: Change, impedance_ohm_m2: FloatArray
    ) -> AnyArray:
        """Return the potentials, as in :class:`Forward`; ``background`` and ``impedance_ohm_m2``
        must be those of the first call."""
        if not self._ready:
            self._factorise_base(background, impedance_ohm_m2)
        if not len(change.elements):
            return _zero_mean(self._base_electrodes)
        elements = change.elements
        values = _admittivity(self.phase, with_touches(background, change))[elements]
        values = values - self._base_values[elements, None] * ISOTROPIC
        unknowns, dense = _dense_change(self.model, self._system, elements, values)
        if not np.isin(unknowns, self.reach).all():
            self.reach = np.union1d(self.reach, unknowns)
            self._solve_base()
        self._solve_columns(unknowns)
        place = np.searchsorted(self.reach, unknowns)
        g = self._columns[place][:, place].T
        inner = np.linalg.solve(np.eye(len(unknowns)) + g @ dense, self._base_touched[place])
        self.work.updates += 1
        to_electrodes = self._columns[place][:, len(self.reach) :].T
        return _zero_mean(self._base_electrodes - to_electrodes @ (dense @ inner))

    def _factorise_base(self, background: FloatArray, impedance_ohm_m2: FloatArray) -> None:
        model = self.model
        impedance: AnyArray = (
            impedance_ohm_m2 if self.phase is None else self.phase.contact(impedance_ohm_m2)
        )
        self._system = system = model.system_for(np.asarray(impedance == 0))
        self._base_values = _admittivity(self.phase, background)
        if self._factors is None:
            self._factors = factorise(system.matrix(self._base_values, impedance))
            self.work.factorisations += 1
            self.work.complex_factorisations += int(self.phase is not None)
        self._dtype = np.result_type(self._base_values, impedance)
        self._solve_base()
        self._ready = True

    def _solve_base(self) -> None:
        """Solve for the untouched skin's potentials on the reached unknowns, and forget all
        columns."""
        model, system = self.model, self._system
        electrodes = system.unknown[model.mesh.n_nodes :]
        self._kept = np.concatenate([self.reach, np.minimum(electrodes, system.size - 1)])
        self._grounded = electrodes == system.size
        currents = _right_hand_sides(model, system)
        base = np.column_stack([self._column(currents[:, k]) for k in range(currents.shape[1])])
        self._base_touched, self._base_electrodes = base[: len(self.reach)], base[len(self.reach) :]
        self._columns = np.zeros((len(self.reach), len(self._kept)), self._dtype)
        self._known = np.zeros(len(self.reach), np.bool_)

    def _column(self, right_side: AnyArray) -> AnyArray:
        """Solve one right-hand side and keep the result on the unknowns that matter. Solving one at
        a time gives the same bits, whichever others are solved."""
        self.work.solves += 1
        kept = self._factors.solve(np.ascontiguousarray(right_side, self._dtype))[self._kept]
        kept[len(self.reach) :][self._grounded] = 0
        return np.asarray(kept)

    def _solve_columns(self, unknowns: IntArray) -> None:
        for place in np.searchsorted(self.reach, unknowns):
            if not self._known[place]:
                unit = np.zeros(self._system.size)
                unit[self.reach[place]] = 1.0
                self._columns[place] = self._column(unit)
                self._known[place] = True


def _admittivity(phase: PhaseStep | None, conductivity: FloatArray) -> AnyArray:
    """Return the admittivity that belongs to a conductivity (E,) or tensors (E, 3): a tensor's
    principal directions stay, and its principal values are converted."""
    if phase is None:
        return conductivity
    if conductivity.ndim == 1:
        return phase.admittivity(conductivity)
    mean, off = mean_and_deviation(conductivity)
    half = np.abs(off)
    greater, lesser = phase.admittivity(mean + half), phase.admittivity(mean - half)
    towards = off / np.where(half > 0, half, 1.0)
    middle, most = (greater + lesser) / 2, (greater - lesser) / 2
    cos, sin = towards.real, towards.imag
    return np.column_stack([middle + most * cos, middle - most * cos, most * sin])


def _right_hand_sides(model: ForwardModel, system: System) -> FloatArray:
    currents = model.patterns.right_hand_sides(len(system.shunted))
    sides = np.zeros((system.size + 1, currents.shape[1]))
    sides[system.unknown[model.mesh.n_nodes :]] = currents
    return sides[: system.size]


def _zero_mean(electrodes: AnyArray) -> AnyArray:
    return np.asarray(electrodes - electrodes.mean(axis=0))


def _dense_change(
    model: ForwardModel, system: System, elements: IntArray, values: AnyArray
) -> tuple[IntArray, AnyArray]:
    """Return the unknowns (k,) under ``elements`` (e,), ascending, and the change of the matrix on
    them (k, k) for changes of the conductivity ``values`` (e, 3)."""
    places = system.unknown[model.mesh.triangles[elements]]
    unknowns, local = np.unique(places, return_inverse=True)
    local = local.reshape(places.shape)
    dense = np.zeros((len(unknowns), len(unknowns)), dtype=values.dtype)
    np.add.at(
        dense, (local[:, :, None], local[:, None, :]), model.element_matrices(elements, values)
    )
    free = unknowns < system.size
    return unknowns[free], dense[np.ix_(free, free)]


def touched_unknowns(model: ForwardModel, shunted: BoolArray, elements: IntArray) -> IntArray:
    """Return the unknowns (k,) at the corners of ``elements`` (e,), ascending, without the grounded
    one."""
    system = model.system_for(shunted)
    unknowns = np.unique(system.unknown[model.mesh.triangles[elements]])
    return np.asarray(unknowns[unknowns < system.size])


@dataclass(frozen=True)
class UpdateCost:
    """The multiplications that each method would need for the whole session, and the number of
    solves of the update."""

    factorise: float
    update: float
    update_solves: int

    @property
    def cheaper(self) -> str:
        """The name of the method with fewer multiplications."""
        return "update" if self.update < self.factorise else "factorise"


def count_costs(model: ForwardModel, shunted: BoolArray, ranks: IntArray, reach: int) -> UpdateCost:
    """Count the multiplications of both methods for states that touch ``ranks`` (s,) unknowns each,
    and ``reach`` different ones together.

    Fill-in is estimated as for nested dissection in the plane: a factor of n unknowns holds about
    1.5 n log2(n) values and takes about 10 n^1.5 multiplications (counted: 23,358 and 0.60 M at n =
    1,482; 146,328 and 8.4 M at n = 5,452).
    """
    system = model.system_for(shunted)
    n, patterns = system.size, len(model.patterns.solved)
    solve = 2 * 1.5 * n * np.log2(max(n, 2))
    once = 10 * n**1.5 + SYMBOLIC_PER_VALUE * len(system.indices)
    rank = ranks.astype(np.float64)
    dense = 4 * rank**3 / 3 + 2 * rank**2 * patterns + rank * patterns * len(shunted)
    return UpdateCost(
        factorise=float(len(ranks) * (once + patterns * solve)),
        update=float(once + (patterns + reach) * solve + dense.sum()),
        update_solves=patterns + reach,
    )
