"""Check that a triangulation can be a skin: one piece, a disk, triangles with an area."""

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import GeometryError

SLIVER = 1e-7  # least doubled area of a triangle over the square of its longest side


def check_disk(points_mm: FloatArray, triangles: IntArray, where: str) -> None:
    """Reject a surface that is not a disk in the sense of topology; ``where`` names it in errors.

    Raises:
        GeometryError: a triangle has no area, an edge belongs to more than two triangles,
            neighbours face opposite sides, or the surface is closed, in pieces, pinched, or has
            holes.
    """
    corners = points_mm[triangles]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    doubled = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    bad = np.flatnonzero(~(doubled > SLIVER * sides**2))
    if len(bad):
        raise GeometryError(
            f"{where}: triangle {bad[0]} (from 0) has no area, as {len(bad)} of {len(triangles)};"
            " remove degenerate triangles in a mesh editor"
        )
    _check_edges(triangles, where)
    pieces = count_pieces(triangles)
    if pieces > 1:
        raise GeometryError(
            f"{where}: it is in {pieces} pieces that share no edge; a skin is one piece, so keep"
            " one, or join them"
        )
    begin, end = rim_edges(triangles)
    if not len(begin):
        raise GeometryError(
            f"{where}: it is closed and has no rim; electrodes sit at a rim, so cut it open"
        )
    if len(np.unique(begin)) < len(begin):
        raise GeometryError(
            f"{where}: its rim touches itself at vertex {_first_repeated(begin)} (from 0); separate"
            " the two sides there"
        )
    loops = _loop_lengths(points_mm, begin, end)
    if len(loops) > 1:
        raise GeometryError(
            f"{where}: it has {len(loops)} rims (lengths {', '.join(f'{x:.4g}' for x in loops)}"
            " mm): a skin has no holes and is not an open tube; close holes, cut a tube lengthwise"
        )
    handles = 1 - len(np.unique(triangles)) + _count_edges(triangles) - len(triangles)
    if handles:
        raise GeometryError(
            f"{where}: it has a handle, like a cup's; a skin must be a disk, so cut it there"
        )


def rim_edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return where the edges of only one triangle begin and end, (B,) each."""
    begin, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    count = int(triangles.max()) + 1
    lone = ~np.isin(begin * count + end, end * count + begin)
    return begin[lone], end[lone]


def rim_loop(triangles: IntArray) -> IntArray:
    """Return the vertices of the one rim in order, with the surface to the left, (B,)."""
    begin, end = rim_edges(triangles)
    follower = dict(zip(begin.tolist(), end.tolist(), strict=True))
    start = int(begin.min())
    loop = [start]
    while (after := follower[loop[-1]]) != start:
        loop.append(after)
    return np.array(loop, dtype=np.int64)


def count_pieces(triangles: IntArray) -> int:
    """Return the number of parts that share no vertex."""
    label = np.arange(int(triangles.max()) + 1)
    while True:
        least = label[triangles].min(axis=1)
        following = label.copy()
        for k in range(3):
            np.minimum.at(following, triangles[:, k], least)
        following = following[following]
        if (following == label).all():
            return len(np.unique(label[triangles]))
        label = following


def _check_edges(triangles: IntArray, where: str) -> None:
    begin, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    count = int(triangles.max()) + 1
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    _, first, uses = np.unique(low * count + high, return_index=True, return_counts=True)
    if uses.max() > 2:
        edge = first[int(np.argmax(uses))]
        raise GeometryError(
            f"{where}: {uses.max()} triangles meet at the edge of vertices {low[edge]} and"
            f" {high[edge]} (from 0); at most two may, so remove inner walls or doubled faces"
        )
    _, first, ways = np.unique(begin * count + end, return_index=True, return_counts=True)
    if ways.max() > 1:
        edge = first[int(np.argmax(ways))]
        raise GeometryError(
            f"{where}: two triangles at the edge of vertices {low[edge]} and {high[edge]} (from 0)"
            " face opposite sides; make the normals agree in a mesh editor"
        )


def _count_edges(triangles: IntArray) -> int:
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    )
    return len(np.unique(edges, axis=0))


def _first_repeated(values: IntArray) -> int:
    kept, counts = np.unique(values, return_counts=True)
    return int(kept[np.argmax(counts > 1)])


def _loop_lengths(points_mm: FloatArray, begin: IntArray, end: IntArray) -> list[float]:
    """Return the lengths of the rims in mm, the longest first."""
    follower = dict(zip(begin.tolist(), end.tolist(), strict=True))
    lengths = []
    while follower:
        start, node = next(iter(follower.items()))
        chain = [start]
        while node != start:
            chain.append(node)
            node = follower.pop(node)
        follower.pop(start)
        places = points_mm[chain]
        lengths.append(float(np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=1).sum()))
    return sorted(lengths, reverse=True)
