"""Methods and families: a method makes images of difference frames; a family is a method with its
one parameter.

A method needs ``name`` and ``reconstruct``. Two things are optional: ``learn`` is given the
untouched frames of a session before its difference frames, and ``touches`` finds positions by
itself, where others have theirs read off the image.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.fields import electrode_fields
from eitskin.fem.grid import Grid, grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fem.sensitivity import sensitivity
from eitskin.model.build import Linearisation
from eitskin.skin.protocol import Protocol as Scan
from eitskin.skin.skin import Skin


class Method(Protocol):
    """A reconstruction under comparison."""

    @property
    def name(self) -> str:
        """The name in the table."""

    def reconstruct(self, dv: FloatArray) -> FloatArray:
        """Images (k, n) of difference frames (k, m) in V."""


@runtime_checkable
class Learns(Protocol):
    """A method that wants to see the untouched skin first."""

    def learn(self, untouched_v: FloatArray) -> None:
        """Untouched frames (q, m) in V of the session whose difference frames (to their mean) come
        next."""


@runtime_checkable
class FindsTouches(Protocol):
    """A method that reports positions itself."""

    def touches(self, dv: FloatArray) -> Sequence[FloatArray]:
        """For each difference frame the positions (t, 2) in mm that it finds."""


@dataclass(frozen=True)
class Family:
    """A method with one parameter, to be chosen on training scenes.

    Attributes:
        parameter: what it is, for the table; "" where there is none.
        values: those that are tried.
        make: the method at a value.
    """

    parameter: str
    values: tuple[float, ...]
    make: Callable[[float], Method]


@dataclass(frozen=True, eq=False)
class Setup:
    """The data that methods are built from.

    Attributes:
        skin, protocol, grid: what is reconstructed.
        jacobian: (m, n) in V per (S/m) at the skin's own conductivity.
        voltages_v: (m,) of the untouched skin.
        electrode_fields: (n, 2, L) in V/m per A of each electrode's current in it.
        mesh_nodes, mesh_elements: size of the mesh that both were computed on.
    """

    skin: Skin
    protocol: Scan
    grid: Grid
    jacobian: FloatArray
    voltages_v: FloatArray
    electrode_fields: FloatArray
    mesh_nodes: int
    mesh_elements: int

    @property
    def linearisation(self) -> Linearisation:
        """The linearisation from which a model is made."""
        return Linearisation(
            self.grid, self.jacobian, self.voltages_v, self.mesh_elements, self.electrode_fields
        )


def setup_for(skin: Skin, protocol: Scan, *, elements: int, pixels_across: int = 32) -> Setup:
    """Mesh, forward model, Jacobian.

    Raises:
        UsageError, GeometryError, ProtocolError, MissingExtraError: from those.
    """
    grid = grid_for(skin.outline, pixels_across)
    mesh = mesh_for_elements(skin, elements)
    forward = ForwardModel(mesh, skin, protocol)
    jacobian, voltages = sensitivity(forward, skin.conductivity_s_per_m, grid)
    fields = electrode_fields(forward, skin.conductivity_s_per_m, grid)
    return Setup(skin, protocol, grid, jacobian, voltages, fields, mesh.n_nodes, mesh.n_elements)
