"""Rules for every effect: it keeps reciprocity if physics does, draws from its own stream of random
numbers, leaves its arguments unchanged, and keeps its documented ranges."""

import dataclasses
import importlib
import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.scene.compiler import MeshCache, compile_scene
from eitskin.scene.description import scene_from_table
from eitskin.scene.effect import EffectSession, GeometryStep, LoadedStep, Loads, Stage, VoltageStep
from eitskin.scene.registry import BUILT_IN, Registry, describe_parameters, summary_of
from eitskin.scene.runner import simulate_frames
from eitskin.skin.protocol import adjacent

BENCH = MeshCache()  # keeps the meshes
# The parameters under which each effect is looked at, so strong that breaking reciprocity shows.
STRONG: dict[str, dict[str, Any]] = {
    "out_of_round": {"spread": 0.05},
    "misplacement": {"spread_mm": 4.0},
    "stretch": {"strain": 0.2, "direction_deg": 30.0},
    "bend": {"radius_mm": 50.0},
    "creep": {"strain": 0.1, "time_constant_s": 0.05},
    "background": {"spread": 0.4},
    "temperature": {"offset_k": 5.0, "drift_k_per_min": 10.0},
    "gel_drying": {"time_constant_h": 0.001},
    "sheet_change": {"spread": 0.3},
    "contact_impedance": {"mean_ohm_m2": 0.05, "spread": 0.5},
    "detached": {"electrodes": [3, 11]},
    "bridged": {"electrodes": [2, 3, 9], "resistance_ohm": 50.0},
    "phase": {"relative_permittivity": 1000.0, "readout": "magnitude"},
    "source_impedance": {"resistance_ohm": 50e3, "frequency_hz": 50e3},
    "amplitude_drift": {"slope_per_min": 3.0, "walk_per_sqrt_min": 0.1},
    "channel_gain": {"spread": 0.05, "inverted": 0.25},
    "offset": {"spread": 0.05},
    "rectifier": {"drop_v": 1e-4},
    "mux": {"settling_us": 50.0, "on_spread_ohm": 10.0},
    "charge_injection": {"charge_pc": 50.0},
    "crosstalk": {"coupling_db": -40.0},
    "mains": {"amplitude_v": 0.01},
    "common_mode": {"cmrr_db": 50.0},
    "noise": {"snr_db": 50.0},
    "saturation": {"headroom": 0.5},
    "adc": {"bits": 8},
    "jitter": {"jitter_ns": 100.0},
}
# The skin is a reciprocal network whatever its conductivity, contacts and resistors. One factor for
# a whole frame, and a characteristic that is the same for all rows, keep equal rows equal.
# Everything that treats the two rows of a pair differently breaks it: their time, order, channel,
# load, potentials or chance.
KEEP = {
    "misplacement", "background", "temperature", "gel_drying", "contact_impedance", "detached",
    "bridged", "phase", "out_of_round", "sheet_change", "stretch", "bend", "creep",
    "amplitude_drift", "saturation", "adc", "rectifier",
}  # fmt: skip
RANDOM = {
    "misplacement", "background", "contact_impedance", "amplitude_drift", "channel_gain", "mux",
    "offset", "charge_injection", "out_of_round", "sheet_change", "jitter", "noise",
}  # fmt: skip


def _frames(effects: dict[str, Any], seed: int = 5, frames: int = 2) -> FloatArray:
    """Frames of a press that is nowhere symmetrical, without an untouched frame."""
    table = {
        "scene": {"seed": seed, "frames": frames, "quiet_frames": 1, "elements": 1200},
        "touch": [{"x_mm": 37.0, "y_mm": 22.0, "radius_mm": 20.0, "contrast": 9.0}],
        "effects": effects,
    }
    scene = scene_from_table(table, "test", Path())
    return simulate_frames(compile_scene(scene, mesh_cache=BENCH)).voltage_v[1:]


def _irreciprocity(v: FloatArray) -> float:
    pairs = adjacent(16).reciprocal_pairs()
    return float(np.abs(v[pairs.first] - pairs.sign * v[pairs.second]).max() / np.abs(v).max())


def _made(name: str, session: EffectSession) -> Any:
    """The module of an effect, and its step under the parameters above."""
    module = importlib.import_module(BUILT_IN[name])
    values = {k: tuple(v) if isinstance(v, list) else v for k, v in STRONG[name].items()}
    return module, module.make(module.Parameters(**values), session)


def test_every_effect_is_looked_at():
    assert set(STRONG) | {"flex"} == set(BUILT_IN)  # flex is for surfaces: test_flex.py
    assert not (KEEP | RANDOM) - set(BUILT_IN)


@pytest.fixture(scope="module")
def plain() -> FloatArray:
    return _frames({})


@pytest.mark.parametrize("name", sorted(STRONG))
def test_reciprocity(name, plain):
    v = _frames({name: STRONG[name]})
    assert np.abs(v - plain).max() > 1e-4 * np.abs(plain).max()  # it does something
    left = _irreciprocity(v[-1])
    assert left < 1e-9 if name in KEEP else left > 1e-3


def test_without_effects_the_sheet_is_reciprocal_and_all_kept_together_keep_it(plain):
    assert _irreciprocity(plain[-1]) < 1e-10
    assert _irreciprocity(_frames({name: STRONG[name] for name in sorted(KEEP)})[-1]) < 1e-9


@pytest.mark.parametrize("name", sorted(STRONG))
def test_streams_are_the_effects_own(name, make_session):
    """An effect draws only from random streams with its own name, and an effect without randomness
    draws nothing."""
    drawn: list[str] = []
    _, step = _made(name, make_session(drawn=drawn))
    if isinstance(step, VoltageStep):
        step.apply(np.ones(208), 0.0, 3)
    assert all(one == name or one.startswith(f"{name} ") for one in drawn)
    assert bool(drawn) == (name in RANDOM)
    cost = step.cost
    assert bool(cost.random_numbers or cost.random_numbers_per_frame) == (name in RANDOM)


@pytest.mark.parametrize("name", sorted(RANDOM))
def test_a_seed_makes_the_same_frames_and_another_others(name):
    first = _frames({name: STRONG[name]})
    assert np.array_equal(first, _frames({name: STRONG[name]}))
    assert not np.array_equal(first, _frames({name: STRONG[name]}, seed=6))


@pytest.mark.parametrize("name", sorted(STRONG))
def test_a_step_is_a_pure_function(name, make_session):
    """Applied twice, out of order, it gives the same and leaves its arguments as they are."""
    module, step = _made(name, make_session())
    assert step.name == name and step.stage is module.STAGE and step.note
    if not isinstance(step, VoltageStep | LoadedStep):
        return
    v = np.linspace(-1, 1, 208)
    kept = v.copy()
    a, b, c, d = np.random.default_rng(1).standard_normal((4, 208))
    more: tuple[Any, ...] = (Loads(a, b, c, d, 1e-3),) if isinstance(step, LoadedStep) else ()
    apply: Any = step.apply
    first = apply(v, *more, 0.1, 3)
    apply(v, *more, 0.5, 9)
    assert np.array_equal(apply(v, *more, 0.1, 3), first)
    assert np.array_equal(v, kept) and first is not v
    assert first.shape == (208,) and first.dtype == np.float64
    if module.STAGE < Stage.DIGITISE:
        assert apply(v + 0.1j * v, *more, 0.1, 3).dtype == np.complex128


@pytest.mark.parametrize("name", sorted(STRONG))
def test_an_effect_declares_what_it_is(name):
    module = importlib.import_module(BUILT_IN[name])
    assert name == module.NAME and isinstance(module.STAGE, Stage) and module.SUMMARY.endswith(".")
    assert summary_of(BUILT_IN[name]) == module.SUMMARY and Registry().load(name, "f") is module
    assert module.__doc__ and len(module.__doc__) > 250
    assert len(inspect.getsource(module).splitlines()) < 120
    module.Parameters()  # defaults are possible
    for field in dataclasses.fields(module.Parameters):
        assert field.metadata["doc"] and "unit" in field.metadata
        default, low, high = field.default, field.metadata.get("low"), field.metadata.get("high")
        for value in default if isinstance(default, tuple) else (default,):
            assert value is None or low is None or value >= low
            assert value is None or high is None or value <= high


@pytest.mark.parametrize("name", sorted(STRONG))
def test_the_page_has_every_effect_and_parameter(name):
    folder = Path(__file__).resolve().parents[4] / "docs" / "reference" / "effects"
    page = (folder / "README.md").read_text(encoding="utf-8")
    section = " ".join(page.split(f"\n## {name}\n", 1)[1].split("\n## ", 1)[0].split())
    module = importlib.import_module(BUILT_IN[name])
    assert module.SUMMARY in section and f"({name}.png)" in section
    for row in describe_parameters(module):
        assert f"`{row['name']}`" in section
    assert 2_000 < (folder / f"{name}.png").stat().st_size < 60_000


def test_pages_count_the_effects():
    root = Path(__file__).resolve().parents[4]
    for page in ("CHANGELOG.md", "docs/guide/gallery.md"):
        text = (root / page).read_text(encoding="utf-8")
        counted = re.findall(r"\b(\d+) (?:effects,|are in \[effects\])", text)
        assert counted == [str(len(BUILT_IN))], page


def test_misplacement_and_outline_are_the_only_geometry_steps():
    stages = {name: importlib.import_module(module).STAGE for name, module in BUILT_IN.items()}
    found = [name for name, stage in stages.items() if stage is Stage.GEOMETRY]
    assert found == ["out_of_round", "misplacement"]
    assert GeometryStep.__dataclass_fields__["stage"].default is Stage.GEOMETRY
