"""Outlines: exact disks, polygons either way round, and those that cannot be."""

from math import cos, hypot, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eitskin.errors import GeometryError
from eitskin.skin.outline import disk, polygon

L_SHAPE = [(0, 0), (100, 0), (100, 30), (30, 30), (30, 100), (0, 100)]


def test_disk_is_exact():
    outline = disk(194.0)
    assert outline.perimeter_mm == pytest.approx(194 * pi, rel=1e-15)
    assert outline.area_mm2 == pytest.approx(97**2 * pi, rel=1e-15)
    assert outline.bounding_box_mm == (-97, -97, 97, 97)
    assert outline.centre_mm == (0, 0)
    points = outline.points_at(np.linspace(0, 2000, 333))
    assert np.abs(np.hypot(*points.T) - 97).max() < 1e-12
    assert outline.point_at(outline.arc_length_at_angle(90)) == pytest.approx((0, 97))
    assert outline.contains([(96.99, 0), (68.58, 68.58)]).all()
    assert not outline.contains([(97.01, 0), (68.6, 68.6)]).any()
    assert outline.corner_arc_lengths_mm().size == 0


def test_polygon_measures():
    outline = polygon(L_SHAPE)
    assert outline.diameter_mm is None
    assert outline.perimeter_mm == pytest.approx(400)
    assert outline.area_mm2 == pytest.approx(5100)
    assert outline.bounding_box_mm == (0, 0, 100, 100)
    assert outline.corner_arc_lengths_mm().tolist() == [0, 100, 130, 200, 270, 300]
    assert outline.point_at(0) == (0, 0)
    for arc, place in ((115, (100, 15)), (400 + 115, (100, 15)), (-10, (0, 10))):
        assert outline.point_at(arc) == pytest.approx(place)
    inside = [(10, 10), (90, 10), (10, 90), (29, 31)]
    outside = [(50, 50), (-1, 10), (31, 31)]
    assert outline.contains(inside).all() and not outline.contains(outside).any()


def test_centre_of_area_and_of_a_concave_outline():
    assert polygon([(10, 10), (30, 10), (30, 20), (10, 20)]).centre_mm == pytest.approx((20, 15))
    outline = polygon(L_SHAPE)
    # The centre of area (35.6, 35.6) lies outside; the centre is the middle of the arm at that
    # height.
    assert outline.contains([outline.centre_mm])[0]
    assert outline.centre_mm == pytest.approx((15, 35.588235))
    for angle in range(0, 360, 7):
        x, y = outline.point_at(outline.arc_length_at_angle(angle))
        dx, dy = x - outline.centre_mm[0], y - outline.centre_mm[1]
        assert dx * sin(radians(angle)) - dy * cos(radians(angle)) == pytest.approx(0, abs=1e-9)
        assert dx * cos(radians(angle)) + dy * sin(radians(angle)) > 0


def test_ray_takes_the_furthest_crossing_and_corners():
    notched = polygon([(-50, -50), (50, -50), (50, 50), (10, 50), (0, 10), (-10, 50), (-50, 50)])
    square = polygon([(-50, -50), (50, -50), (50, 50), (-50, 50)])
    assert square.point_at(square.arc_length_at_angle(45)) == pytest.approx((50, 50))
    assert square.point_at(square.arc_length_at_angle(-90)) == pytest.approx((0, -50))
    assert notched.point_at(notched.arc_length_at_angle(90))[1] == pytest.approx(10)
    spiral = polygon(
        [(-50, -50), (60, -50), (60, 60), (-20, 60), (-20, 40), (40, 40), (40, -30), (-50, -30)]
    )
    x, y = spiral.point_at(spiral.arc_length_at_angle(180))
    assert spiral.contains([spiral.centre_mm])[0]
    assert x <= spiral.centre_mm[0] and y == pytest.approx(spiral.centre_mm[1])


def test_clockwise_is_turned_and_a_closing_point_dropped():
    forward = polygon(L_SHAPE)
    backward = polygon(L_SHAPE[::-1])
    closed = polygon([*L_SHAPE, L_SHAPE[0]])
    assert closed == forward
    assert backward.area_mm2 == pytest.approx(5100)
    assert set(backward.vertices_mm) == set(forward.vertices_mm)
    start = backward.vertices_mm.index(forward.vertices_mm[0])
    assert backward.vertices_mm[start:] + backward.vertices_mm[:start] == forward.vertices_mm


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        ([(0, 0), (10, 10), (10, 0), (0, 10)], "crosses or touches itself, edge 0 with edge 2"),
        ([(0, 0), (20, 0), (20, 20), (10, 0), (0, 20)], "crosses or touches itself"),
        ([(0, 0), (10, 0), (5, 0), (5, 10)], "folds back on itself at point 1"),
        ([(0, 0), (10, 0), (10, 0), (0, 10)], "points 1 and 2 .* are the same"),
        ([(0, 0), (10, 0)], "2 different points"),
        ([(0, 0), (10, 0), (0, 0)], "2 different points"),
        ([(0, 0), (0.1, 0), (0, 0.1)], "out of range"),
        ([(0, 0), (1e7, 0), (0, 1e7)], "out of range"),
        ([(0, 0), (10, float("nan")), (0, 10)], "point 1 .* not finite"),
        ([(0, 0), (1000, 999.9), (1000, 1000)], "too small for its size"),
    ],
)
def test_refused_polygons(vertices, message):
    with pytest.raises(GeometryError, match=message) as caught:
        polygon(vertices)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("diameter", [0.0, -5.0, 0.5, 1e6, float("nan"), float("inf")])
def test_refused_disks(diameter):
    with pytest.raises(GeometryError, match="diameter_mm"):
        disk(diameter)


@settings(max_examples=60, deadline=None)
@given(
    radii=st.lists(st.floats(5, 50), min_size=3, max_size=40),
    turn=st.floats(0, 6.28),
    clockwise=st.booleans(),
)
def test_any_star_shaped_outline(radii, turn, clockwise):
    angles = [turn + 2 * pi * k / len(radii) for k in range(len(radii))]
    points = [(r * cos(a), r * sin(a)) for r, a in zip(radii, angles, strict=True)]
    outline = polygon(points[::-1] if clockwise else points)
    edges = [np.array(edge) for edge in zip(points, points[1:] + points[:1], strict=True)]
    shoelace = sum(float(np.linalg.det(edge)) for edge in edges) / 2
    assert outline.area_mm2 == pytest.approx(shoelace, rel=1e-9)
    assert outline.contains([outline.centre_mm])[0]
    assert outline.perimeter_mm == pytest.approx(sum(hypot(*(b - a)) for a, b in edges))
    for s in np.linspace(0, outline.perimeter_mm, 11):
        x, y = outline.point_at(float(s))
        # Star-shaped about the origin: just below a rim point is inside, just beyond it is not.
        found = outline.contains([(0.999 * x, 0.999 * y), (1.001 * x, 1.001 * y)]).tolist()
        assert found == [True, False]
