"""What an effect is: the contract between the compiler of scenes and the modules that each hold one
effect.

An effect is a module. It is imported only when a scene names it, and defines

- ``NAME``: the word in ``[effects.NAME]``; ``STAGE``: a :class:`Stage`; ``SUMMARY``: one line.
- ``ORDER``: a number; within a stage, steps run by (ORDER, NAME). Leave gaps: 10, 20, 30.
- ``Parameters``: a frozen dataclass, one field a key, units in the names. ``field(default=...,
  metadata={"low": ..., "high": ..., "open_low": True, "choices": (...), "unit": "V", "doc":
  "..."})``; types are float, int, bool, str, tuple[int, ...], tuple[float, ...], or one of these
  ``| None``. Its ``__post_init__`` may raise ConfigError with one line that begins with the key;
  file and table are put before it.
- ``make(parameters, session) -> Step``: it may raise ConfigError in the same way.
- optionally ``CONFLICTS``: names of effects that it cannot be named together with, and ``SHARED``:
  a dict from its keys to what they say of the instrument ({"frequency_hz": "excitation
  frequency"}), on which named effects must agree.

Times: ``time_s`` is in seconds from the first recorded frame, on the same axis as the touches'
    keyframes, so that it is
NEGATIVE during the quiet frames. ``frame`` counts all frames from 0, quiet ones first.

A step's ``apply`` is a pure function of its arguments: the same frame gives the same result however
often and in whatever order it is called, and it leaves its arguments as they are. What is random
per frame is drawn from ``session.stream(NAME, frame)``, made again for that frame; what is random
once is drawn in ``make`` from ``session.stream(NAME)`` (index 0) or ``session.stream(NAME + "
part")``. Several parts: several names.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum
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
    """Where in the line from the sheet to the number a step stands; steps run in this order."""

    GEOMETRY = 0  # where the electrodes truly are: once, before meshing
    MATERIAL = 1  # conductivity of the sheet, per element, by time
    BOUNDARY = 2  # contacts: impedance per electrode, which electrodes are detached or bridged
    EXCITATION = 3  # the current: phase (complex solve), source output impedance, amplitude drift
    FRONT_END = 4  # from true boundary voltages to the amplifier's output
    DIGITISE = 5  # from there to codes: noise, saturation, ADC bits, jitter; always real numbers


@dataclass(frozen=True)
class EffectCost:
    """What a step adds, once a session and once a frame.

    A vector pass reads or writes a vector of all voltages, elements or electrodes once.
    """

    factorisations: float = 0
    factorisations_per_frame: float = 0
    solves_per_frame: float = 0
    vector_passes_per_frame: float = 0
    random_numbers: int = 0
    random_numbers_per_frame: int = 0


@dataclass(frozen=True, eq=False)
class EffectSession:
    """What an effect's ``make`` is given.

    Attributes:
        skin: as described, before any geometry step.
        protocol: the scan; m rows.
        n_frames: all frames, quiet ones included.
        quiet_frames: how many of them are quiet, at the start.
        rate_hz: frames per second.
        seed: the scene's.
        build_mesh: use ``mesh``.
        solve_v0: use ``v0_v``.
        make_stream: use ``stream``.
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

    @property
    def mesh(self) -> Mesh:
        """The mesh that is solved on, made when first asked for (not to be asked for by geometry
        effects)."""
        return self.build_mesh()

    def times_s(self) -> FloatArray:
        """Each frame's time (n_frames,), below 0 for quiet ones."""
        return np.asarray((np.arange(self.n_frames) - self.quiet_frames) / self.rate_hz)

    def v0_v(self) -> FloatArray:
        """The exact frame (m,) of the untouched skin as described, with ideal electrodes and no
        effect at all.

        It does not depend on which effects are named, so that a signal-to-noise ratio means the
        same volts always.
        """
        return self.solve_v0()

    def v0_rms_v(self) -> float:
        """The root mean square of ``v0_v`` over its rows: SNR_dB = 20 log10(v0_rms_v / sigma)."""
        return float(np.sqrt(np.mean(self.v0_v() ** 2)))

    def stream(self, name: str, index: int = 0) -> np.random.Generator:
        """A generator keyed by (seed, ``name``, ``index``); ``name`` begins with the effect's."""
        return self.make_stream(name, index)

    def limit_v(self, given_v: float | None, headroom: float | None) -> float:
        """A limit in V: as given, or ``headroom`` (None: 1.25) times the largest of ``v0_v``."""
        if given_v is not None:
            return given_v
        return (1.25 if headroom is None else headroom) * float(np.abs(self.v0_v()).max())

    def refuse_absent(self, electrodes: Iterable[int]) -> None:
        """Refuse electrodes that the skin has not, as those of a key ``electrodes``."""
        count = self.skin.electrodes.count
        for electrode in electrodes:
            if not 0 <= electrode < count:
                raise ConfigError(
                    f"electrodes: {electrode} does not exist; the skin's are 0 to {count - 1}"
                )


def part_at(time_s: float, at_s: float, rise_s: float) -> float:
    """The part of a change after the tare that has happened at ``time_s``: 0 before ``at_s``, then
    in proportion to time until it is whole ``rise_s`` later (0: at once)."""
    if time_s < at_s:
        return 0.0
    return 1.0 if rise_s <= 0 else min(1.0, (time_s - at_s) / rise_s)


@dataclass(frozen=True, eq=False)
class Contacts:
    """The electrodes' contacts at one time.

    ``impedance_ohm_m2`` (L,) is 0 for an ideal shunt. ``detached`` (L,) marks electrodes that touch
    the sheet nowhere (open circuit; a badly touching one is a large impedance instead). ``bridges``
    are resistors (i, j, ohm >= 0) between electrodes.
    """

    impedance_ohm_m2: FloatArray
    detached: BoolArray
    bridges: tuple[tuple[int, int, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Loads:
    """Potentials of the four electrodes of each row while it is read, (m,) V, against the mean of
    all electrodes.

    The load of row r is (``source_v[r]`` - ``sink_v[r]``) / ``current_a`` in ohm, contacts
    included. Complex after a phase step.
    """

    source_v: Voltages
    sink_v: Voltages
    plus_v: Voltages
    minus_v: Voltages
    current_a: float


@dataclass(frozen=True, eq=False)
class GeometryStep:
    """``apply(skin) -> skin``: what is meshed. Once."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[Skin], Skin]
    stage: Stage = Stage.GEOMETRY


@dataclass(frozen=True, eq=False)
class MaterialStep:
    """``apply(conductivity (E,) S/m, time_s, frame) -> (E,)``, before touches; applied once unless
    it ``varies``. ``same(time_s, frame)``: frames for which it gives the same number share a solve;
    without it each frame that varies has its own."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[FloatArray, float, int], FloatArray]
    varies: bool = False
    same: Callable[[float, int], float] | None = None
    stage: Stage = Stage.MATERIAL


@dataclass(frozen=True, eq=False)
class DeformationStep:
    """``apply(time_s, frame) -> Deformation`` of sheet and electrodes, one upon another. Frames
    that are deformed alike share a solve."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[float, int], Deformation]
    varies: bool = True
    stage: Stage = Stage.MATERIAL


@dataclass(frozen=True, eq=False)
class ContactStep:
    """``apply(contacts, time_s, frame) -> Contacts``; applied once unless it ``varies``."""

    name: str
    cost: EffectCost
    note: str
    apply: Callable[[Contacts, float, int], Contacts]
    varies: bool = False
    stage: Stage = Stage.BOUNDARY


@dataclass(frozen=True, eq=False)
class PhaseStep:
    """Makes the forward solve complex, at ``frequency_hz``.

    ``admittivity(conductivity (E,) S/m) -> (E,) complex S/m``, element by element;
    ``contact(impedance (L,) ohm m2) -> (L,) complex ohm m2``, in which 0 is an ideal shunt;
    ``readout(v (m,) complex) -> (m,) float``, taken just before the digitising stage.
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
    """``apply(v (m,), loads, time_s, frame) -> (m,)``: uses electrode potentials (source impedance,
    common mode)."""

    name: str
    stage: Stage
    cost: EffectCost
    note: str
    apply: Callable[[Voltages, Loads, float, int], Voltages]


@dataclass(frozen=True, eq=False)
class VoltageStep:
    """``apply(v (m,), time_s, frame) -> (m,)``. Rows are in the order of the scan, evenly over the
    frame's time."""

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
    """What a module with an effect defines; ``CONFLICTS`` and ``SHARED`` may be left out."""

    NAME: str
    STAGE: Stage
    ORDER: int
    SUMMARY: str
    Parameters: type[Any]

    def make(self, parameters: Any, session: EffectSession) -> Step:
        """The effect's step in this session."""
        ...
