"""Run a compiled scene: every distinct state is solved once, and every frame passes through the
named steps."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from eitskin import __version__
from eitskin.arrays import AnyArray, FloatArray
from eitskin.errors import ConfigError
from eitskin.frames.frames import Frames
from eitskin.progress import Progress, silent
from eitskin.scene.compiler import Compiled, State, background_of, compile_scene, used_in
from eitskin.scene.deformation import FLAT, Deformation, deformed
from eitskin.scene.description import Scene
from eitskin.scene.forward_steps import Factorise, FactoriseComplex, Forward, Update, Work
from eitskin.scene.motion import Mix
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.reading import PlainReader, TrueVoltages, WholeReader, solved_impedance
from eitskin.scene.truth import truth_of
from eitskin.skin.skin import skin_to_table


@dataclass(frozen=True, eq=False)
class SceneRun:
    """The result of a run: all frames (n, m) in V, untouched ones first, and the work that it took.

    ``true_v`` (s, m) are the states' voltages before excitation, front end and converter.
    """

    voltage_v: FloatArray
    true_v: AnyArray
    work: Work
    recorded_factorisations: int
    generators: int


def forward_of(compiled: Compiled, work: Work) -> Forward:
    """Return the forward step that was chosen when compiling."""
    if compiled.method == "update":
        return Update(compiled.model, compiled.phase, compiled.reach, work, compiled.base_factors)
    if compiled.phase is not None:
        return FactoriseComplex(compiled.model, compiled.phase, work)
    return Factorise(compiled.model, work)


class FrameMaker:
    """Makes each frame of a compiled scene when it is asked for; a state is solved when a frame
    first needs it. The values do not depend on the order of requests."""

    def __init__(self, compiled: Compiled) -> None:
        self.compiled, self.work = compiled, Work()
        self._forward, self._background = forward_of(compiled, self.work), background_of(compiled)
        self._last: tuple[Deformation, Forward, FloatArray, FloatArray] | None = None
        self._read = _reader(compiled)
        self._times = compiled.times_s()
        states = compiled.states
        self._readings = {k: self._read(v, states[k]) for k, v in compiled.known.items()}
        self._still: tuple[tuple[int, int], FloatArray] = ((-1, -1), np.zeros(0))
        self._pressed: tuple[State, TrueVoltages] | None = None

    def reading(self, number: int) -> TrueVoltages:
        """Return the voltages of state ``number`` before excitation, front end and converter."""
        if number not in self._readings:
            self._readings[number] = self._solved(self.compiled.table.all[number])
        return self._readings[number]

    def _solved(self, state: State) -> TrueVoltages:
        background, impedance = self._background(state), solved_impedance(state.contacts)
        forward = self._forward
        if state.deformation != FLAT:
            forward, elements, contacts = self._deformed(state.deformation)
            background, impedance = background * elements, impedance / contacts
        return self._read(forward.electrodes(background, state.change, impedance), state)

    def _deformed(self, how: Deformation) -> tuple[Forward, FloatArray, FloatArray]:
        """Return the forward step of a deformed skin, and the thickness of its elements and under
        its electrodes; the last ones are kept."""
        if self._last is None or self._last[0] != how:
            model = deformed(self.compiled.model, how)
            forward = forward_of(replace(self.compiled, model=model), self.work)
            self._last = how, forward, *how.thickness_of(self.compiled.model.mesh)
        return self._last[1:]

    def frame(self, frame: int, row_times_s: FloatArray | None = None) -> FloatArray:
        """Return frame number ``frame`` of all frames, untouched ones first, (m,) in V. Its rows
        are those of its own scan, or those at the instants ``row_times_s`` (m,); effects are those
        of the frame."""
        mix = None if row_times_s is None else self.compiled.table.mix(frame, row_times_s)
        if mix is None or not mix.still:
            return self._made(frame, self._true(frame, mix))
        key = frame, int(mix.lower[0])
        if key != self._still[0]:
            self._still = key, self._made(frame, self.reading(key[1]))
        return self._still[1]

    def pressed(self, frame: int, fingers: tuple[TrueTouch, ...]) -> FloatArray:
        """Return frame number ``frame``, (m,) in V, with ``fingers`` beside the scene's touches;
        all of them stay as they are in the middle of its scan. Only the last state is kept."""
        state = self.compiled.table.with_fingers(self._middle_state(frame), fingers)
        last = self._pressed
        if last is None or (last[0].touches, last[0].frame) != (state.touches, state.frame):
            self._pressed = last = state, self._solved(state)
        return self._made(frame, last[1])

    def _middle_state(self, frame: int) -> int:
        place = frame - self.compiled.frames.start
        mix = self.compiled.mixes.get(place)
        if mix is None:
            return int(self.compiled.state_of_frame[place])
        places = self.compiled.scene.protocol.scan_places
        places = self.compiled.scene.protocol.scan_places
        return int(mix.lower[np.argsort(places)[len(places) // 2]])

    def _made(self, frame: int, reading: TrueVoltages) -> FloatArray:
        """Return the recorded frame for true voltages: they pass through the front end and the
        converter."""
        scene, place = self.compiled.scene, frame - self.compiled.frames.start
        v, time_s = reading.v, float(self._times[place])
        for function in self.compiled.functions:
            v = function(v, reading.loads, time_s, frame)  # type: ignore[arg-type]
        if not np.isfinite(v).all():
            row = int(np.flatnonzero(~np.isfinite(v))[0])
            named = ", ".join(scene.effects) or "none"
            raise ConfigError(
                f"{scene.where} [effects]: frame {frame - scene.quiet_frames}, row {row} is"
                f" {v[row]}; an effect's parameters (of {named}) are too extreme"
            )
        return np.asarray(v, dtype=np.float64)

    def _true(self, frame: int, mix: Mix | None) -> TrueVoltages:
        place = frame - self.compiled.frames.start
        mix = self.compiled.mixes.get(place) if mix is None else mix
        if mix is None:
            return self.reading(int(self.compiled.state_of_frame[place]))
        return blend({k: self.reading(k) for k in used_in(mix)}, mix)


def blend(readings: dict[int, TrueVoltages], mix: Mix) -> TrueVoltages:
    """Interpolate the voltages and loads of each row between those of its two states."""
    numbers = sorted(readings)
    upper = np.where(mix.part > 0, mix.upper, mix.lower)
    low, high = (np.searchsorted(numbers, one) for one in (mix.lower, upper))
    rows = np.arange(len(low))

    def between(values: list[AnyArray]) -> AnyArray:
        stack = np.array(values)
        first = stack[low, rows]
        return np.asarray(first + mix.part * (stack[high, rows] - first))

    every = [readings[k] for k in numbers]
    v, loads = between([one.v for one in every]), [one.loads for one in every]
    if loads[0] is None:
        return TrueVoltages(v)

    names = ("source_v", "sink_v", "plus_v", "minus_v")
    potentials: dict[str, Any] = {
        name: between([getattr(one, name) for one in loads]) for name in names
    }
    return TrueVoltages(v, replace(loads[0], **potentials))


def simulate_frames(compiled: Compiled, progress: Progress = silent) -> SceneRun:
    """Solve every state, then pass every frame through the steps; ``progress`` wraps the numbers of
    the states."""
    scene, maker = compiled.scene, FrameMaker(compiled)
    states = compiled.states
    unknown = [k for k in range(len(states)) if k not in compiled.known]
    recorded, numbers = 0, range(len(unknown))
    for k in map(unknown.__getitem__, progress(numbers)):
        before = maker.work.factorisations
        maker.reading(k)
        if states[k].frame >= scene.quiet_frames:
            recorded += maker.work.factorisations - before
    voltage_v = np.zeros((len(compiled.frames), scene.protocol.n_rows))
    for place, frame in enumerate(compiled.frames):
        voltage_v[place] = maker.frame(frame)
    true_v = np.array([maker.reading(k).v for k in range(len(states))])
    return SceneRun(voltage_v, true_v, maker.work, recorded, compiled.work.generators)


def _reader(compiled: Compiled) -> Callable[[AnyArray, State], TrueVoltages]:
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
    progress: Progress = silent,
) -> Frames:
    """Return the frames of the scene with their truth, rastered with ``truth_pixels`` along the
    skin's longer side (0: no rasters).

    ``meta`` describes how they were made: the text of the scene, its plan, the parameters of its
    effects, and the counted work.
    """
    scene = compiled.scene
    truth = truth_of(compiled, truth_pixels)
    done = simulate_frames(compiled, progress)
    return Frames(
        protocol=scene.protocol,
        voltage_v=done.voltage_v[scene.quiet_frames :],
        reference_voltage_v=done.voltage_v[: scene.quiet_frames],
        time_s=scene.times_s(),
        row_time_s=scene.row_delays_s if compiled.mixes else None,
        meta=meta_of(compiled, done),
        **truth,
    )


def run_scene(scene: Scene) -> Frames:
    """Return the frames of ``scene`` with their truth."""
    return run(compile_scene(scene))


def meta_of(compiled: Compiled, done: SceneRun) -> dict[str, Any]:
    """Return how the frames were made, as JSON values."""
    scene = compiled.scene
    return {
        "made_by": f"eitskin {__version__}, scene {scene.name!r}",
        "scene": scene.text,
        "skin": skin_to_table(scene.skin),
        "seed": scene.seed,
        "rate_hz": scene.rate_hz,
        "effects": {name: plain(asdict(one)) for name, one in compiled.parameters.items()},
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
    """Return ``value`` for JSON, with tuples as lists and numpy numbers as Python's."""
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value
