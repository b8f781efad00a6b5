"""A skin that is deformed together with its electrodes, at constant volume: evenly, or on a surface
that takes another shape.

Touches, truth and pictures stay in the coordinates of the flat skin: they move with the material.
The forward problem is solved on the deformed mesh. The resistivity of a gel is that of its salt
water and does not change (Keplinger et al., Science 341, 2013); its lengths and thickness do.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh, lifted
from eitskin.scene.cover import Cover
from eitskin.surface.surface_map import SurfaceMap


class Deformation(ABC):
    """A change of the lengths of a skin. Frames with equal deformations share a solve; therefore
    deformations can be compared and hashed."""

    @abstractmethod
    def moved(self, mesh: Mesh) -> Mesh:
        """Return ``mesh`` with its nodes at their places on the deformed skin."""

    @abstractmethod
    def thickness_of(self, mesh: Mesh) -> tuple[FloatArray, FloatArray]:
        """Return the thickness of the elements of ``mesh``, (E,), and under its electrodes, (L,),
        relative to those before the deformation."""

    @abstractmethod
    def covered(self, cover: Cover) -> Cover:
        """Return the cover of the deformed skin; ``cover`` is that before the deformation."""


@dataclass(frozen=True)
class EvenDeformation(Deformation):
    """The same deformation everywhere on a flat skin: a place (x, y) moves to (xx x + xy y, yx x +
    yy y), and the volume is kept."""

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

    def moved(self, mesh: Mesh) -> Mesh:
        return Mesh(mesh.nodes_mm @ self.matrix.T, mesh.triangles, mesh.electrode_edges)

    def thickness_of(self, mesh: Mesh) -> tuple[FloatArray, FloatArray]:
        elements = np.full(mesh.n_elements, self.thickness)
        return elements, np.full(len(mesh.electrode_edges), self.thickness)

    def covered(self, cover: Cover) -> Cover:
        return cover.deformed(self.matrix)


FLAT = EvenDeformation()


@dataclass(frozen=True, eq=False)
class FlexedSurface(Deformation):
    """A skin on a surface that has taken the shape of ``surface``; the flattened copy stays, and so
    does the volume of each element."""

    surface: SurfaceMap

    def moved(self, mesh: Mesh) -> Mesh:
        return lifted(mesh, self.surface)

    def thickness_of(self, mesh: Mesh) -> tuple[FloatArray, FloatArray]:
        elements = mesh.true_areas_mm2 / self.moved(mesh).true_areas_mm2
        under = [np.isin(mesh.triangles, edges).sum(axis=1) >= 2 for edges in mesh.electrode_edges]
        return elements, np.array([elements[one].mean() for one in under])

    def covered(self, cover: Cover) -> Cover:
        return Cover(self.moved(cover.mesh))


@dataclass(frozen=True)
class InTurn(Deformation):
    """Several deformations, one after the other."""

    steps: tuple[Deformation, ...]

    def moved(self, mesh: Mesh) -> Mesh:
        for step in self.steps:
            mesh = step.moved(mesh)
        return mesh

    def thickness_of(self, mesh: Mesh) -> tuple[FloatArray, FloatArray]:
        elements, contacts = np.ones(mesh.n_elements), np.ones(len(mesh.electrode_edges))
        for step in self.steps:
            of_elements, of_contacts = step.thickness_of(mesh)
            elements, contacts = elements * of_elements, contacts * of_contacts
            mesh = step.moved(mesh)
        return elements, contacts

    def covered(self, cover: Cover) -> Cover:
        for step in self.steps:
            cover = step.covered(cover)
        return cover


def one_after_another(steps: Iterable[Deformation]) -> Deformation:
    """Return the result of all ``steps``, in their order. Steps that change nothing are left
    out."""
    changing = tuple(step for step in steps if step != FLAT)
    if not changing:
        return FLAT
    return changing[0] if len(changing) == 1 else InTurn(changing)


def stretched(along: float, across: float, direction_deg: float) -> EvenDeformation:
    """Return the deformation that multiplies lengths by ``along`` in a direction, and by ``across``
    at right angles to it."""
    c, s = cos(radians(direction_deg)), sin(radians(direction_deg))
    slant = (along - across) * c * s
    return EvenDeformation(
        along * c * c + across * s * s, slant, slant, along * s * s + across * c * c
    )


def deformed(model: ForwardModel, how: Deformation) -> ForwardModel:
    """Return ``model`` on the deformed mesh. The caller must multiply conductivities by the first
    result of ``how.thickness_of`` and divide contact impedances by the second."""
    other = ForwardModel(how.moved(model.mesh), model.skin, model.protocol)
    other.patterns, other.counters = model.patterns, model.counters
    return other
