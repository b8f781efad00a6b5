"""Stretch, bend and creep: what they do to lengths, thickness and voltages."""

from math import exp, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.errors import ConfigError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.scene.compiler import compile_scene
from eitskin.scene.cover import Cover
from eitskin.scene.deformation import FLAT, EvenDeformation, deformed, one_after_another, stretched
from eitskin.scene.description import scene_from_table
from eitskin.scene.effects import bend, creep, stretch
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.runner import simulate_frames
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import polygon
from eitskin.skin.protocol import table
from eitskin.skin.skin import Skin

STRIP = Skin(
    "strip",
    polygon([(0, 0), (200, 0), (200, 10), (0, 10)]),
    Electrodes(
        count=4,
        width_mm=2.0,
        start_angle_deg=0.0,
        # the drive at the ends, two contacts 100 mm apart on the upper side
        positions_mm=(0.0, 55.0, 155.0, 210.0),
        contact_impedance_ohm_m2=1.0,
    ),
)


@pytest.mark.parametrize(
    ("along", "across", "ratio"),
    [(1.5, 1.5**-0.5, 1.5**2), (1.2, 1.0, 1.2**2), (1 / 1.2, 1.0, 1.2**-2), (1.3, 1.3, 1.3**2)],
)
def test_a_strip_resists_by_the_square_of_its_length(along, across, ratio):
    """length / (width thickness) at constant volume."""
    mesh = mesh_for_elements(STRIP, 2000)
    model = ForwardModel(mesh, STRIP, table(4, [[0, 3, 1, 2], [0, 3, 2, 1]]))
    how = stretched(along, across, 0)
    flat = model.voltages(0.01)
    pulled = deformed(model, how).voltages(0.01 * how.thickness, 1.0 / how.thickness)
    assert pulled[0] / flat[0] == pytest.approx(ratio, rel=5e-3)
    assert abs(flat[0]) == pytest.approx(1e-3 * 0.1 / (0.01 * 0.01 * 0.012), rel=0.02)


def test_deformations_follow_each_other():
    mesh = mesh_for_elements(STRIP, 500)
    touch = [TrueTouch(50.0, 5.0, 4.0, 4.0)]
    steps = [FLAT, stretched(1.2, 0.9, 30), stretched(1.1, 1.3, 70)]
    both, cover = one_after_another(steps), Cover(mesh)
    whole = EvenDeformation(*(steps[2].matrix @ steps[1].matrix).ravel())
    assert np.allclose(both.moved(mesh).nodes_mm, whole.moved(mesh).nodes_mm)
    for found, expected in zip(both.thickness_of(mesh), whole.thickness_of(mesh), strict=True):
        assert np.allclose(found, expected)
    assert np.allclose(
        both.covered(cover).change(touch).tensor, whole.covered(cover).change(touch).tensor
    )
    assert one_after_another([FLAT, steps[1]]) is steps[1] and one_after_another([FLAT]) is FLAT
    turned = stretched(2, 1, 90)
    assert np.allclose(turned.matrix, [[1, 0], [0, 2]]) and turned.thickness == 0.5


def test_a_bend_conducts_as_its_layers_do():
    for radius_mm, neutral in ((100.0, 0.0), (100.0, 0.5), (-80.0, 0.2)):
        heights = (np.arange(10_000) + 0.5) / 10_000 - neutral
        layers = np.mean((1 + 12 * heights / radius_mm) ** -2.0)
        along = bend.lengthening(bend.Parameters(radius_mm, 0.0, neutral), 12.0, 1.0)
        how = stretched(along, 1.0, 0)
        assert how.thickness * how.yy / how.xx == pytest.approx(layers, rel=1e-6)
        assert how.thickness * how.xx / how.yy == pytest.approx(1)


def test_a_sheet_is_bent_over_more_than_its_thickness(make_session):
    with pytest.raises(ConfigError, match="radius_mm = -12"):
        bend.make(bend.Parameters(radius_mm=-12.0), make_session())


def test_creep_comes_and_goes():
    law = creep.Parameters(strain=0.1, creep=0.5, time_constant_s=10, at_s=5, until_s=25)
    crept = 0.05 * (1 - exp(-2))
    expected = {4.9: 0.0, 5.0: 0.1, 25 - 1e-9: 0.1 + crept, 25.0: crept, 35.0: crept * exp(-1)}
    for time_s, strain in expected.items():
        assert creep.strain_at(time_s, law) == pytest.approx(strain, abs=1e-9)


def _voltages(**effects: dict[str, Any]) -> Any:
    scene = {"frames": 4, "rate_hz": 2.0, "quiet_frames": 2, "elements": 800}
    press = {"x_mm": 30.0, "y_mm": 20.0, "radius_mm": 20.0}
    content = {"scene": scene, "touch": [press], "effects": effects}
    compiled = compile_scene(scene_from_table(content, "test", Path()))
    return simulate_frames(compiled).voltage_v, compiled


def test_the_tare_is_the_flat_skins_unless_it_begins_before():
    flat, _ = _voltages()
    late, compiled = _voltages(stretch={"strain": 0.1, "at_s": 1.0})
    assert len(compiled.states) == 3
    assert np.array_equal(late[:4], flat[:4]) and np.array_equal(late[4], late[5])
    assert np.abs(late[4] - flat[4]).max() > 0.05 * np.abs(flat).max()
    always, _ = _voltages(stretch={"strain": 0.1, "at_s": -1000.0})
    assert np.array_equal(always[4], late[4]) and not np.array_equal(always[0], flat[0])


def test_a_scene_is_solved_on_the_deformed_sheet_and_contacts():
    contacts = {"contact_impedance": {"mean_ohm_m2": 0.02}}
    voltage_v, compiled = _voltages(stretch={"strain": 0.3, "at_s": -1000.0}, **contacts)
    how, z_ohm_m2 = stretched(1.3, 1.3**-0.5, 0), np.full(16, 0.02)
    direct = deformed(compiled.model, how).voltages(0.01 * how.thickness, z_ohm_m2 / how.thickness)
    assert np.allclose(voltage_v[:2], direct, rtol=1e-12, atol=0)


def test_effects_meet():
    """A bend gives the same frames as the stretch to which it corresponds, also together with
    another effect and with a phase. Frames of a creep differ."""
    along = bend.lengthening(bend.Parameters(200.0), 12.0, 1.0)
    same = {"strain": along - 1, "sides": "held", "at_s": 0.0}
    other = {"creep": {"strain": 0.1, "time_constant_s": 1.0}, "phase": {}}
    bent, _ = _voltages(bend={"radius_mm": 200.0}, **other)
    pulled, _ = _voltages(stretch=same, **other)
    assert np.allclose(bent, pulled, rtol=1e-12) and len(np.unique(bent[2:, 0])) == 4


def test_free_sides_come_in(make_session):
    free, held = (
        stretch.make(stretch.Parameters(strain=0.21, sides=sides), make_session()).apply(1.0, 9)
        for sides in ("free", "held")
    )
    assert free == EvenDeformation(1.21, 0, 0, 1 / sqrt(1.21)) and held == EvenDeformation(
        1.21, 0, 0, 1
    )
