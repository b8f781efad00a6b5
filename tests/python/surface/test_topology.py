"""Surfaces that cannot be skins are refused with one line that says what is wrong."""

import numpy as np
import pytest

from eitskin.errors import GeometryError
from eitskin.surface.flatten import flattened
from eitskin.surface.shapes import SHAPES, make_shape
from eitskin.surface.topology import check_disk


def grid(rows=4, columns=5):
    """A flat rectangle of unit cells."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    row, column = np.divmod(np.arange(rows * columns), columns)
    a = row * (columns + 1) + column
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    return points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def tube():
    points, faces = grid(4, 12)
    wrapped = faces.copy()
    wrapped[wrapped % 13 == 12] -= 12
    angle = points[:, 0] * np.pi / 6
    points = np.column_stack([np.cos(angle), np.sin(angle), points[:, 1]])
    used, numbers = np.unique(wrapped, return_inverse=True)
    return points[used], numbers.reshape(wrapped.shape)


def closed():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    return points, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def without_area():
    points, faces = grid()
    points[faces[7, 1]] = points[faces[7, 0]]
    return points, faces


def doubled_wall():
    points, faces = grid()
    return np.vstack([points, [[1.5, 1.5, 1.0]]]), np.vstack([faces, [[7, 8, len(points)]]])


def turned_face():
    points, faces = grid()
    faces[3] = faces[3, ::-1]
    return points, faces


def two_pieces():
    points, faces = grid()
    return np.vstack([points, points + 10]), np.vstack([faces, faces + len(points)])


def pinched():
    points, faces = grid()
    other = faces + len(points) - 1
    return np.vstack([points, points[1:] + points[-1]]), np.vstack([faces, other])


def with_hole():
    points, faces = grid(6, 6)
    middle = (np.abs(points[faces].mean(axis=1)[:, :2] - 3.5) < 0.5).all(axis=1)
    return points, faces[~middle]


@pytest.mark.parametrize(
    "make, what",
    [
        (without_area, "has no area"),
        (doubled_wall, "3 triangles meet at the edge"),
        (turned_face, "face opposite sides"),
        (two_pieces, "2 pieces"),
        (pinched, "its rim touches itself at vertex"),
        (with_hole, "2 rims"),
        (tube, "2 rims"),
        (closed, "closed and has no rim"),
    ],
)
def test_what_is_no_disk_is_named(make, what):
    with pytest.raises(GeometryError, match=what) as caught:
        check_disk(*make(), "arm.obj")
    assert str(caught.value).startswith("arm.obj: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", SHAPES)
def test_the_shapes_are_disks_and_keep_their_rim(name):
    points, faces = make_shape(name, 600)
    check_disk(points, faces, name)
    flat = flattened(points, faces)
    true = np.linalg.norm(np.diff(points[_rim(faces)], axis=0), axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(flat[_rim(faces)], axis=0), axis=1), true, rtol=2e-3
    )


def _rim(faces):
    from eitskin.surface.topology import rim_loop

    return rim_loop(faces)
