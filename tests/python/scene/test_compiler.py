"""The plan, the choice of the solve, and what unnamed effects must not do."""

import dataclasses
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scene_helpers import ELEMENTS, effect_module, moving_scene, still_scene

from eitskin.errors import ConfigError
from eitskin.fem import cem
from eitskin.fem.cem import ForwardModel, factorise
from eitskin.fem.mesh import mesh_for_elements
from eitskin.scene import forward_steps
from eitskin.scene.compiler import compile_scene
from eitskin.scene.effect import Contacts, ContactStep, EffectCost, Stage, VoltageStep
from eitskin.scene.forward_steps import count_costs
from eitskin.scene.registry import BUILT_IN, Registry
from eitskin.scene.runner import run_scene, simulate_frames
from eitskin.scene.simulate import conductivity_with
from eitskin.scene.touch_path import touches_at

NEEDED: dict[str, dict[str, Any]] = {"noise": {"snr_db": 60.0}}


@pytest.mark.parametrize("name", sorted(set(BUILT_IN) - {"flex"}))  # which needs a surface
def test_naming_an_effect_adds_exactly_one_step(name, mesh_cache):
    """The steps of the scene without it stay, in their order."""
    scene = moving_scene(4)
    effects: tuple[dict[str, Any], ...] = ({}, {name: NEEDED.get(name, {})})
    without, named = (
        compile_scene(replace(scene, effects=own), mesh_cache=mesh_cache).plan.steps
        for own in effects
    )
    assert len(named) == len(without) + 1
    assert [step.name for step in named if step.name != name] == [step.name for step in without]
    assert [step.name for step in named if step.effect] == [name]


def test_frames_without_effects_are_the_forward_models_to_the_bit():
    for scene in (still_scene(), moving_scene(4, solver="factorise", frozen=True)):
        frames = run_scene(scene)
        mesh = mesh_for_elements(scene.skin, ELEMENTS)
        forward = ForwardModel(mesh, scene.skin, scene.protocol, 0.0)
        sheet = scene.skin.conductivity_s_per_m
        assert np.array_equal(frames.reference_voltage_v, np.tile(forward.voltages(sheet), (2, 1)))
        for k in range(scene.frames):
            touches = touches_at(scene.samples(), k)
            assert touches
            direct = forward.voltages(conductivity_with(forward.mesh, touches, sheet))
            assert np.array_equal(frames.voltage_v[k], direct)


def test_two_hundred_unnamed_effects_change_neither_plan_nor_frames():
    def refuse(parameters: Any, session: Any) -> Any:
        raise AssertionError("the factory of an unnamed effect was called")

    many = {f"unnamed{k}": effect_module(f"unnamed{k}", refuse) for k in range(100)}
    many |= {f"absent{k}": f"no_such_package.effect{k}" for k in range(100)}
    scene = moving_scene(4, effects={"noise": {"snr_db": 60.0}})
    alone = compile_scene(scene)
    among = compile_scene(scene, registry=Registry({**BUILT_IN, **many}, entry_points=False))
    assert len(many) == 200
    assert among.plan.steps == alone.plan.steps
    assert among.plan.text() == alone.plan.text()
    assert np.array_equal(simulate_frames(among).voltage_v, simulate_frames(alone).voltage_v)


def test_the_reference_may_be_asked_for_in_the_middle_of_a_bridged_run():
    """V0 has patterns of its own; asking for it late does not disturb the scene's."""

    def make(parameters: Any, session: Any) -> VoltageStep:
        return adding("late", lambda v: v / session.v0_rms_v())

    registry = Registry({**BUILT_IN, "late": effect_module("late", make)}, entry_points=False)
    effects: dict[str, Any] = {"bridged": {"electrodes": [2, 3]}, "gel_drying": {}}
    plain = simulate_frames(compile_scene(still_scene(4, effects=effects))).voltage_v
    with_late = compile_scene(still_scene(4, effects={**effects, "late": {}}), registry=registry)
    v0_v = run_scene(still_scene(1, touches=())).voltage_v[0]
    scaled = simulate_frames(with_late).voltage_v * np.sqrt(np.mean(v0_v**2))
    assert scaled == pytest.approx(plain, rel=1e-12)


def adding(name: str, change: Callable[[Any], Any]) -> VoltageStep:
    """A step of the front end."""
    return VoltageStep(name, Stage.FRONT_END, EffectCost(), "", lambda v, time_s, frame: change(v))


def test_update_and_factorisation_agree_to_1e_9(mesh_cache):
    """Real, with contacts, with bridges and complex, and with the grounded electrode off."""
    around = moving_scene(16, frozen=True)
    for effects in (
        {},
        {"contact_impedance": {"mean_ohm_m2": 0.02, "spread": 0.5}},
        {"bridged": {"electrodes": [2, 3], "resistance_ohm": 5.0}},
        {"phase": {}, "contact_impedance": {}},
        {"detached": {"electrodes": [15]}},
        {"background": {}},
    ):
        done = {}
        for solver, expected in (("update", 1), ("factorise", 17)):
            scene = replace(around, effects=effects, solver=solver)
            compiled = compile_scene(scene, mesh_cache=mesh_cache)
            assert compiled.method == solver
            done[solver] = simulate_frames(compiled)
            known = len(compiled.known) if solver == "factorise" else 0
            assert done[solver].work.factorisations == expected - known
        v = done["factorise"].voltage_v
        difference = np.abs(done["update"].voltage_v - v).max()
        assert difference < 1e-9 * np.abs(v).max(), effects


def test_the_way_with_fewer_multiplications_is_chosen(mesh_cache):
    many = compile_scene(moving_scene(60), mesh_cache=mesh_cache)
    assert many.counted is not None and many.counted.update < many.counted.factorise
    assert many.method == "update"
    assert many.counted.update_solves == 16 + len(many.reach)
    done = simulate_frames(many)
    assert (done.work.factorisations, done.work.solves) == (1, 16 + len(many.reach))
    still = compile_scene(still_scene(60), mesh_cache=mesh_cache)
    assert still.method == "factorise" and still.counted is None


def test_count_prefers_factorisations_where_few_states_touch_much():
    model = compile_scene(still_scene()).model
    shunted = np.ones(16, np.bool_)
    assert count_costs(model, shunted, np.array([10, 12]), 15).cheaper == "update"
    assert count_costs(model, shunted, np.array([300, 300]), 600).cheaper == "factorise"


def test_the_plan_tells_what_the_run_then_does(mesh_cache):
    for effects in (
        {}, {"noise": {"snr_db": 60.0}}, {"gel_drying": {}}, {"contact_impedance": {}},
        {"phase": {}},
    ):  # fmt: skip
        for scene in (still_scene(5, effects=effects), moving_scene(5, effects=effects)):
            compiled = compile_scene(scene)
            done = simulate_frames(compiled)
            found = compiled.plan.factorisations
            assert found == done.work.factorisations + compiled.work.v0_factorisations
            assert compiled.plan.solves == done.work.solves + compiled.work.v0_solves
            assert compiled.plan.is_complex == ("phase" in effects)


def test_a_plan_cannot_be_changed_and_prints_every_step():
    plan = compile_scene(moving_scene(4, effects={"noise": {"snr_db": 60.0}, "mains": {}})).plan
    assert isinstance(plan.steps, tuple)
    with pytest.raises(dataclasses.FrozenInstanceError):
        plan.steps = ()
    text = plan.text()
    assert [name in text for name in ("mesh", "touches", "solve", "*mains", "*noise")] == [True] * 5
    assert "in all: 1 factorisations (real" in text and "208 random/frame" in text
    assert text.index("*mains") < text.index("*noise")
    assert [step["name"] for step in plan.as_dict()["steps"]][-2:] == ["mains", "noise"]


def test_a_static_scene_of_a_thousand_frames_factorises_once_for_its_frames():
    frames = run_scene(still_scene(1000))
    assert frames.n_frames == 1000
    assert frames.meta["counters"]["factorisations_in_recorded_frames"] == 1
    assert frames.meta["counters"]["factorisations"] == 2
    bare = run_scene(still_scene(1000, touches=()))
    assert bare.meta["counters"]["factorisations"] == 1


def test_order_within_a_stage_is_that_of_order_then_name(mesh_cache):
    effects = {"jitter": {}, "adc": {}, "noise": {"snr_db": 60.0}, "saturation": {}}
    names, turned = (
        [
            step.name
            for step in compile_scene(scene, mesh_cache=mesh_cache).plan.steps
            if step.effect
        ]
        for scene in (
            still_scene(effects=effects),
            still_scene(effects=dict(reversed(effects.items()))),
        )
    )
    assert names == turned and names[-1] == "adc"


def test_contradictory_effects_are_refused(mesh_cache):
    name = effect_module("opposed")
    sys.modules[name].CONFLICTS = ("mains",)
    registry = Registry({**BUILT_IN, "opposed": name})
    opposed = still_scene(effects={"mains": {}, "opposed": {}}, where="f.toml")
    varying = still_scene(effects={"gel_drying": {}}, solver="update", where="f.toml")
    for scene, said in (
        (opposed, r"f.toml \[effects.opposed\]: it contradicts \[effects.mains\]"),
        (varying, r'f.toml \[scene\]: solver = "update" .* \[effects.gel_drying\]'),
    ):
        with pytest.raises(ConfigError, match=said):
            compile_scene(scene, registry=registry, mesh_cache=mesh_cache)


def test_a_bridge_rescues_a_detached_electrode(mesh_cache):
    """Electrode 5 off, but joined to 6 by a wire: rows over both read 0, the others' rows are read
    through 6."""
    off, bridge = {"electrodes": [5]}, {"electrodes": [5, 6], "resistance_ohm": 0.0}
    effects = {"detached": off, "bridged": bridge}
    compiled = compile_scene(still_scene(effects=effects), mesh_cache=mesh_cache)
    v, rows = simulate_frames(compiled).voltage_v[-1], compiled.scene.protocol.drive_measure
    across = [set(row[2:]) == {5, 6} or set(row[:2]) == {5, 6} for row in rows.tolist()]
    assert np.abs(v[across]).max() < 1e-6 * np.abs(v).max()
    assert (np.abs(v[np.logical_not(across)]) > 0).all()


def test_bad_steps_are_said_to_be_the_effects(mesh_cache):
    def negative(parameters: Any, session: Any) -> ContactStep:
        less = Contacts(np.full(16, -1.0), np.zeros(16, np.bool_))
        return ContactStep("negative", EffectCost(), "", lambda contacts, time_s, frame: less)

    modules = {
        "renamed": effect_module("renamed", lambda *_: adding("other", lambda v: v)),
        "endless": effect_module("endless", lambda *_: adding("endless", lambda v: v * np.inf)),
        "negative": effect_module("negative", negative, Stage.BOUNDARY),
    }
    registry = Registry(modules, entry_points=False)
    for name, said in (
        ("renamed", r"scene \[effects.renamed\]: .*another name or stage"),
        ("negative", r"scene \[effects.negative\]: .*negative or not finite"),
        ("endless", "frame -2, row 0 is -?inf.*endless"),
    ):
        scene = still_scene(effects={name: {}})
        with pytest.raises(ConfigError, match=said):
            simulate_frames(compile_scene(scene, registry=registry, mesh_cache=mesh_cache))


@pytest.mark.parametrize(
    ("effects", "expected"),
    [
        ({}, 1),
        ({"noise": {"snr_db": 60.0}}, 1),
        ({"adc": {}, "noise": {"snr_db": 60.0}}, 1),
        ({"noise": {"snr_db": 60.0}, "contact_impedance": {}}, 2),
    ],
)
def test_a_moving_touch_factorises_the_untouched_skin_once(effects, expected, monkeypatch):
    """Counted where the matrix is factorised. With contacts the skin is another than V0's."""
    made = []

    def counted(matrix: Any) -> Any:
        made.append(matrix.shape)
        return factorise(matrix)

    for module in (cem, forward_steps):
        monkeypatch.setattr(module, "factorise", counted)
    compiled = compile_scene(moving_scene(30, effects=effects, solver="update"))
    first, second = simulate_frames(compiled), simulate_frames(compiled)
    assert len(made) == expected + (compiled.base_factors is None)  # run twice
    assert compiled.plan.factorisations == expected
    assert np.array_equal(first.voltage_v, second.voltage_v)


def test_factors_that_v0_left_give_the_updates_bits():
    """A noise of nothing asks for V0, and changes no bit."""
    plain = simulate_frames(compile_scene(moving_scene(12, solver="update")))
    with_v0 = compile_scene(
        moving_scene(12, solver="update", effects={"noise": {"noise_v": 0.0}, "adc": {}})
    )
    assert with_v0.base_factors is not None
    assert np.array_equal(simulate_frames(with_v0).true_v, plain.true_v)
