"""Compile a scene to a list of steps that is fixed before the first frame: ``compile_scene``.

Only the effects that the scene names are imported and made. Whatever can be known before solving is
worked out here: which frames and rows share a state of skin, touches and contacts, and whether
touches are solved by factorisation or by update. The frame loop (``runner.py``) then makes no
decisions.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from eitskin.arrays import AnyArray, FloatArray, IntArray
from eitskin.config import from_table
from eitskin.errors import ConfigError
from eitskin.fem.cem import ForwardModel
from eitskin.scene.cover import NO_CHANGE, Change, Cover
from eitskin.scene.deformation import FLAT, Deformation, one_after_another
from eitskin.scene.description import Scene
from eitskin.scene.effect import (
    Contacts,
    ContactStep,
    DeformationStep,
    GeometryStep,
    LoadedStep,
    Loads,
    MaterialStep,
    PhaseStep,
    Stage,
    Step,
    VoltageStep,
)
from eitskin.scene.forward_steps import UpdateCost, count_costs, touched_unknowns
from eitskin.scene.motion import Mix, Motion
from eitskin.scene.plan import ScenePlan, make_plan
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.reading import live_rows, solved_impedance, with_bridges
from eitskin.scene.registry import Registry
from eitskin.scene.session import MeshCache, SessionWork, check_shared, load_effects, make_steps
from eitskin.scene.touch_path import touches_at
from eitskin.skin.skin import Skin, size_to_paper

VoltageFunction: TypeAlias = Callable[[AnyArray, Loads, float, int], AnyArray]


@dataclass(frozen=True, eq=False)
class State:
    """A distinct state of skin, touches and contacts, which needs one forward solve. ``frame`` is
    the first frame that has it."""

    touches: tuple[TrueTouch, ...]
    change: Change
    contacts: Contacts
    frame: int
    deformation: Deformation = FLAT


class States:
    """The distinct states of a scene's ``frames``, numbered in the order in which they are first
    asked for, and the states of each row at given instants."""

    def __init__(self, scene: Scene, cover: Cover, steps: Sequence[Step], frames: range) -> None:
        self._scene, self._cover, self._frames = scene, cover, frames
        self._varying = [s for s in steps if isinstance(s, MaterialStep) and s.varies]
        self._deforming = [s for s in steps if isinstance(s, DeformationStep)]
        self._contacts = _contacts(scene, steps, frames)
        self._changes: dict[tuple[tuple[TrueTouch, ...], Deformation], Change] = {}
        self._covered_as: tuple[Deformation, Cover] = FLAT, cover  # the last, since one may be slow
        self._number: dict[Any, int] = {}
        self.all: list[State] = []
        self.motion = Motion(scene.touches, size_to_paper(scene.skin.outline))

    def of(self, frame: int, touches: tuple[TrueTouch, ...]) -> int:
        """Return the number of the state that ``frame`` has with ``touches``."""
        place = frame - self._frames.start
        contact = self._contacts[place if len(self._contacts) > 1 else 0]
        time_s = (frame - self._scene.quiet_frames) / self._scene.rate_hz
        sheet = tuple(
            float(frame) if s.same is None else s.same(time_s, frame) for s in self._varying
        )
        deformation = one_after_another(s.apply(time_s, frame) for s in self._deforming)
        key = (touches, contact_key(contact), sheet, deformation)
        if key not in self._number:
            self._number[key] = len(self.all)
            change = self.change(touches, deformation)
            self.all.append(State(touches, change, contact, frame, deformation))
        return self._number[key]

    def with_fingers(self, number: int, fingers: tuple[TrueTouch, ...]) -> State:
        """Return state ``number`` with ``fingers`` beside its touches. It gets no number, and
        nothing of it is kept."""
        state = self.all[number]
        touches = state.touches + fingers
        return replace(state, touches=touches, change=self._covered(touches, state.deformation))

    def change(self, touches: tuple[TrueTouch, ...], deformation: Deformation = FLAT) -> Change:
        """Return how ``touches`` change the conductivity of the deformed skin."""
        if not touches:
            return NO_CHANGE
        key = touches, deformation
        if key not in self._changes:
            self._changes[key] = self._covered(touches, deformation)
        return self._changes[key]

    def _covered(self, touches: tuple[TrueTouch, ...], how: Deformation) -> Change:
        if self._covered_as[0] != how:
            self._covered_as = how, how.covered(self._cover)
        return self._covered_as[1].change(touches)

    def mix(self, frame: int, times_s: FloatArray) -> Mix:
        """Return the states of ``frame``'s rows at their instants (m,)."""
        if frame < self._scene.quiet_frames:
            return self._same(self.of(frame, ()), len(times_s))
        mix, touches_of = self.motion.at(times_s), self.motion.states
        number = {k: self.of(frame, touches_of[k]) for k in used_in(mix)}
        every = np.zeros(len(touches_of), np.int64)
        every[list(number)] = list(number.values())
        return Mix(every[mix.lower], every[mix.upper], mix.part)

    @staticmethod
    def _same(number: int, rows: int) -> Mix:
        numbers = np.full(rows, number, np.int64)
        return Mix(numbers, numbers, np.zeros(rows))


@dataclass(frozen=True, eq=False)
class Compiled:
    """A scene ready to run. Nothing in it changes any more, except ``work``, which counts, and
    ``table``, which grows if rows at other instants are asked for.

    Attributes:
        skin: the true skin, after geometry steps.
        steps: the steps of the named effects, in the order in which they run.
        parameters: the parameters of each effect.
        frames: which of all frames, untouched ones first, are compiled; n of them.
        states: the states, each solved once. ``state_of_frame`` (n,) gives the state of each frame,
            or -1 if touches move during its scan; then ``mixes`` gives its states, by the frame's
            place in ``frames``. ``table`` holds these states and those of other instants.
        known: potentials of states that were already solved, for V0.
        base_factors: the factors of the untouched skin, made for V0 and used again by the update.
        functions: the functions that convert the true voltages of a state to the recorded ones, for
            each frame.
        bridge_pairs: the electrodes that any state bridges.
        method: "factorise" or "update"; ``counted`` holds the costs that decided, if there was a
            choice.
        reach: the unknowns that any touch reaches, for the update.
    """

    scene: Scene
    skin: Skin
    model: ForwardModel
    steps: tuple[Step, ...]
    parameters: dict[str, Any]
    phase: PhaseStep | None
    frames: range
    states: tuple[State, ...]
    table: States
    state_of_frame: IntArray
    mixes: dict[int, Mix]
    known: dict[int, FloatArray]
    base_factors: Any
    functions: tuple[VoltageFunction, ...]
    needs_whole_reader: bool
    bridge_pairs: tuple[tuple[int, int], ...]
    method: str
    reach: IntArray
    counted: UpdateCost | None
    plan: ScenePlan
    work: SessionWork

    def times_s(self) -> FloatArray:
        """Return the times of the compiled frames (n,), below 0 for untouched ones."""
        numbers = np.arange(self.frames.start, self.frames.stop)
        return np.asarray((numbers - self.scene.quiet_frames) / self.scene.rate_hz)


@dataclass(frozen=True, eq=False)
class Prepared:
    """The part of a compiled scene that does not depend on its frames. It is made once."""

    scene: Scene
    skin: Skin
    steps: tuple[Step, ...]
    parameters: dict[str, Any]
    phase: PhaseStep | None
    mesh_cache: MeshCache
    work: SessionWork
    base_factors: Any

    @property
    def as_described(self) -> bool:
        """Return whether the skin that is solved is the described one, changed by nothing except
        touches."""
        return all(step.stage >= Stage.FRONT_END or _is_voltage(step) for step in self.steps)


def compile_scene(
    scene: Scene, *, registry: Registry | None = None, mesh_cache: MeshCache | None = None
) -> Compiled:
    """Compile ``scene``; ``mesh_cache`` provides the meshes and untouched skins of earlier scenes.

    Raises:
        ConfigError, GeometryError, ProtocolError: an effect is unknown, or the scene and its
            effects do not fit together.
        MissingExtraError: the mesher is not installed.
    """
    prepared = prepare_scene(scene, registry=registry, mesh_cache=mesh_cache)
    return compile_frames(prepared, range(scene.n_frames))


def prepare_scene(
    scene: Scene, *, registry: Registry | None = None, mesh_cache: MeshCache | None = None
) -> Prepared:
    """Import and make the effects of ``scene``; errors are those of ``compile_scene``."""
    mesh_cache, work = MeshCache() if mesh_cache is None else mesh_cache, SessionWork()
    modules = load_effects(scene, Registry() if registry is None else registry)
    parameters = {
        name: from_table(module.Parameters, scene.effects[name], f"{scene.where} [effects.{name}]")
        for name, module in modules.items()
    }
    check_shared(scene, modules, parameters)
    steps, skin = make_steps(scene, modules, parameters, mesh_cache, work)
    _refuse_flat_effects(scene, skin, steps)
    phase = _only_phase(scene, steps)
    factors, work.v0_factors = work.v0_factors, None
    return Prepared(scene, skin, steps, parameters, phase, mesh_cache, work, factors)


def compile_frames(prepared: Prepared, frames: range) -> Compiled:
    """Compile only ``frames`` of a prepared scene, out of all frames, untouched ones first. Errors
    are those of ``compile_scene``."""
    scene, skin, steps = prepared.scene, prepared.skin, prepared.steps
    phase, mesh_cache, work = prepared.phase, prepared.mesh_cache, prepared.work
    table = States(scene, mesh_cache.cover(skin, scene.elements), steps, frames)
    state_of_frame, mixes = _states_of_frames(scene, table, frames)
    states = tuple(table.all)
    model = mesh_cache.model(
        skin, scene.protocol, scene.elements, solved_impedance(states[0].contacts)
    )
    pairs = tuple(dict.fromkeys((i, j) for state in states for i, j, _ in state.contacts.bridges))
    model.patterns = with_bridges(model.patterns, pairs)
    method, reach, counted = _choose_method(scene, model, states, steps)
    known = {}
    as_described = prepared.as_described
    base_factors = prepared.base_factors if method == "update" and as_described else None
    if method == "factorise" and as_described:
        mesh_cache.v0_v(scene, work)
        electrodes, work.v0_factors = mesh_cache.known(scene), None
        known = {
            k: electrodes for k, s in enumerate(states) if electrodes is not None and not s.touches
        }
    detached = any(state.contacts.detached.any() for state in states)
    loaded = any(isinstance(step, LoadedStep) for step in steps)
    solved, factorised = (len(states), len(known)), base_factors is not None
    return Compiled(
        scene=scene,
        skin=skin,
        model=model,
        steps=steps,
        parameters=prepared.parameters,
        phase=phase,
        frames=frames,
        states=states,
        table=table,
        state_of_frame=state_of_frame,
        mixes=mixes,
        known=known,
        base_factors=base_factors,
        functions=_functions(steps, phase),
        needs_whole_reader=bool(pairs) or detached or loaded,
        bridge_pairs=pairs,
        method=method,
        reach=reach,
        counted=counted,
        plan=make_plan(
            scene, model, steps, *solved, method, len(reach), work, factorised, len(mixes)
        ),
        work=work,
    )


def background_of(compiled: Compiled) -> Callable[[State], FloatArray]:
    """Return a function from a state to the conductivity (E,) of its skin without touches.

    Steps before the first varying one are applied once, here; the others are applied for each
    state, at the time of its frame.
    """
    scene, times, start = compiled.scene, compiled.times_s(), compiled.frames.start
    materials = [step for step in compiled.steps if isinstance(step, MaterialStep)]
    fixed = next((k for k, step in enumerate(materials) if step.varies), len(materials))
    sheet = np.full(compiled.model.mesh.n_elements, compiled.skin.conductivity_s_per_m)

    def applied(step: MaterialStep, conductivity: FloatArray, frame: int) -> FloatArray:
        time_s = float(times[frame - start])
        changed = step.apply(conductivity, time_s, frame)
        if changed.shape != conductivity.shape or not (
            changed.min() > 0 and changed.max() < np.inf
        ):
            raise ConfigError(
                f"{scene.where} [effects.{step.name}]: at {time_s:g} s it makes a"
                f" conductivity of {changed.min():.3g} S/m; every conductivity must be finite and"
                " above 0, so use milder parameters"
            )
        return changed

    for step in materials[:fixed]:
        sheet = applied(step, sheet, start)

    def background(state: State) -> FloatArray:
        conductivity = sheet
        for step in materials[fixed:]:
            conductivity = applied(step, conductivity, state.frame)
        return conductivity

    return background


def _refuse_flat_effects(scene: Scene, skin: Skin, steps: Sequence[Step]) -> None:
    """Reject effects that move the outline of a skin whose outline belongs to a surface."""
    if skin.surface is None:
        return
    names = [s.name for s in steps if isinstance(s, DeformationStep) and not s.of_surfaces]
    if skin.outline != scene.skin.outline:
        names += [step.name for step in steps if isinstance(step, GeometryStep)]
    if names:
        raise ConfigError(
            f"{scene.where} [effects.{names[0]}]: this effect is for flat skins, and"
            f" {skin.name!r} covers a surface; [effects.flex] gives it another shape"
        )


def _only_phase(scene: Scene, steps: Sequence[Step]) -> PhaseStep | None:
    phases = [step for step in steps if isinstance(step, PhaseStep)]
    if len(phases) > 1:
        raise ConfigError(
            f"{scene.where} [effects.{phases[1].name}]: [effects.{phases[0].name}] sets the"
            " phase too"
        )
    return phases[0] if phases else None


def _is_voltage(step: Step) -> bool:
    return isinstance(step, VoltageStep | LoadedStep)


def used_in(mix: Mix) -> list[int]:
    """Return the numbers of the states that ``mix`` uses, ascending."""
    needed = np.concatenate([mix.lower, mix.upper[mix.part > 0]])
    return [int(k) for k in np.unique(needed)]


def _states_of_frames(
    scene: Scene, states: States, frames: range
) -> tuple[IntArray, dict[int, Mix]]:
    """Return the state of each of ``frames`` (n,), -1 if touches move during the frame, and the
    mixes of those frames."""
    state_of_frame, mixes = np.zeros(len(frames), np.int64), {}
    recorded = range(max(frames.start - scene.quiet_frames, 0), frames.stop - scene.quiet_frames)
    samples, delays_s = scene.samples(recorded) if scene.frozen else (), scene.row_delays_s
    for place, frame in enumerate(frames):
        number = frame - scene.quiet_frames
        if number < 0 or not scene.touches:
            state_of_frame[place] = states.of(frame, ())
        elif scene.frozen:
            state_of_frame[place] = states.of(frame, touches_at(samples, number - recorded.start))
        else:
            mix = states.mix(frame, number / scene.rate_hz + delays_s)
            state_of_frame[place] = mix.lower[0] if mix.still else -1
            if not mix.still:
                mixes[place] = mix
    return state_of_frame, mixes


def contact_key(contacts: Contacts) -> tuple[bytes, bytes, tuple[tuple[int, int, float], ...]]:
    """Return a key that is equal for equal contacts."""
    return contacts.impedance_ohm_m2.tobytes(), contacts.detached.tobytes(), contacts.bridges


def _contacts(scene: Scene, steps: Sequence[Step], frames: range) -> list[Contacts]:
    """Return the contacts of each of ``frames``, or a single entry for all of them if nothing
    varies."""
    own = [step for step in steps if isinstance(step, ContactStep)]
    count, rows = scene.skin.electrodes.count, scene.protocol.drive_measure.astype(np.int64)
    varies, found = any(step.varies for step in own), []
    for frame in frames if varies else frames[:1]:
        time_s = (frame - scene.quiet_frames) / scene.rate_hz
        contacts, detaching = Contacts(np.zeros(count), np.zeros(count, np.bool_)), ""
        for step in own:
            contacts = step.apply(contacts, time_s, frame)
            where = f"{scene.where} [effects.{step.name}]"
            if contacts.detached.any() and not detaching:
                detaching = where
            _check_contacts(contacts, count, where)
        if own and not live_rows(contacts, rows).any():
            raise ConfigError(
                f"{detaching or scene.where}: at {time_s:g} s electrodes"
                f" {np.flatnonzero(contacts.detached).tolist()} (from 0) are detached, and no row"
                " of the protocol can be measured; detach fewer"
            )
        found.append(contacts)
    return found


def _check_contacts(contacts: Contacts, count: int, where: str) -> None:
    impedance = contacts.impedance_ohm_m2
    if impedance.shape != (count,) or not (impedance.min() >= 0 and impedance.max() < np.inf):
        raise ConfigError(
            f"{where}: a contact impedance is negative or not finite; use milder parameters"
        )
    for i, j, ohm in contacts.bridges:
        if not (0 <= i < count and 0 <= j < count and i != j and 0 <= ohm < np.inf):
            raise ConfigError(
                f"{where}: a bridge of {ohm:g} ohm between electrodes {i} and {j} (from 0) is not"
                f" possible; name two different ones of 0 to {count - 1} and at least 0 ohm"
            )


def _choose_method(
    scene: Scene, model: ForwardModel, states: Sequence[State], steps: Sequence[Step]
) -> tuple[str, IntArray, UpdateCost | None]:
    """Choose how to solve; return the method, the unknowns that touches reach (for the update), and
    the counted costs that decided."""
    nothing = np.zeros(0, np.int64)
    changing = (DeformationStep, MaterialStep, ContactStep)
    varying = [step.name for step in steps if isinstance(step, changing) and step.varies]
    if varying and scene.solver == "update":
        raise ConfigError(
            f'{scene.where} [scene]: solver = "update" needs a skin and contacts that do not'
            f' change, but [effects.{varying[0]}] changes them; use "auto"'
        )
    moves = any(track.moves for track in scene.touches)
    if varying or scene.solver == "factorise" or (scene.solver == "auto" and not moves):
        return "factorise", nothing, None
    shunted = np.asarray(solved_impedance(states[0].contacts) == 0)
    under = [touched_unknowns(model, shunted, state.change.elements) for state in states]
    reach = np.unique(np.concatenate([*under, nothing]))
    counted = count_costs(model, shunted, np.array([len(one) for one in under]), len(reach))
    if scene.solver == "update" or counted.cheaper == "update":
        return "update", reach, counted
    return "factorise", nothing, counted


def _functions(steps: Sequence[Step], phase: PhaseStep | None) -> tuple[VoltageFunction, ...]:
    """Return the functions that convert true voltages to recorded ones, frame by frame. The readout
    of a phase step comes before digitising."""
    of_volts = [step for step in steps if _is_voltage(step)]
    before = [_function(step) for step in of_volts if step.stage < Stage.DIGITISE]
    after = [_function(step) for step in of_volts if step.stage >= Stage.DIGITISE]
    readout = [] if phase is None else [_readout(phase)]
    return (*before, *readout, *after)


def _function(step: Step) -> VoltageFunction:
    if isinstance(step, LoadedStep):
        return step.apply
    assert isinstance(step, VoltageStep)
    apply = step.apply
    return lambda v, loads, time_s, frame: apply(v, time_s, frame)


def _readout(phase: PhaseStep) -> VoltageFunction:
    return lambda v, loads, time_s, frame: phase.readout(v)
