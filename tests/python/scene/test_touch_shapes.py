"""Shapes and laws of touches, and changes after the tare: what they make of a sheet, and cost."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scene_helpers import still_scene

from eitskin.errors import ConfigError
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.scene.compiler import compile_scene
from eitskin.scene.cover import Cover
from eitskin.scene.description import Scene, scene_from_table
from eitskin.scene.laws import Insulating, PressAndConduct
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.runner import run_scene, simulate_frames
from eitskin.scene.touch_shape import SHAPES, TouchShape, named_shape
from eitskin.skin.skin import paper_skin


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return mesh_for_elements(paper_skin(), 5000)


def _scene(*touches: dict[str, Any], **head: Any) -> Scene:
    table = {"scene": {"elements": 600, "quiet_frames": 2, **head}, "touch": list(touches)}
    return scene_from_table(table, "test", Path())


@pytest.mark.parametrize(
    ("shape", "share"),
    [
        (TouchShape(), 1.0),
        (named_shape("ellipse", 2.2, 40.0), 1.0),
        (named_shape("finger", angle_deg=120.0), 2 / 3),
        (named_shape("hertz"), 2 / 3),
        (named_shape("gauss"), (1 - 2**-6.25) / math.log(2)),
    ],
)
def test_a_shape_changes_its_share_of_the_discs_area(mesh, shape, share):
    found = Cover(mesh).change([TrueTouch(5.0, -12.0, 12.0, 4.0, shape)])
    change = (found.mean - 1) / 3
    area_mm2 = float((change * mesh.areas_mm2[found.elements]).sum())
    assert area_mm2 == pytest.approx(share * math.pi * 144, rel=0.01)
    assert change.max() <= 1 + 1e-12


def test_an_even_round_shape_covers_what_the_disc_does(mesh):
    disc = Cover(mesh).of(TrueTouch(5.0, -12.0, 12.0, 4.0))
    shape = Cover(mesh).of(TrueTouch(5.0, -12.0, 12.0, 4.0, TouchShape()))
    assert all(np.array_equal(a, b) for a, b in zip(disc, shape, strict=True))


def test_the_long_axis_points_where_the_angle_says():
    shape = named_shape("ellipse", 4.0, 90.0)
    inside = shape.rho2(np.array([0.0, 19.0]), np.array([19.0, 0.0]), 10.0) <= 1
    assert inside.tolist() == [True, False]
    rim = shape.rim_mm(10.0)
    assert np.abs(rim).max(axis=0) == pytest.approx([5.0, 20.0])
    np.testing.assert_allclose(shape.rho2(rim[:, 0], rim[:, 1], 10.0), 1.0)


def test_frames_of_a_finger_carry_its_truth_and_the_plan_names_its_shape():
    scene = _scene({"x_mm": 10.0, "y_mm": 5.0, "radius_mm": 12.0, "shape": "finger", "aspect": 2.0})
    assert "shapes: hertz" in compile_scene(scene).plan.text()
    frames = run_scene(scene)
    assert frames.touch_xy_mm.tolist() == [[10.0, 5.0]]
    columns, rows = (np.flatnonzero(frames.truth_mask[0].any(axis=axis)) for axis in (0, 1))
    assert np.ptp(columns) > 1.6 * np.ptp(rows)


@pytest.mark.parametrize(
    ("touch", "message"),
    [
        ({"shape": "elipse"}, "did you mean 'ellipse'"),
        ({"aspect": 2.0}, "a disc has no aspect"),
        ({"shape": "ellipse", "aspect": 0.5}, "aspect = 0.5 is out of range"),
        ({"shape": "ellipse", "aspect": 9.0, "x_mm": 70.0}, "outside the skin"),
        ({"law": "insulating", "contrast": 2.0}, "contrast = 2.0 is out of range"),
        ({"law": "insulating", "grams": 2.0}, "grams goes with"),
        ({"law": "press_and_conduct", "press": 0.5}, "press goes with"),
    ],
)
def test_what_cannot_be_is_refused_with_its_key(touch, message):
    table = {"x_mm": 0.0, "y_mm": 0.0, "radius_mm": 10.0, "grams": 50.0, **touch}
    if touch.get("law") != "press_and_conduct" and "grams" not in touch:
        del table["grams"]
    with pytest.raises(ConfigError, match=message):
        _scene(table)


def test_fingers_side_by_side_may_be_nearer_than_their_length_but_not_overlap():
    finger = {"y_mm": 0.0, "radius_mm": 10.0, "shape": "finger", "aspect": 2.0, "angle_deg": 90.0}
    _scene({**finger, "x_mm": -7.5}, {**finger, "x_mm": 7.5})
    with pytest.raises(ConfigError, match="overlaps touch 0"):
        _scene({**finger, "x_mm": -6.5}, {**finger, "x_mm": 6.5})


def test_press_and_conduct_adds_contact_to_the_loads_own_change():
    law, grams = PressAndConduct(0.02, 10.0, 9.0, 50.0), np.array([0.0, 50.0, 1e5])
    load = 1 + 9 * (1 - np.exp(-0.02 * grams / 9))
    np.testing.assert_allclose(law.contrast_at(grams), load + 8 * (1 - np.exp(-grams / 50)))
    assert Insulating().contrast_at(np.array([0.0, 0.5, 1.0])) == pytest.approx([1.0, 0.6, 0.2])


def test_an_insulating_touch_is_resistive():
    scene = _scene({"x_mm": 0.0, "y_mm": 0.0, "radius_mm": 10.0, "law": "insulating"})
    frames = run_scene(scene)
    assert frames.touch_sign.tolist() == [-1]


def test_a_sudden_change_costs_one_state_and_leaves_the_untouched_frames():
    effects = {"sheet_change": {"spread": 0.05, "at_s": 0.1}}
    changed = compile_scene(still_scene(6, touches=(), effects=effects))
    plain = simulate_frames(compile_scene(still_scene(6, touches=())))
    assert len(changed.states) == 2
    done = simulate_frames(changed)
    same = [np.array_equal(a, b) for a, b in zip(done.voltage_v, plain.voltage_v, strict=True)]
    assert same == [True] * 4 + [False] * 4
    assert len(np.unique(done.voltage_v[4:], axis=0)) == 1


def test_a_slow_change_grows_until_it_is_whole():
    effects = {"sheet_change": {"spread": 0.05, "rise_s": 0.2}}
    compiled = compile_scene(still_scene(8, touches=(), effects=effects))
    assert len(compiled.states) == 1 + 4  # untouched, and parts of 1/4 to 4/4
    away = simulate_frames(compiled).voltage_v[2:]
    grown = np.abs(away - away[0]).max(axis=1)
    assert (np.diff(grown[:5]) > 0).all() and np.ptp(grown[4:]) == 0


def test_contacts_change_after_the_tare_only_where_the_scene_says_so():
    table = {"mean_ohm_m2": 0.01, "spread": 0.2}
    stays = compile_scene(still_scene(4, touches=(), effects={"contact_impedance": table}))
    table = {**table, "change": 0.3}
    changes = compile_scene(still_scene(4, touches=(), effects={"contact_impedance": table}))
    assert (len(stays.states), len(changes.states)) == (1, 2)
    first, second = (state.contacts.impedance_ohm_m2 for state in changes.states)
    assert np.array_equal(first, stays.states[0].contacts.impedance_ohm_m2)
    assert 0.05 < np.std(np.log(second / first)) < 0.9


def test_the_page_has_every_law_and_shape():
    folder = Path(__file__).resolve().parents[3] / "docs" / "reference" / "touches"
    page = (folder / "README.md").read_text(encoding="utf-8")
    from eitskin.scene.laws import LAWS

    for name in (*LAWS, *SHAPES):
        assert f"\n## {name}\n" in page and f"({name}.png)" in page
        assert 2_000 < (folder / f"{name}.png").stat().st_size < 60_000
