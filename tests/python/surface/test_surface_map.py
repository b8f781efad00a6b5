"""The map from the flattened copy to the surface, and the section that stores it."""

from dataclasses import replace

import numpy as np
import pytest

from eitm_bytes import HEADER_SIZE
from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine
from eitskin.errors import ModelError
from eitskin.kinematics.pose import quaternion_xyzw
from eitskin.model.eitm import HEADER, decode_model, encode_model
from eitskin.surface.flatten import flattened
from eitskin.surface.section import decode_surface, encode_surface
from eitskin.surface.shapes import make_shape
from eitskin.surface.surface_map import SurfaceMap
from small_models import small_model

BALL_MM = 60.0


def surface(name, triangles=2000, link=""):
    points, faces = make_shape(name, triangles)
    return SurfaceMap(flattened(points, faces), points, faces, link)


@pytest.fixture(scope="module")
def ball():
    return surface("hemisphere", 4000, "palm")


def on_ball(flat_mm):
    """The stereographic copy's places on half a ball whose rim keeps its length."""
    radius = np.linalg.norm(flat_mm, axis=1)
    polar, turn = 2 * np.arctan(radius / BALL_MM), np.arctan2(flat_mm[:, 1], flat_mm[:, 0])
    outwards = [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]
    return np.column_stack(outwards), 2 / (1 + (radius / BALL_MM) ** 2)


def aligned(ball, flat_mm):
    """Turn ``flat_mm`` as the copy is turned against the ball."""
    first = ball.flat_mm[np.argmax(ball.points_mm[:, 0])]
    turn = np.arctan2(first[1], first[0])
    spin = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return flat_mm @ spin.T


def test_half_a_ball_is_mapped_stereographically(ball):
    flat = np.array([[0.0, 0.0], [20.0, 5.0], [-30.0, 10.0], [5.0, -45.0]])
    outwards, scale = on_ball(aligned(ball, flat))
    places = ball.at(flat)
    np.testing.assert_allclose(places.point_m * 1e3, BALL_MM * outwards, atol=0.1)
    np.testing.assert_allclose(places.normal, outwards, atol=2e-3)
    np.testing.assert_allclose(places.scale, scale, rtol=5e-3)
    first, second = np.moveaxis(places.tangents, 2, 0)
    np.testing.assert_allclose(np.cross(first, second), places.normal, atol=1e-12)
    back, away = ball.flat_of(places.point_m * 1e3 + 3.0 * places.normal)
    np.testing.assert_allclose(back, flat, atol=0.1)
    np.testing.assert_allclose(away, 3.0, atol=0.03)


def test_a_place_outside_takes_the_nearest_of_the_rim(ball):
    place = ball.at([[500.0, 0.0], [0.0, -61.0]])
    np.testing.assert_allclose(place.point_m[:, 2], 0.0, atol=1e-9)


def test_a_touch_comes_in_metres_with_its_covariance(ball):
    """The picture of a round touch on a ball is round on the copy, but around another middle."""
    middle, radius_mm = np.array([0.4, -0.3, 0.0]), 9.0
    middle[2] = np.sqrt(1 - middle @ middle)
    side = np.cross(middle, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    turn = np.linspace(0, 2 * np.pi, 32, endpoint=False)[:, None]
    angle = radius_mm / BALL_MM
    edge = np.cos(angle) * middle + np.sin(angle) * (
        np.cos(turn) * side + np.sin(turn) * np.cross(middle, side)
    )
    flat, _ = ball.flat_of(BALL_MM * edge)
    circle = np.linalg.lstsq(
        np.column_stack([2 * flat, np.ones(len(flat))]), (flat**2).sum(axis=1), rcond=None
    )[0]
    centre = circle[:2]
    radius = float(np.sqrt(circle[2] + centre @ centre))
    found = ball.touch(
        Touch(
            1,
            *centre.tolist(),
            radius,
            0.5,
            0.9,
            x_variance_mm2=0.04,
            xy_covariance_mm2=0.01,
            y_variance_mm2=0.09,
            long_x_mm=6.0,
            long_y_mm=0.0,
        )
    )
    np.testing.assert_allclose(found.point_m * 1e3, BALL_MM * middle, atol=0.05)
    assert np.linalg.norm(ball.at(centre[None]).point_m[0] * 1e3 - BALL_MM * middle) > 0.15
    assert found.radius_m * 1e3 == pytest.approx(radius_mm, rel=0.02)
    assert found.strength_s_m == pytest.approx(0.5e-6 * found.scale**2)
    assert found.covariance_m2 is not None and found.long_axis_m is not None
    shift = 0.5 * radius**2 * np.linalg.norm(ball.growth_per_mm(centre))
    spread = 0.13 + (0.6 * shift) ** 2  # of the place, and of the radius that moves the middle
    assert np.trace(found.covariance_m2) == pytest.approx(spread * 1e-6 * found.scale**2)
    np.testing.assert_allclose(found.covariance_m2 @ found.normal, 0.0, atol=1e-15)
    assert np.linalg.norm(found.long_axis_m) == pytest.approx(6e-3 * found.scale)
    x, y, z, w = quaternion_xyzw(np.column_stack([found.tangents, found.normal]))
    turned = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(turned, found.normal, atol=1e-12)
    assert ball.touch(Touch(1, 0.0, 0.0, 4.0, 0.5, 0.9)).covariance_m2 is None


@pytest.mark.parametrize("name", ["cylinder", "cone"])
def test_a_surface_that_unrolls_keeps_its_lengths(name):
    flat = surface(name)
    np.testing.assert_allclose(flat.scales, 1.0, atol=2e-4)
    assert flat.stretches[:, 0].max() < 1.001


def test_a_model_carries_its_surface(ball):
    model = replace(small_model(), surface=ball)
    blob = encode_model(model)
    assert HEADER.unpack_from(blob)[1:3] == (1, 12)
    assert HEADER.unpack_from(encode_model(small_model()))[2] < 12
    again = decode_model(blob, "x.eitm").surface
    assert again is not None and again.link == "palm"
    np.testing.assert_allclose(again.points_mm, ball.points_mm, atol=1e-5)
    np.testing.assert_array_equal(again.triangles, ball.triangles)
    assert CoreEngine(blob, "float32").n_rows == small_model().protocol.n_rows
    assert len(blob) > HEADER_SIZE


def test_a_damaged_section_is_refused(ball):
    whole = encode_surface(ball)
    swapped = bytearray(whole)
    swapped[8] = 0
    small = encode_surface(surface("saddle", 50))
    corners = bytearray(small)
    corners[-6:-2] = small[-4:-2] + small[-6:-4]  # the last triangle turns over
    infinite = bytearray(small)
    infinite[16:20] = b"\0\0\x80\x7f"
    for bad in (b"", whole[:-1], bytes(swapped), bytes(corners), bytes(infinite)):
        with pytest.raises(ModelError, match="section 'SURF'"):
            decode_surface(bad, "x.eitm")
