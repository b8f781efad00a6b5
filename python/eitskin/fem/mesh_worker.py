"""The process that runs the mesher. It reads a rim as JSON from stdin and writes the arrays of the
mesh to the file named on the command line.

Netgen can loop forever on an outline that it cannot mesh, so it runs in a process that can be
killed. ``eitskin.fem.mesh`` starts this module and uses the same request and reply. Only netgen is
imported, which itself needs numpy.
"""

import json
import sys
from typing import Any

import numpy as np


def mesh_arrays(request: dict[str, Any]) -> list[np.ndarray[Any, Any]]:
    """Mesh the region to the left of the rim's pieces; return nodes (N, 2), triangles (E, 3), edges
    (B, 2) and the piece of each edge (B,).

    ``request`` holds ``max_size`` and ``pieces``, a closed list of [x, y, control, size]. A piece
    runs from its (x, y) to that of the next piece. It is straight if ``control`` is null; otherwise
    it is the circular arc whose end tangents meet in ``control`` [x, y]. No edge on the piece is
    longer than ``size``.
    """
    from netgen.geom2d import SplineGeometry

    pieces = request["pieces"]
    geometry = SplineGeometry()
    corners = [geometry.AppendPoint(x, y) for x, y, _, _ in pieces]
    for k, (_, _, control, size) in enumerate(pieces):
        begin, end = corners[k], corners[(k + 1) % len(corners)]
        shape = (
            ["line", begin, end]
            if control is None
            else ["spline3", begin, geometry.AppendPoint(*control), end]
        )
        geometry.Append(shape, leftdomain=1, rightdomain=0, bc=k + 1, maxh=size)
    mesh = geometry.GenerateMesh(maxh=request["max_size"])
    triangles, edges = mesh.Elements2D().NumPy(), mesh.Elements1D().NumPy()
    return [
        np.ascontiguousarray(mesh.Coordinates()[:, :2], dtype=np.float64),
        np.ascontiguousarray(triangles["nodes"][:, :3], dtype=np.int64) - 1,
        np.ascontiguousarray(edges["nodes"][:, :2], dtype=np.int64) - 1,
        np.ascontiguousarray(edges["index"], dtype=np.int64) - 1,
    ]


def main(path: str) -> None:
    """Read the request from stdin and write the arrays to ``path``, one after another."""
    arrays = mesh_arrays(json.load(sys.stdin))
    with open(path, "wb") as reply:  # noqa: PTH123 - pathlib would only add to the start-up
        for array in arrays:
            np.save(reply, array)


if __name__ == "__main__":
    main(sys.argv[1])
