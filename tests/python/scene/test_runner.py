"""Frames of scenes: truth, streams, counters, real arithmetic."""

from typing import Any

import numpy as np
import pytest
from scene_helpers import effect_module, moving_scene, still_scene

from eitskin.errors import ConfigError
from eitskin.frames.frames import load_frames, save_frames
from eitskin.scene import session
from eitskin.scene.compiler import compile_scene
from eitskin.scene.effect import EffectCost, MaterialStep, Stage
from eitskin.scene.registry import BUILT_IN, Registry
from eitskin.scene.runner import run, run_scene, simulate_frames

RANDOM = ("noise", "jitter", "channel_gain", "contact_impedance", "background", "charge_injection")


def test_frames_carry_the_truth_and_survive_their_file(tmp_path):
    scene = moving_scene(6, frozen=True, effects={"noise": {"snr_db": 60.0}})
    frames = run(compile_scene(scene), truth_pixels=32)
    save_frames(tmp_path / "f.npz", frames)
    again = load_frames(tmp_path / "f.npz")
    assert np.array_equal(again.voltage_v, frames.voltage_v)
    assert again.reference_voltage_v.shape == (2, 208)
    assert again.time_s is not None and again.time_s[5] == 0.25
    assert again.touch_frame.tolist() == list(range(6))
    assert again.touch_strength.tolist() == [8.0] * 6
    assert again.touch_xy_mm[0].tolist() == [-80.0, 0.0]
    assert again.touch_xy_mm[5] == pytest.approx([60.0, 30.0])
    area = (again.truth_mask == 1).sum(axis=(1, 2)) * (194 / 32) ** 2
    assert area == pytest.approx(np.full(6, 314.0), rel=0.45)
    inside = again.truth_conductivity_s_per_m[again.truth_mask == 1]
    assert inside.max() == pytest.approx(0.09, rel=0.01)
    assert np.nanmin(again.truth_conductivity_s_per_m) > 0.0099
    assert again.meta["effects"] == {"noise": {"snr_db": 60.0, "noise_v": None}}
    assert again.meta["plan"]["method"] == "update" and again.meta["counters"]["states"] == 7


@pytest.mark.parametrize("added", sorted(set(BUILT_IN) - {"noise", "flex"}))
def test_adding_an_effect_leaves_the_others_samples_as_they_were(added, mesh_cache, monkeypatch):
    """Every number that named effects draw, by stream: equal to the bit with and without one more
    effect."""
    drawn: dict[tuple[int, str, int], np.random.BitGenerator] = {}
    real = session.stream

    def watched(seed: int, name: str, index: int = 0) -> np.random.Generator:
        generator = real(seed, name, index)
        drawn[seed, name, index] = generator.bit_generator
        return generator

    monkeypatch.setattr(session, "stream", watched)
    names = set(RANDOM) - {added, "noise"}
    effects = {**{name: {} for name in sorted(names)}, "noise": {"snr_db": 60.0}}
    steps, states = [], []
    for own in (effects, {added: {}, **effects}):
        drawn.clear()
        compiled = compile_scene(still_scene(effects=own), mesh_cache=mesh_cache)
        simulate_frames(compiled)
        noise = next(step for step in compiled.steps if step.name == "noise")
        steps.append(np.array([noise.apply(np.zeros(208), 0.0, k) for k in range(4)]))
        states.append({key: repr(value.state) for key, value in drawn.items()})
    assert np.array_equal(steps[0], steps[1]) and np.abs(steps[0]).max() > 0
    assert states[0].items() <= states[1].items()
    assert all(name.split(" ")[0] == added for _, name, _ in states[1].keys() - states[0].keys())


def test_without_random_effects_no_generator_is_made(monkeypatch):
    def refuse(*_: Any, **__: Any) -> Any:
        raise AssertionError("a random generator was made")

    monkeypatch.setattr(np.random, "default_rng", refuse)
    effects: dict[str, Any] = {
        "gel_drying": {}, "mains": {}, "adc": {}, "detached": {"electrodes": [3]}, "mux": {},
    }  # fmt: skip
    for own in ({}, effects):
        frames = run_scene(moving_scene(4, effects=own))
        assert frames.meta["counters"]["random_generators"] == 0
    with pytest.raises(AssertionError, match="generator was made"):
        run_scene(moving_scene(4, effects={"noise": {"snr_db": 60.0}}))


def test_arithmetic_is_complex_only_with_phase(mesh_cache, monkeypatch):
    from eitskin.fem import cem
    from eitskin.scene import forward_steps

    seen: list[np.dtype[Any]] = []
    real = cem.factorise

    def watched(matrix: Any) -> Any:
        seen.append(matrix.dtype)
        return real(matrix)

    monkeypatch.setattr(cem, "factorise", watched)
    monkeypatch.setattr(forward_steps, "factorise", watched)
    names = set(BUILT_IN) - {"phase", "flex"}
    everything = {name: {} for name in sorted(names)} | {"noise": {"snr_db": 60.0}}
    for scene in (moving_scene(3), still_scene(3, effects=everything)):
        done = simulate_frames(compile_scene(scene))
        assert done.work.complex_factorisations == 0 and done.true_v.dtype == np.float64
    assert set(seen) == {np.dtype(np.float64)}
    seen.clear()
    with_phase = still_scene(3, effects={"phase": {}})
    done = simulate_frames(compile_scene(with_phase, mesh_cache=mesh_cache))
    assert set(seen) == {np.dtype(np.complex128)} and done.work.complex_factorisations == 2
    assert done.true_v.dtype == np.complex128 and done.voltage_v.dtype == np.float64


def test_a_conductivity_that_cannot_be_names_effect_and_time(mesh_cache):
    def sinking(c: Any, time_s: float, frame: int) -> Any:
        return c - 0.08 * max(time_s + 0.1, 0.0)

    step = MaterialStep("sinking", EffectCost(), "", sinking, True)
    module = effect_module("sinking", lambda *_: step, Stage.MATERIAL)
    registry = Registry({"sinking": module}, entry_points=False)
    scene = still_scene(4, effects={"sinking": {}}, where="f.toml")
    compiled = compile_scene(scene, registry=registry, mesh_cache=mesh_cache)
    said = r"f.toml \[effects.sinking\]: at 0.05 s it makes a conductivity of -0.002"
    with pytest.raises(ConfigError, match=said):
        simulate_frames(compiled)
