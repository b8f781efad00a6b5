"""Resistors that a maker puts between the electrodes during bring-up, solved as a network."""

from collections.abc import Mapping

import numpy as np

from eitskin.arrays import FloatArray

ELECTRODES, LEAK_OHM = 16, 1e9
Joined = tuple[int | None, int | None, int | None, int | None]


class Fixture:
    """Resistors in ohm between pairs of electrodes; nothing else is connected."""

    def __init__(self, resistor_ohm: Mapping[tuple[int, int], float]) -> None:
        laplacian = np.eye(ELECTRODES) / LEAK_OHM
        for (a, b), ohm in resistor_ohm.items():
            laplacian[a, a] += 1 / ohm
            laplacian[b, b] += 1 / ohm
            laplacian[a, b] -= 1 / ohm
            laplacian[b, a] -= 1 / ohm
        self._ohm: FloatArray = np.asarray(np.linalg.inv(laplacian), dtype=np.float64)

    def transfer_ohm(self, joined: Joined) -> float:
        """Volts from V- to V+ per ampere from I+ to I-; 0 if one of them is open."""
        if None in joined:
            return 0.0
        a, b, c, d = (int(one or 0) for one in joined)
        ohm = self._ohm
        return float(ohm[c, a] - ohm[c, b] - ohm[d, a] + ohm[d, b])

    def load_ohm(self, joined: Joined) -> float:
        """The resistance at the current source; it is large where the path is open."""
        a, b, *_ = joined
        return LEAK_OHM if a is None or b is None else self.transfer_ohm((a, b, a, b))


def chain() -> Fixture:
    """1 kohm from electrode 0 to 1, and 10 kohm from there to 2."""
    return Fixture({(0, 1): 1e3, (1, 2): 10e3})


def ring(wrong: Mapping[int, float] | None = None, ohm: float = 1e3) -> Fixture:
    """A ring of resistors, the k-th from electrode k to the next one; some of them ``wrong``."""
    values = dict.fromkeys(range(ELECTRODES), ohm) | dict(wrong or {})
    return Fixture({(k, (k + 1) % ELECTRODES): one for k, one in values.items()})
