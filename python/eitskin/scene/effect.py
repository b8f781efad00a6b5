"""The contract between the compiler of scenes and the modules that each implement one effect.

An effect is a module. It is imported only when a scene names it, and defines

- ``NAME``, the word in ``[effects.NAME]``; ``STAGE``, a :class:`Stage`; ``SUMMARY``, one line.
- ``ORDER``: a number; within a stage, steps run by (ORDER, NAME). Leave gaps: 10, 20, 30.
- ``Parameters``: a frozen dataclass, one field per key, units in names. ``field(default=...,
  metadata={"low": ..., "high": ..., "open_low": True, "choices": (...), "unit": "V", "doc":
  "..."})``; types are float, int, bool, str, tuple[int, ...], tuple[float, ...], or one of these
  ``| None``. Its ``__post_init__`` may raise ConfigError with one line that begins with the key;
  file and table are put before it.
- ``make(parameters, session) -> Step``: it may raise ConfigError in the same way.
- optionally ``CONFLICTS``: names of effects that it cannot be named together with, and ``SHARED``:
  a dict from its keys to the property of the instrument that each states ({"frequency_hz":
  "excitation frequency"}), on which named effects must agree.

``time_s`` counts seconds from the first recorded frame, on the same axis as the touches' keyframes,
so it is NEGATIVE during the untouched frames. ``frame`` counts all frames from 0, untouched ones
first.

A step's ``apply`` is a pure function of its arguments: the same frame gives the same result however
often and in whatever order it is called, and the arguments stay unchanged. Values that are random
in each frame are drawn from ``session.stream(NAME, frame)``, which is made again for that frame;
values that are random once are drawn in ``make`` from ``session.stream(NAME)`` (index 0) or
``session.stream(NAME + " part")``, with a different name for each part.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from eitskin.arrays import AnyArray
from eitskin.arrays import BoolArray as BoolArray  # for effects
from eitskin.arrays import ComplexArray as ComplexArray
from eitskin.arrays import FloatArray as FloatArray
from eitskin.errors import ConfigError
from eitskin.fem.mesh import Mesh
from eitskin.scene.deformation import Deformation
from eitskin.skin.protocol import Protocol as ScanProtocol
from eitskin.skin.skin import Skin

Voltages: TypeAlias = AnyArray
"""(m,) volts: float64, or complex128 between a phase step and the converter."""


class Stage(IntEnum):
    """The place of a step on the way from the skin to the recorded number; steps run in this
    order."""

    GEOMETRY = 0  # the true places of electrodes, once, before meshing
    MATERIAL = 1  # conductivity of each element over time
    BOUNDARY = 2  # contacts: impedance of each electrode, detached and bridged electrodes
    EXCITATION = 3  # the current: phase (complex solve), source output impedance, amplitude drift
    FRONT_END = 4  # changes the true boundary voltages to the output of the amplifier
    DIGITISE = 5  # changes that to codes: noise, saturation, ADC bits, jitter; only real numbers


@dataclass(frozen=True)
class EffectCost:
    """The work that a step adds, per session and per frame.

    A vector pass is one read or write of a vector of all voltages, elements or electrodes.
    """

    factorisations: float = 0
    factorisations_per_frame: float = 0
    solves_per_frame: float = 0
    vector_passes_per_frame: float = 0
    random_numbers: int = 0
    random_numbers_per_frame: int = 0


@dataclass(frozen=True, eq=False)
class EffectSession:
    """The session that an effect's ``make`` receives.

    Attributes:
        skin: the skin as described, before any geometry step.
        protocol: the scan, with m rows.
        n_frames: the number of all frames, untouched ones included.
        quiet_frames: the number of untouched frames, at the start.
        rate_hz: frames per second.
        seed: the seed of the scene.
        folder: where the scene's file lies, in which an effect's files are searched.
        build_mesh: use ``mesh`` instead.
        solve_v0: use ``v0_v`` instead.
        make_stream: use ``stream`` instead.
    """

    skin: Skin
    protocol: ScanProtocol
    n_frames: int
    quiet_frames: int
    rate_hz: float
    seed: int
    build_mesh: Callable[[], Mesh]
    solve_v0: Callable[[], FloatArray]
    make_stream: Callable[[str, int], np.random.Generator]
    folder: Path = Path()

    @property
    def mesh(self) -> Mesh:
        """The mesh that is solved on, made on first use. Geometry effects must not use it."""
        return self.build_mesh()

    def times_s(self) -> FloatArray:
        """Return the time of each frame (n_frames,), below 0 for untouched ones."""
        return np.asarray((np.arange(self.n_frames) - self.quiet_frames) / self.rate_hz)

    def v0_v(self) -> FloatArray:
        """Return the exact frame (m,) of the untouched skin as described, with ideal electrodes and
        without any effect.

        It does not depend on which effects are named, so a signal-to-noise ratio always refers to
        the same voltages.
        """
        return self.solve_v0()

    def v0_rms_v(self) -> float:
        """Return the root mean square of ``v0_v`` over its rows: SNR_dB = 20 log10(v0_rms_v /
        sigma)."""
        return float(np.sqrt(np.mean(self.v0_v() ** 2)))

    def stream(self, name: str, index: int = 0) -> np.random.Generator:
        """Return the random generator for (seed, ``name``, ``index``); ``name`` begins with that of
        the effect."""
        return self.make_stream(name, index)

    def limit_v(self, given_v: float | None, headroom: float | None) -> float:
        """Return a limit in V: ``given_v``, or ``headroom`` (None: 1.25) times the largest of
        ``v0_v``."""
        if given_v is not None:
            return given_v
        return (1.25 if headroom is None else headroom) * float(np.abs(self.v0_v()).max())

    def refuse_absent(self, electrodes: Iterable[int]) -> None:
        """Raise a ConfigError for electrodes that the skin does not have, in a key called
        ``electrodes``."""
        count = self.skin.electrodes.count
        for electrode in electrodes:
            if not 0 <= electrode < count:
                raise ConfigError(
                    f"electrodes: {electrode} does not exist; the skin's are 0 to {count - 1}"
                )


def part_at(time_s: float, at_s: float, rise_s: float) -> float:
    """Return the part of a change after the tare that has happened at ``time_s``. It is 0 before
    ``at_s``, then grows linearly and is complete ``rise_s`` later (0: at once)."""
    if time_s < at_s:
        return 0.0
    return 1.0 if rise_s <= 0 else min(1.0, (time_s - at_s) / rise_s)


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of the electrodes at one time.

    ``impedance_ohm_m2`` (L,) is 0 for an ideal shunt. ``detached`` (L,) marks electrodes that do
    not touch the skin at all (open circuit; a bad contact is a large impedance instead).
    ``bridges`` are resistors (i, j, ohm >= 0) between electrodes.
    """

    impedance_ohm_m2: FloatArray
    detached: BoolArray
    bridges: tuple[tuple[int, int, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Loads:
    """The potentials of the four electrodes of each row while it is read, (m,) in V, relative to
    the mean of all electrodes.

    The load of row r is (``source_v[r]`` - ``sink_v[r]``) / ``current_a`` in ohm, contacts
    included. Values are complex after a phase step.
    """

    source_v: Voltages
    sink_v: Voltages
    plus_v: Voltages
    minus_v: Voltages
    current_a: float


@dataclass(frozen=True, eq=False)
class GeometryStep:
    """``apply(skin) -> skin`` gives the skin that is meshed; it runs once."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[Skin], Skin]
    stage: Stage = Stage.GEOMETRY


@dataclass(frozen=True, eq=False)
class MaterialStep:
    """``apply(conductivity (E,) S/m, time_s, frame) -> (E,)`` changes the conductivity before
    touches are added. It runs once unless it ``varies``. Frames with equal ``same(time_s, frame)``
    share a solve; without ``same`` each frame has its own."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[FloatArray, float, int], FloatArray]
    varies: bool = False
    same: Callable[[float, int], float] | None = None
    stage: Stage = Stage.MATERIAL


@dataclass(frozen=True, eq=False)
class DeformationStep:
    """``apply(time_s, frame)`` deforms skin and electrodes; several steps are applied in turn.
    ``of_surfaces`` says whether it is for skins that cover a surface, or for flat ones. Frames with
    equal deformations share a solve."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[float, int], Deformation]
    varies: bool = True
    stage: Stage = Stage.MATERIAL
    of_surfaces: bool = False


@dataclass(frozen=True, eq=False)
class ContactStep:
    """``apply(contacts, time_s, frame) -> Contacts`` changes the contacts. It runs once unless it
    ``varies``."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[Contacts, float, int], Contacts]
    varies: bool = False
    stage: Stage = Stage.BOUNDARY


@dataclass(frozen=True, eq=False)
class PhaseStep:
    """Makes the forward solve complex, at ``frequency_hz``.

    ``admittivity(conductivity (E,) S/m) -> (E,) complex S/m`` works element by element.
    ``contact(impedance (L,) ohm m2) -> (L,) complex ohm m2`` keeps 0 as an ideal shunt. ``readout(v
    (m,) complex) -> (m,) float`` runs just before the digitising stage.
    """

    name: str
    cost: EffectCost
    note: str
    frequency_hz: float
    admittivity: Callable[[FloatArray], ComplexArray]
    contact: Callable[[FloatArray], ComplexArray]
    readout: Callable[[ComplexArray], FloatArray]
    stage: Stage = Stage.EXCITATION


@dataclass(frozen=True, eq=False)
class LoadedStep:
    """``apply(v (m,), loads, time_s, frame) -> (m,)`` changes the voltages and uses the electrodes'
    potentials (for source impedance or common mode)."""

    name: str
    stage: Stage
    cost: EffectCost
    note: str
    apply: Callable[[Voltages, Loads, float, int], Voltages]


@dataclass(frozen=True, eq=False)
class VoltageStep:
    """``apply(v (m,), time_s, frame) -> (m,)`` changes the voltages. Rows are in the order of the
    scan, at equal intervals over the frame's time."""

    name: str
    stage: Stage
    cost: EffectCost
    note: str
    apply: Callable[[Voltages, float, int], Voltages]


Step: TypeAlias = (
    GeometryStep
    | MaterialStep
    | DeformationStep
    | ContactStep
    | PhaseStep
    | LoadedStep
    | VoltageStep
)


@runtime_checkable
class EffectModule(Protocol):
    """The names that a module with an effect defines; ``CONFLICTS`` and ``SHARED`` are optional."""

    NAME: str
    STAGE: Stage
    ORDER: int
    SUMMARY: str
    Parameters: type[Any]

    def make(self, parameters: Any, session: EffectSession) -> Step:
        """Return the step of the effect in this session."""
        ...
