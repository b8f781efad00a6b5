"""The mesher's own process: a rim as JSON on stdin, the mesh's arrays in the file named on the
command line.

Netgen can loop for ever on an outline it dislikes, so it runs where it can be killed.
``eitskin.fem.mesh`` starts this module and knows the request's and the reply's form; netgen brings
numpy along, and nothing else is imported.
"""

import json
import sys
from typing import Any

import numpy as np


def mesh_arrays(request: dict[str, Any]) -> list[np.ndarray[Any, Any]]:
    """Mesh the region left of the rim's pieces; returns nodes (N, 2), triangles (E, 3), edges (B,
    2), edge pieces (B,).

    ``request`` holds ``max_size`` and ``pieces``, a list that closes on itself of [x, y, control,
    size]: a piece runs from (x, y) to the next one's, straight where ``control`` is null, else as
    the circular arc whose end tangents meet in ``control`` [x, y]; no edge on it is longer than
    ``size``.
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
    """Read the request from stdin, write the arrays to ``path`` one after another."""
    arrays = mesh_arrays(json.load(sys.stdin))
    with open(path, "wb") as reply:  # noqa: PTH123 - pathlib would only add to the start-up
        for array in arrays:
            np.save(reply, array)


if __name__ == "__main__":
    main(sys.argv[1])
