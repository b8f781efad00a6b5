"""Networks at the electrodes: a skin by the model's own forward solution, a ring of resistors, or
one resistor."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.homogeneous import resistor_ring
from eitskin.frames.homogeneous_fem import transfer_by_elements
from eitskin.skin.skin import Skin, paper_skin

MIN_SIEMENS = 1e-12


@dataclass(frozen=True, eq=False)
class Load:
    """Conductances in S between electrodes, (n, n), symmetric, and ohms between each electrode's
    wire and the network (``contact_ohm``), farads of each wire to ground (``cable_f``)."""

    siemens: FloatArray
    contact_ohm: FloatArray
    cable_f: float = 0.0

    def lines(self) -> list[str]:
        """Return the network as lines of a deck, between the nodes e0, e1 ..."""
        n = len(self.siemens)
        made = [
            f"RY{i}_{j} y{i} y{j} {1 / self.siemens[i, j]:.9g}"
            for i in range(n)
            for j in range(i)
            if self.siemens[i, j] > MIN_SIEMENS
        ]
        made += [f"RK{i} e{i} y{i} {self.contact_ohm[i]:.9g}" for i in range(n)]
        made += [f"RG{i} y{i} 0 1e11" for i in range(n)]
        if self.cable_f:
            made += [f"CK{i} e{i} 0 {self.cable_f:g}" for i in range(n)]
        return made

    def with_cable(self, farad: float) -> "Load":
        """Return the load at the end of cables."""
        return Load(self.siemens, self.contact_ohm, farad)

    def with_contacts(self, ohm: FloatArray) -> "Load":
        """Return the load with other contacts."""
        return Load(self.siemens, ohm, self.cable_f)


def conductances(transfer_ohm: FloatArray) -> FloatArray:
    """Return the network (n, n) that has this transfer matrix: the inverse where the sum of
    currents is 0. A transfer matrix is known up to a constant for each row and column."""
    n = len(transfer_ohm)
    centred = np.eye(n) - 1.0 / n
    siemens = -np.linalg.pinv(centred @ transfer_ohm @ centred)
    np.fill_diagonal(siemens, 0.0)
    return (siemens + siemens.T) / 2


def _load(transfer_ohm: FloatArray) -> Load:
    return Load(conductances(transfer_ohm), np.full(len(transfer_ohm), 1e-3))


def skin_load(skin: Skin | None = None) -> Load:
    """Return a skin, by finite elements, contacts included; the paper's by default."""
    return _load(transfer_by_elements(skin or paper_skin()))


def ring_load(ohm: float, n: int = 16) -> Load:
    """Return a ring of equal resistors."""
    return _load(resistor_ring(n, ohm).transfer_ohm)


def pair_load(ohm: float, i: int = 0, j: int = 1, n: int = 16) -> Load:
    """Return one resistor between two electrodes."""
    siemens = np.zeros((n, n))
    siemens[i, j] = siemens[j, i] = 1 / ohm
    return Load(siemens, np.full(n, 1e-3))
