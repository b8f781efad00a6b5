"""A skin that is deformed together with its electrodes, at constant volume: evenly, or on a surface
that takes another shape.

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
from eitskin.fem.mesh import Mesh, lifted
from eitskin.surface.surface_map import SurfaceMap


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


@dataclass(frozen=True, eq=False)
class Flexed:
    """A skin on a surface that has taken the shape of ``surface``; the flattened copy stays, and so
    does the volume of each element."""

    surface: SurfaceMap


def one_after_another(steps: Iterable[Deformation | Flexed]) -> Deformation | Flexed:
    """Return the result of all ``steps``, applied in their order. On a surface there is one."""
    whole = np.eye(2)
    for step in steps:
        if isinstance(step, Flexed):
            return step
        whole = step.matrix @ whole
    return Deformation(*whole.ravel().tolist())


def stretched(along: float, across: float, direction_deg: float) -> Deformation:
    """Return the deformation that multiplies lengths by ``along`` in a direction, and by ``across``
    at right angles to it."""
    c, s = cos(radians(direction_deg)), sin(radians(direction_deg))
    slant = (along - across) * c * s
    return Deformation(along * c * c + across * s * s, slant, slant, along * s * s + across * c * c)


def deformed(model: ForwardModel, how: Deformation | Flexed) -> ForwardModel:
    """Return ``model`` on the deformed mesh. The caller must multiply conductivities by the first
    of ``thickness_of`` and divide contact impedances by the second."""
    mesh = model.mesh
    if isinstance(how, Flexed):
        moved = lifted(mesh, how.surface)
    else:
        moved = Mesh(mesh.nodes_mm @ how.matrix.T, mesh.triangles, mesh.electrode_edges)
    other = ForwardModel(moved, model.skin, model.protocol)
    other.patterns, other.counters = model.patterns, model.counters
    return other


def thickness_of(mesh: Mesh, how: Deformation | Flexed) -> tuple[FloatArray, FloatArray]:
    """Return the thickness of the elements of ``mesh``, (E,), and under its electrodes, (L,),
    relative to those before the deformation."""
    if not isinstance(how, Flexed):
        even = np.full(mesh.n_elements + len(mesh.electrode_edges), how.thickness)
        return even[: mesh.n_elements], even[mesh.n_elements :]
    elements = mesh.true_areas_mm2 / lifted(mesh, how.surface).true_areas_mm2
    under = [np.isin(mesh.triangles, edges).sum(axis=1) >= 2 for edges in mesh.electrode_edges]
    return elements, np.array([elements[one].mean() for one in under])
