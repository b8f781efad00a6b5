"""Running a compiled scene: every distinct state is solved once, every frame goes through the named
steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin import __version__
from eitskin.errors import ConfigError
from eitskin.frames.frames import Frames
from eitskin.scene.compiler import Compiled, State, background_of, compile_scene
from eitskin.scene.description import Scene
from eitskin.scene.forward_steps import Factorise, FactoriseComplex, Forward, Update, Work
from eitskin.scene.reading import PlainReader, TrueVoltages, WholeReader, solved_impedance
from eitskin.scene.truth import Truth, truth_of
from eitskin.skin.skin import skin_to_table

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SceneRun:
    """What running gave: all frames (n, m) in V, quiet ones first, and the work it took.

    ``true_v`` (s, m) are the states' voltages before excitation, front end and converter.
    """

    voltage_v: FloatArray
    true_v: npt.NDArray[Any]
    work: Work
    recorded_factorisations: int
    generators: int


def forward_of(compiled: Compiled, work: Work) -> Forward:
    """The forward step that was chosen when compiling."""
    if compiled.method == "update":
        return Update(compiled.model, compiled.phase, compiled.reach, work, compiled.base_factors)
    if compiled.phase is not None:
        return FactoriseComplex(compiled.model, compiled.phase, work)
    return Factorise(compiled.model, work)


def simulate_frames(
    compiled: Compiled, progress: Callable[[range], Iterable[int]] | None = None
) -> SceneRun:
    """Solve every state, then take every frame through the steps; ``progress`` wraps the states'
    numbers.

    Raises:
        ConfigError: an effect makes a conductivity that cannot be, or a voltage that is not finite.
    """
    scene, work = compiled.scene, Work()
    forward, background, read = (
        forward_of(compiled, work),
        background_of(compiled),
        _reader(compiled),
    )
    unknown = [k for k in range(len(compiled.states)) if k not in compiled.known]
    readings = {k: read(electrodes, compiled.states[k]) for k, electrodes in compiled.known.items()}
    factorised = np.zeros(scene.n_frames, dtype=np.int64)
    for k in map(
        unknown.__getitem__, progress(range(len(unknown))) if progress else range(len(unknown))
    ):
        state, before = compiled.states[k], work.factorisations
        solved = forward.electrodes(
            background(state), state.change, solved_impedance(state.contacts)
        )
        readings[k] = read(solved, state)
        factorised[state.frame] += work.factorisations - before

    voltage_v, functions = np.zeros((scene.n_frames, scene.protocol.n_rows)), compiled.functions
    numbers, times = compiled.state_of_frame.tolist(), compiled.times_s().tolist()
    for frame, (number, time_s) in enumerate(zip(numbers, times, strict=True)):
        v, loads = readings[number].v, readings[number].loads
        for function in functions:
            v = function(v, loads, time_s, frame)  # type: ignore[arg-type]
        voltage_v[frame] = v
    if not np.isfinite(voltage_v).all():
        frame, row = np.argwhere(~np.isfinite(voltage_v))[0]
        named = ", ".join(scene.effects) or "none"
        raise ConfigError(
            f"{scene.where} [effects]: frame {frame - scene.quiet_frames}, row {row} is"
            f" {voltage_v[frame, row]}; an effect's parameters (of {named}) are too extreme"
        )
    true_v = np.array([readings[k].v for k in range(len(compiled.states))])
    recorded = int(factorised[scene.quiet_frames :].sum())
    return SceneRun(voltage_v, true_v, work, recorded, compiled.work.generators)


def _reader(compiled: Compiled) -> Callable[[npt.NDArray[Any], State], TrueVoltages]:
    patterns, protocol = compiled.model.patterns, compiled.scene.protocol
    if compiled.needs_whole_reader:
        whole = WholeReader(patterns, protocol, compiled.bridge_pairs)
        return lambda electrodes, state: whole.read(electrodes, state.contacts)
    plain = PlainReader(patterns, protocol.current_a)
    return lambda electrodes, state: plain.read(electrodes, state.contacts)


def run(
    compiled: Compiled,
    *,
    truth_pixels: int = 64,
    progress: Callable[[range], Iterable[int]] | None = None,
) -> Frames:
    """The scene's frames with their truth, rastered with ``truth_pixels`` along the skin's longer
    side (0: no rasters).

    ``meta`` says how they were made: the scene's text, its plan, its effects' parameters, and the
    work counted.

    Raises:
        ConfigError: as ``simulate_frames``.
        UsageError: ``truth_pixels`` is out of range, or the rasters would be enormous.
    """
    scene = compiled.scene
    truth = truth_of(compiled, truth_pixels)
    done = simulate_frames(compiled, progress)
    return Frames(
        protocol=scene.protocol,
        voltage_v=done.voltage_v[scene.quiet_frames :],
        reference_voltage_v=done.voltage_v[: scene.quiet_frames],
        time_s=scene.times_s(),
        meta=meta_of(compiled, done),
        **truth_fields(truth),
    )


def run_scene(scene: Scene) -> Frames:
    """The frames of ``scene`` with their truth.

    Raises:
        ConfigError: as ``compile_scene`` and ``simulate_frames``.
    """
    return run(compile_scene(scene))


def truth_fields(truth: Truth) -> dict[str, Any]:
    """The arguments of ``Frames`` that hold ``truth``."""
    return {one.name: getattr(truth, one.name) for one in dataclasses.fields(truth)}


def meta_of(compiled: Compiled, done: SceneRun) -> dict[str, Any]:
    """How the frames were made, as JSON values."""
    scene = compiled.scene
    return {
        "made_by": f"eitskin {__version__}, scene {scene.name!r}",
        "scene": scene.text,
        "skin": skin_to_table(scene.skin),
        "seed": scene.seed,
        "rate_hz": scene.rate_hz,
        "effects": {
            name: plain(dataclasses.asdict(one)) for name, one in compiled.parameters.items()
        },
        "mesh_elements": compiled.model.mesh.n_elements,
        "plan": compiled.plan.as_dict(),
        "counters": {
            "factorisations": done.work.factorisations + compiled.work.v0_factorisations,
            "factorisations_in_recorded_frames": done.recorded_factorisations,
            "complex_factorisations": done.work.complex_factorisations,
            "solves": done.work.solves + compiled.work.v0_solves,
            "low_rank_updates": done.work.updates,
            "states": len(compiled.states),
            "random_generators": done.generators,
        },
    }


def plain(value: Any) -> Any:
    """``value`` with tuples as lists and numpy numbers as Python's, fit for JSON."""
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value
