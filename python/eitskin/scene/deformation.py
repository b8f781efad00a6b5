"""A skin that is deformed evenly together with its electrodes, at constant volume.

Touches, truth and pictures stay in the coordinates of the flat skin: they move with the material.
The forward problem is solved on the deformed mesh. The resistivity of a gel is that of its salt
water and does not change (Keplinger et al., Science 341, 2013); its lengths and thickness do.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh


@dataclass(frozen=True)
class Deformation:
    """An even deformation: a place (x, y) moves to (xx x + xy y, yx x + yy y), and the volume is
    kept."""

    xx: float = 1.0
    xy: float = 0.0
    yx: float = 0.0
    yy: float = 1.0

    @property
    def matrix(self) -> FloatArray:
        """The matrix (2, 2) that multiplies a column (x, y)."""
        return np.array([[self.xx, self.xy], [self.yx, self.yy]])

    @property
    def thickness(self) -> float:
        """The thickness relative to that of the flat skin."""
        return 1 / (self.xx * self.yy - self.xy * self.yx)


FLAT = Deformation()


def one_after_another(steps: Iterable[Deformation]) -> Deformation:
    """Return the result of all ``steps``, applied in their order."""
    whole = np.eye(2)
    for step in steps:
        whole = step.matrix @ whole
    return Deformation(*whole.ravel().tolist())


def stretched(along: float, across: float, direction_deg: float) -> Deformation:
    """Return the deformation that multiplies lengths by ``along`` in a direction, and by ``across``
    at right angles to it."""
    c, s = cos(radians(direction_deg)), sin(radians(direction_deg))
    slant = (along - across) * c * s
    return Deformation(along * c * c + across * s * s, slant, slant, along * s * s + across * c * c)


def deformed(model: ForwardModel, how: Deformation) -> ForwardModel:
    """Return ``model`` on the deformed mesh. The caller must multiply conductivities by
    ``how.thickness`` and divide contact impedances by it."""
    mesh = model.mesh
    moved = Mesh(mesh.nodes_mm @ how.matrix.T, mesh.triangles, mesh.electrode_edges)
    other = ForwardModel(moved, model.skin, model.protocol)
    other.patterns, other.counters = model.patterns, model.counters
    return other
