"""The scenes of the study of surfaces: touches lie apart in space, and the forearm's pose keeps the
skin's places."""

import numpy as np
import pytest

from eitskin.surface.shapes import flexed_forearm
from eitskin_studies.experiments.surfaces import _cap, _many_table, _scored
from eitskin_studies.experiments.surfaces.scenes import (
    GAP_MM,
    MARGIN_MM,
    draw_touches,
    flat_map,
    on_copy,
    same_on,
    shape_map,
    size_of,
    skin_on,
)


def test_touches_lie_apart_and_off_the_rim():
    surface = shape_map("hemisphere", 600)
    size = size_of(surface)
    for scene in draw_touches(surface, 1, "test", 10):
        points = np.array([one.point_mm for one in scene])
        assert (
            surface.rim_places(points)[1] >= [t.radius_mm + size * MARGIN_MM for t in scene]
        ).all()
        for k, one in enumerate(scene):
            for other in scene[:k]:
                away = np.linalg.norm(one.point_mm - other.point_mm)
                assert away >= one.radius_mm + other.radius_mm + size * GAP_MM
        for one, flat in zip(scene, on_copy(surface, scene), strict=True):
            back = 1e3 * surface.at([[flat.x_mm, flat.y_mm]]).point_m[0]
            np.testing.assert_allclose(back, one.point_mm, atol=1e-6)


def test_another_mesh_has_its_electrodes_at_the_same_points():
    coarse, fine = shape_map("forearm", 600), shape_map("forearm", 2000)
    skin = skin_on("forearm", coarse)
    points = [
        1e3 * surface.at(one.electrode_centres_mm()).point_m
        for one, surface in ((skin, coarse), (same_on("forearm", fine, skin), fine))
    ]
    assert np.linalg.norm(points[0] - points[1], axis=1).max() < 0.7  # sagitta of the coarse rim


def test_scores_count_misses_and_the_flat_copy_keeps_the_places():
    surface = flat_map(shape_map("cylinder", 600))
    drawn = draw_touches(surface, 1, "test", 3)
    score = _scored(drawn, [(), (), ()], surface)
    assert score["exact"] == 0 and score["median_mm"] is None
    assert size_of(surface) == pytest.approx(1.0, abs=0.01)


def test_a_flexed_forearm_is_longer_around_and_a_deep_cap_has_a_great_scale():
    rest, flexed = (flexed_forearm(600, bulge)[0] for bulge in (6.0, 12.0))
    assert 4 < np.linalg.norm(flexed - rest, axis=1).max() < 8
    assert _cap(60)["scale"] == pytest.approx(2 / (1 + np.cos(np.radians(60))), rel=0.02)


def test_ratios_of_medians_over_the_size_have_intervals():
    """The forearm is twice as large, and its errors are three times the flat disk's."""
    counts = {"exact": 9, "scenes": 10, "median_mm": 0.1}
    errors = np.linspace(0.05, 0.15, 41)
    bounds = {"adjacent": errors.tolist(), "opposite": np.full(41, 0.1).tolist()}
    flat = {**counts, "size": 1.0, "far_mm": errors.tolist(), "bounds_mm": bounds}
    wide = {kind: [3 * value for value in values] for kind, values in bounds.items()}
    forearm = {**counts, "size": 2.0, "far_mm": wide["adjacent"], "bounds_mm": wide}
    first, second = _many_table({"flat disk": flat, "forearm": forearm}).rows
    assert first[2] == "41" and first[4:] == ("", "", "")
    low, high = (float(word) for word in second[4][6:-1].split(" to "))
    assert second[4].startswith("1.50 (") and 1.0 < low < 1.5 < high < 2.0
    assert second[5] == second[4] and second[6] == "1.50 (1.50 to 1.50)"
