"""Compute the voltages of the protocol from the potentials of the electrodes, including bridges,
detached electrodes and the load of each row.

Seen from its electrodes, a skin is a linear network, so resistors between electrodes need no new
factorisation: with the potentials Z D of the bridges' own current patterns D and resistances R, U'
= U - Z D (R + D' Z D)^-1 D' U.
"""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import AnyArray, BoolArray, FloatArray, IntArray
from eitskin.fem.patterns import Patterns
from eitskin.scene.effect import Contacts, Loads
from eitskin.skin.protocol import Protocol

# The impedance of a detached electrode in the solve. Its net current is zero, and with 1e4 ohm m2
# the current that enters and leaves along its width stays below 1e-8 of the other rows. An
# electrode that a bridge feeds has 2 Gohm on the paper's 48 mm2, where about 1e-5 leaks. A greater
# impedance would cost the solve as many digits.
OPEN_OHM_M2 = 1e4
OPEN_BRIDGED_OHM_M2 = 1e5


@dataclass(frozen=True, eq=False)
class TrueVoltages:
    """The true boundary voltages (m,) of one state and, if a step needs them, the loads of its
    rows."""

    v: AnyArray
    loads: Loads | None = None


@dataclass(frozen=True, eq=False)
class PlainReader:
    """Ideal voltmeters on attached electrodes, exactly as ``ForwardModel.voltages_of`` reads
    them."""

    patterns: Patterns
    current_a: float

    def read(self, electrodes: AnyArray, contacts: Contacts) -> TrueVoltages:
        """Return the voltages for potentials (L, P) in V per A."""
        return TrueVoltages(self.patterns.voltages(electrodes) * self.current_a)


@dataclass(frozen=True, eq=False)
class WholeReader:
    """A reader that also handles bridges, detached electrodes and loads.

    ``patterns`` hold the protocol's patterns, then one for each of ``pairs`` (b, 2), the electrodes
    that any state bridges. Rows that use an electrode without a connection to the skin read 0 V.
    """

    patterns: Patterns
    protocol: Protocol
    pairs: tuple[tuple[int, int], ...]

    def read(self, electrodes: AnyArray, contacts: Contacts) -> TrueVoltages:
        """Return the voltages for potentials (L, P + b) in V per A."""
        potentials = electrodes @ self.patterns.mix.T
        if contacts.bridges:
            potentials = self._bridged(potentials, electrodes, contacts)
        rows, current_a = self.protocol.drive_measure.astype(np.int64), self.protocol.current_a
        live = live_rows(contacts, rows)
        scale = np.where(live, self.patterns.drive_sign * current_a, 0.0)
        source, sink, plus, minus = (
            potentials[rows[:, k], self.patterns.drive] * scale for k in range(4)
        )
        v = np.where(live, (plus - minus), 0.0)
        return TrueVoltages(v, Loads(source, sink, plus, minus, current_a))

    def _bridged(self, potentials: AnyArray, electrodes: AnyArray, contacts: Contacts) -> AnyArray:
        first = electrodes.shape[1] - len(self.pairs)
        own = [first + self.pairs.index((i, j)) for i, j, _ in contacts.bridges]
        spread = electrodes[:, own]
        i, j = (
            np.array([bridge[k] for bridge in contacts.bridges], dtype=np.int64) for k in (0, 1)
        )
        resistance = np.diag([bridge[2] for bridge in contacts.bridges])
        inner = resistance + spread[i] - spread[j]
        current = np.linalg.lstsq(inner, potentials[i] - potentials[j], rcond=None)[0]
        return np.asarray(potentials - spread @ current)


def with_bridges(patterns: Patterns, pairs: tuple[tuple[int, int], ...]) -> Patterns:
    """Return ``patterns`` extended by a unit current between the electrodes of each of
    ``pairs``."""
    if not pairs:
        return patterns
    mix = np.hstack([patterns.mix, np.zeros((len(patterns.mix), len(pairs)))])
    return replace(
        patterns, solved=np.vstack([patterns.solved, np.array(pairs, dtype=np.int64)]), mix=mix
    )


def live_rows(contacts: Contacts, rows: IntArray) -> BoolArray:
    """Return which ``rows`` (m, 4) use only electrodes that touch the skin or are bridged to one
    that does, (m,)."""
    attached = ~contacts.detached
    for _ in range(len(contacts.bridges)):
        for i, j, _ohm in contacts.bridges:
            attached[i] = attached[j] = attached[i] or attached[j]
    return np.asarray(attached[rows].all(axis=1))


def solved_impedance(contacts: Contacts) -> FloatArray:
    """Return the contact impedances (L,) that the solve uses."""
    is_open = np.full(len(contacts.detached), OPEN_OHM_M2)
    is_open[[k for i, j, _ in contacts.bridges for k in (i, j)]] = OPEN_BRIDGED_OHM_M2
    return np.asarray(np.where(contacts.detached, is_open, contacts.impedance_ohm_m2))
