"""Deform a mesh: move its nodes so that electrodes and rim lie elsewhere, without meshing again.

The nodes of the rim are displaced along it and outwards. Inside, each coordinate of the
displacement is harmonic, so it is smooth and decays with the distance from the rim, for any
outline.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import missing_extra
from eitskin.fem.cem import factorise
from eitskin.fem.mesh import Mesh, flat_gradients

try:
    from scipy.sparse import csc_matrix
except ModuleNotFoundError as error:
    raise missing_extra("model", "scipy") from error


LEAST_PART = 0.5  # the least fraction of its length that an electrode or a gap keeps
LEAST_AREA = 0.2  # the least fraction of its area that an element keeps
HALVINGS = 12
# standard deviation with which the rim's direction is smoothed, over the radius of the disk of
# equal area
SMOOTHING = 0.1


@dataclass(frozen=True, eq=False)
class Rim:
    """The rim of a mesh: ``nodes`` (B,) counterclockwise, ``arc_mm`` (B,) their arc lengths from
    the first node, and ``length_mm`` the length of the rim."""

    nodes: IntArray
    arc_mm: FloatArray
    length_mm: float


def rim_of(mesh: Mesh) -> Rim:
    """Return the rim of ``mesh``: the edges that belong to only one triangle."""
    t = mesh.triangles
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, first, count = np.unique(low * mesh.n_nodes + high, return_index=True, return_counts=True)
    follower = dict(edges[first[count == 1]].tolist())
    start = int(mesh.electrode_edges[0][0, 0])
    chain = [start]
    while (after := follower[chain[-1]]) != start:
        chain.append(after)
    places = mesh.nodes_mm[chain]
    steps = np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=1)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    return Rim(np.array(chain, dtype=np.int64), arc[:-1], float(arc[-1]))


class MeshDeformation:
    """Moves the nodes of one mesh. Whatever does not depend on the displacement is computed
    once."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self.rim = mesh, rim_of(mesh)
        place = np.full(mesh.n_nodes, -1.0)
        place[self.rim.nodes] = self.rim.arc_mm
        self._spans_mm = place[[[e[0, 0], e[-1, 1]] for e in mesh.electrode_edges]]

    @cached_property
    def _inner(self) -> tuple[IntArray, Any, csc_matrix]:
        """The inner nodes, the factors of Laplace's matrix on them, and the part of that matrix
        that couples them to the rim's nodes."""
        mesh = self.mesh
        gradients = flat_gradients(mesh) * np.sqrt(mesh.areas_mm2)[:, None, None]
        values = np.einsum("eik,ejk->eij", gradients, gradients)
        rows, columns = np.repeat(mesh.triangles, 3, axis=1), np.tile(mesh.triangles, (1, 3))
        whole = csc_matrix(
            (values.ravel(), (rows.ravel(), columns.ravel())), shape=(mesh.n_nodes, mesh.n_nodes)
        )
        inside = np.setdiff1d(np.arange(mesh.n_nodes), self.rim.nodes)
        below = whole[inside]
        return inside, factorise(below[:, inside].tocsc()), below[:, self.rim.nodes].tocsc()

    @cached_property
    def _tangent(self) -> FloatArray:
        """The smoothed direction of the rim at each of its nodes, (B, 2). It is shorter than 1
        where the rim bends sharply, so that displacements along or across the rim stay smooth."""
        rim = self.rim
        places = self.mesh.nodes_mm[rim.nodes]
        steps = np.roll(places, -1, axis=0) - places
        length = np.linalg.norm(steps, axis=1)
        middles = rim.arc_mm + length / 2
        apart = np.mod(rim.arc_mm[:, None] - middles + rim.length_mm / 2, rim.length_mm)
        sd = SMOOTHING * np.sqrt(self.mesh.areas_mm2.sum() / np.pi)
        weight = np.exp(-0.5 * ((apart - rim.length_mm / 2) / sd) ** 2)
        # the mean is taken over the edges as vectors, so that each edge counts by its length
        return np.asarray(weight @ steps / (weight @ length)[:, None])

    def moved(self, shift_mm: FloatArray, widths: FloatArray, outwards_mm: FloatArray) -> Mesh:
        """Return the mesh with each electrode moved along the rim by ``shift_mm`` (L,), its width
        multiplied by ``widths`` (L,), and the rim's nodes moved outwards by ``outwards_mm`` (B,).

        Elements keep their stretch: places of a surface move as those of its flattened copy.
        If electrodes would meet or an element would turn over, all displacements are reduced.
        """
        rim, mesh = self.rim, self.mesh
        along = self._along(shift_mm, widths)
        tangent = self._tangent
        outward = np.column_stack([tangent[:, 1], -tangent[:, 0]])
        step = along[:, None] * tangent + outwards_mm[:, None] * outward
        inside, factors, to_rim = self._inner
        movement = np.zeros_like(mesh.nodes_mm)
        movement[rim.nodes] = step
        movement[inside] = factors.solve(-(to_rim @ step))
        for _ in range(HALVINGS):
            candidate = replace(mesh, nodes_mm=mesh.nodes_mm + movement, surface=None)
            if (candidate.areas_mm2 >= LEAST_AREA * mesh.areas_mm2).all():
                return candidate
            movement *= 0.5
        return mesh

    def _along(self, shift_mm: FloatArray, widths: FloatArray) -> FloatArray:
        """Return how far each node of the rim slides along it, (B,): linear between the ends of
        electrodes."""
        length = self.rim.length_mm
        begin, end = self._spans_mm.T
        width = np.mod(end - begin, length)
        grow = width * (widths - 1) / 2
        ends = np.column_stack([begin, begin + width]).ravel()
        slide = np.column_stack([shift_mm - grow, shift_mm + grow]).ravel()
        ends = np.mod(ends, length)
        order = np.argsort(ends, kind="stable")
        ends, slide = ends[order], slide[order]
        pieces = np.append(ends[1:], ends[0] + length) - ends
        shorter = slide - np.append(slide[1:], slide[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(shorter > 0, (1 - LEAST_PART) * pieces / shorter, np.inf)
        part = min(1.0, float(room.min()))
        return np.interp(self.rim.arc_mm, ends, slide * part, period=length)
