"""Triangle meshes of a skin, refined at its electrodes. Netgen makes them in a separate process
(mesh_worker.py)."""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

import eitskin
from eitskin.arrays import AnyArray, FloatArray, IntArray
from eitskin.errors import GeometryError, UsageError, missing_extra
from eitskin.skin.skin import Skin
from eitskin.surface.surface_map import SurfaceMap

MIN_ELEMENTS = 200
MAX_ELEMENTS = 200_000
COUNT_TOLERANCE = 0.15


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh of linear triangles: ``nodes_mm`` (N, 2) and ``triangles`` (E, 3), counterclockwise.

    ``electrode_edges`` holds for each electrode the rim edges under it as (k, 2) nodes, in
    counterclockwise order; both ends of an electrode are nodes. Arrays are read-only.

    On a skin that covers a ``surface``, nodes are places of its flattened copy, and ``stretch``
    (E, 2, 2) takes each triangle to its true shape: the symmetric matrix whose square gives the
    lengths of the three-dimensional triangle. None is a flat skin.
    """

    nodes_mm: FloatArray
    triangles: IntArray
    electrode_edges: tuple[IntArray, ...]
    surface: SurfaceMap | None = None
    stretch: FloatArray | None = None

    @property
    def n_nodes(self) -> int:
        """The number of nodes, N."""
        return len(self.nodes_mm)

    @property
    def n_elements(self) -> int:
        """The number of triangles, E."""
        return len(self.triangles)

    @cached_property
    def areas_mm2(self) -> FloatArray:
        """The area of each triangle, (E,)."""
        u, v = (
            self.nodes_mm[self.triangles[:, k]] - self.nodes_mm[self.triangles[:, 0]]
            for k in (1, 2)
        )
        return np.asarray((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2)

    @cached_property
    def true_areas_mm2(self) -> FloatArray:
        """The area of each triangle on the surface, (E,); that on the plane for a flat skin."""
        if self.stretch is None:
            return self.areas_mm2
        return np.asarray(self.areas_mm2 * np.linalg.det(self.stretch))

    def centroids_mm(self) -> FloatArray:
        """Return the centre of area of each triangle, (E, 2)."""
        return np.asarray(self.nodes_mm[self.triangles].mean(axis=1))


def build_mesh(
    skin: Skin,
    *,
    max_size_mm: float,
    electrode_size_mm: float | None = None,
    timeout_s: float = 60.0,
) -> Mesh:
    """Mesh ``skin`` with edges of up to about ``max_size_mm``, and of ``electrode_size_mm`` on
    electrodes (default: a quarter of their width).

    The rim nodes of a disk lie on the circle. The same arguments give the same mesh.

    Raises:
        GeometryError: the mesher failed or took longer than ``timeout_s`` (it is then killed).
        UsageError: a size is not above 0, or so small that the mesh would be enormous.
        MissingExtraError: netgen is not installed.
    """
    size = electrode_size_mm
    if size is None:
        size = min(max_size_mm, skin.electrodes.width_mm / 4)
    if not (0 < max_size_mm < float("inf") and 0 < size < float("inf")):
        raise UsageError(f"mesh: sizes of {max_size_mm:g} and {size:g} mm; both must be above 0")
    outline = skin.outline
    if max(outline.area_mm2 / max_size_mm**2, outline.perimeter_mm / size) > MAX_ELEMENTS:
        raise UsageError(
            f"mesh: sizes of {max_size_mm:g} and {size:g} mm would give over {MAX_ELEMENTS}"
            " elements; use larger ones"
        )
    pieces, owner = _rim_pieces(skin, max_size_mm, min(size, max_size_mm))
    arrays = run_mesher({"max_size": max_size_mm, "pieces": pieces}, timeout_s, skin.name)
    return _checked_mesh(skin, arrays, owner)


def mesh_for_elements(skin: Skin, elements: int = 3000) -> Mesh:
    """Return a mesh of about ``elements`` triangles: within 15 %, or the closest of four attempts
    if the electrodes need more.

    Raises:
        UsageError: ``elements`` is not within 200 to 200,000.
        GeometryError, MissingExtraError: as ``build_mesh``.
    """
    if not MIN_ELEMENTS <= elements <= MAX_ELEMENTS:
        raise UsageError(
            f"mesh: {elements} elements is out of range; use {MIN_ELEMENTS} to {MAX_ELEMENTS}"
        )
    aim, best = float(elements), None
    for _ in range(4):
        max_size_mm = _size_for(skin, aim)
        electrode_size_mm = _electrode_size(skin, max_size_mm)
        mesh = build_mesh(skin, max_size_mm=max_size_mm, electrode_size_mm=electrode_size_mm)
        if best is None or abs(mesh.n_elements - elements) < abs(best.n_elements - elements):
            best = mesh
        if abs(mesh.n_elements - elements) <= COUNT_TOLERANCE * elements:
            return mesh
        aim *= elements / mesh.n_elements
    assert best is not None
    return best


def run_mesher(request: dict[str, Any], timeout_s: float, name: str) -> list[AnyArray]:
    """Run mesh_worker.py on ``request`` for the skin ``name``, and return its four arrays.

    Raises:
        GeometryError: the mesher failed, or took longer than ``timeout_s`` and was killed.
        MissingExtraError: netgen is not installed.
    """
    if importlib.util.find_spec("netgen") is None:
        raise missing_extra("model", "netgen-mesher")
    package_root = str(Path(eitskin.__file__).parents[1])
    path = os.pathsep.join(filter(None, [package_root, os.environ.get("PYTHONPATH")]))
    with tempfile.TemporaryDirectory(prefix="eitskin-mesh-") as folder:
        reply = Path(folder) / "mesh"
        try:
            done = subprocess.run(
                [sys.executable, "-m", "eitskin.fem.mesh_worker", str(reply)],
                input=json.dumps(request).encode(),
                capture_output=True,
                timeout=timeout_s,
                cwd=folder,
                env={**os.environ, "PYTHONPATH": path},
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise GeometryError(
                f"skin {name!r}: meshing took longer than {timeout_s:g} s and was stopped; simplify"
                " the outline, use a larger element size or allow more time"
            ) from None
        if done.returncode != 0:
            output = done.stderr.decode(errors="replace").strip().splitlines()
            why = output[-1] if output else f"exit status {done.returncode}"
            raise GeometryError(f"skin {name!r}: the mesher failed ({why}); simplify the outline")
        with reply.open("rb") as arrays:
            return [np.load(arrays) for _ in range(4)]


def _rim_pieces(
    skin: Skin, max_size_mm: float, electrode_size_mm: float
) -> tuple[list[list[Any]], IntArray]:
    """Cut the rim at the ends of electrodes and at corners. Return the pieces in the form that
    mesh_worker.py reads, and the electrode of each piece or -1, (k,)."""
    outline, perimeter = skin.outline, skin.outline.perimeter_mm
    spans = skin.electrode_spans_mm()
    corners = outline.corner_arc_lengths_mm()
    cuts = np.mod(spans.ravel(), perimeter)
    if len(corners):
        # The end of an electrode is moved to a corner that is closer than a thousandth of its
        # width.
        away = np.mod(cuts[:, None] - corners[None, :] + perimeter / 2, perimeter) - perimeter / 2
        nearest = np.argmin(np.abs(away), axis=1)
        snapped = np.abs(away[np.arange(len(cuts)), nearest]) < 1e-3 * skin.electrodes.width_mm
        cuts = np.unique(np.concatenate([corners, cuts[~snapped]]))
    else:
        cuts = _without_long_arcs(np.unique(cuts), perimeter)
    ends = np.append(cuts[1:], cuts[0] + perimeter)
    middles = (cuts + ends) / 2
    inside = np.mod(middles[:, None] - spans[None, :, 0], perimeter) < skin.electrodes.width_mm
    owner = np.where(inside.any(axis=1), inside.argmax(axis=1), -1)
    points = outline.points_at(cuts)
    controls: list[list[float] | None] = [None] * len(cuts)
    if outline.diameter_mm is not None:
        radius = outline.diameter_mm / 2
        stretch = 1 / np.cos((ends - cuts) / (2 * radius))
        controls = (outline.points_at(middles) * stretch[:, None]).tolist()
    sizes = np.where(owner >= 0, electrode_size_mm, max_size_mm)
    return [
        [x, y, c, s] for (x, y), c, s in zip(points.tolist(), controls, sizes.tolist(), strict=True)
    ], owner


def _without_long_arcs(cuts: FloatArray, perimeter: float) -> FloatArray:
    """Return ``cuts`` of a circle, with more cuts between two that are over a quarter of it apart:
    the tangents at the ends of a long arc do not meet."""
    arcs = np.append(cuts[1:], cuts[0] + perimeter) - cuts
    parts = np.ceil(arcs / (perimeter / 4)).astype(int)
    more = [
        cut + arc * k / count
        for cut, arc, count in zip(cuts, arcs, parts, strict=True)
        for k in range(1, count)
    ]
    return np.unique(np.mod([*cuts, *more], perimeter))


def _checked_mesh(skin: Skin, arrays: list[AnyArray], owner: IntArray) -> Mesh:
    nodes, triangles, edges, piece = arrays
    electrode = owner[piece]
    electrode_edges = tuple(_chained(edges[electrode == k]) for k in range(skin.electrodes.count))
    for array in (nodes, triangles, *electrode_edges):
        array.flags.writeable = False
    mesh = Mesh(nodes, triangles, electrode_edges)
    if skin.surface is not None:
        mesh = lifted(mesh, skin.surface)
    area = float(mesh.areas_mm2.sum())
    if not (
        len(triangles) and mesh.areas_mm2.min() > 0 and abs(area / skin.outline.area_mm2 - 1) < 0.05
    ):
        raise GeometryError(
            f"skin {skin.name!r}: the mesh does not fill the outline ({area:g} of"
            f" {skin.outline.area_mm2:g} mm2); use a smaller element size"
        )
    if len(np.unique(triangles)) != len(nodes) or min(len(e) for e in electrode_edges) < 1:
        raise GeometryError(
            f"skin {skin.name!r}: the mesh has loose nodes or bare electrodes; use a smaller size"
        )
    return mesh


def lifted(mesh: Mesh, surface: SurfaceMap) -> Mesh:
    """Return ``mesh`` of a flattened copy with the lengths that its triangles have if their corners
    are put on ``surface``."""
    points = 1e3 * surface.at(mesh.nodes_mm).point_m
    jacobian = 1e-3 * np.einsum("eka,ekd->ead", points[mesh.triangles], flat_gradients(mesh))
    square = np.einsum("eab,ead->ebd", jacobian, jacobian)
    # the root of a symmetric 2 x 2 matrix, by the theorem of Cayley and Hamilton
    root = np.sqrt(np.maximum(np.linalg.det(square), 0.0))[:, None, None]
    trace = np.trace(square, axis1=1, axis2=2)[:, None, None]
    stretch = (square + root * np.eye(2)) / np.sqrt(trace + 2 * root)
    stretch.flags.writeable = False
    return Mesh(mesh.nodes_mm, mesh.triangles, mesh.electrode_edges, surface, stretch)


def flat_gradients(mesh: Mesh) -> FloatArray:
    """Return the gradients of the three hat functions of each triangle on the plane, (E, 3, 2) in
    1/m."""
    corners = mesh.nodes_mm[mesh.triangles]
    opposite = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
    turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1)
    return np.asarray(turned * (1e3 / (2 * mesh.areas_mm2))[:, None, None])


def _chained(edges: IntArray) -> IntArray:
    """Return ``edges`` (k, 2) in an order in which each edge begins where the one before ends."""
    follower = {int(a): int(b) for a, b in edges}
    node = next(iter(set(follower) - set(follower.values())), None)
    chain = []
    while node in follower:
        chain.append((node, follower[node]))
        node = follower.pop(node)
    return np.array(chain, dtype=np.int64).reshape(-1, 2)


def _electrode_size(skin: Skin, max_size_mm: float) -> float:
    """Return the edge length on electrodes: a quarter of an electrode's width, less if the whole
    mesh is fine, more if it is very coarse."""
    coarse = sqrt(skin.outline.area_mm2) / 24
    return min(skin.electrodes.width_mm / 4 * max(1.0, max_size_mm / coarse), max_size_mm / 3)


def _expected_elements(skin: Skin, max_size_mm: float) -> float:
    """Estimate how many elements netgen makes: the integral of 1 / size^2, where the size grows
    with the distance from an electrode.

    The integral is taken over one electrode's part of the skin, approximated by a rectangle at the
    rim. Slope and density were fitted to netgen's counts.
    """
    growth, density, points = 0.3, 2.2, 40
    along = skin.outline.perimeter_mm / skin.electrodes.count / 2
    deep = skin.outline.area_mm2 / skin.outline.perimeter_mm
    u = (np.arange(points) + 0.5) / points
    weight = 3 * u**2 / points
    beyond = np.maximum(along * u**3 - skin.electrodes.width_mm / 2, 0.0)
    size = _electrode_size(skin, max_size_mm) + growth * np.hypot(
        beyond[:, None], deep * u[None, :] ** 3
    )
    per_area = weight @ np.minimum(size, max_size_mm) ** -2.0 @ weight
    return density * skin.outline.area_mm2 * float(per_area)


def _size_for(skin: Skin, elements: float) -> float:
    """Return the maximum size for which ``elements`` are expected, by bisection."""
    low = sqrt(skin.outline.area_mm2 / elements) / 10
    high = sqrt(skin.outline.area_mm2)
    for _ in range(24):
        middle = sqrt(low * high)
        low, high = (middle, high) if _expected_elements(skin, middle) > elements else (low, middle)
    return high
