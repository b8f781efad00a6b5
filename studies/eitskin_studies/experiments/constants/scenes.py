"""The judging scenes: few of each kind, so that each constant of the core is reached by some.

Seeds: everything is drawn with 30 + the study's seed, sets of other worlds from the family
"judging", sessions of gestures from the role "judging". No constant was chosen on any of these.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.options_table import CHOICES
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.compiler import compile_scene
from eitskin.scene.random_touches import TouchScene, TrueTouch
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scene.simulate import measure
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import paper_skin
from eitskin_studies.benchmarks.diagnostics_faults import FAULTS, InjectedFault
from eitskin_studies.benchmarks.diagnostics_scenes import (
    IMPERFECT,
    PROTOCOL,
    CaseMaker,
    SceneCase,
    drawn,
)
from eitskin_studies.experiments.constants.judged import FrameScene
from eitskin_studies.experiments.constants.streams import (
    TouchStream,
    passing_streams,
    random_streams,
)
from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.harness.discs import spaced_touches
from eitskin_studies.harness.sessions import converter_for, copied
from eitskin_studies.harness.snr import noise_deviation_v
from eitskin_studies.worlds.simulate import WorldFactory
from eitskin_studies.worlds.worlds import WORLDS

FIRST_SEED = 30
TARE_FRAMES = 16
WORLD_SCENES, FAULT_SCENES = 10, 3
DRIFT_FRAMES, FOLLOWED = 120, (32, 128)
PASSING_MM_S = 100
CROWDS = (4, 6, 7, 9, 12)


@dataclass(eq=False)
class SceneMaker:
    """Makes the scenes on the prebuilt model; what has to be simulated is kept in the workspace."""

    workspace: Workspace
    model: Model
    blob: bytes
    meshes: MeshCache

    @classmethod
    def of(cls, workspace: Workspace) -> "SceneMaker":
        """For the prebuilt model."""
        return cls(workspace, *load_prebuilt()[:2], MeshCache())

    @property
    def seed(self) -> int:
        """The first seed of everything that is drawn."""
        return FIRST_SEED + self.workspace.settings.seed

    def scenes(self) -> list[FrameScene]:
        """All that the whole-frame solver is judged by."""
        worlds = list(self._worlds())
        return [
            *worlds,
            *self._crowds(),
            *_solvers(worlds),
            *_left_out(worlds, self.model.protocol),
            *self._faults(),
            *self._imperfect(),
            *_odd_references(worlds, self.model.protocol),
            *self._streams(),
            *self._drifting(worlds),
        ]

    def _scene(self, kind: str, name: str, **facts: Any) -> FrameScene:
        return FrameScene(kind=kind, name=name, blob=self.blob, **facts)

    # ---- frames by themselves ----

    def _worlds(self) -> Iterator[FrameScene]:
        """Each set of other worlds, as ``eitskin bench worlds`` scores them."""
        folder = self.workspace.folder / "worlds"
        factory = WorldFactory(self.model.skin, self.model.protocol, folder)
        count = self.workspace.settings.count(WORLD_SCENES, 1)
        for name in WORLDS:
            made = factory.scenes(name, count, self.seed, family="judging")
            for k, scene in enumerate(made.scenes):
                step_v = float(made.step_v[k])
                options: dict[str, Any] = {"noise_floor_v": step_v / np.sqrt(12)}
                if made.world.sign is not None:
                    options["sign"] = made.world.sign
                yield self._scene(
                    name, scene.name, tare_v=made.untouched_v[k][-TARE_FRAMES:],
                    frames_v=made.frames_v[k][None], truth=(scene,), options=options,
                    clean=name in ("discs_1_to_3", "no_touch"),
                )  # fmt: skip

    def _crowds(self) -> Iterator[FrameScene]:
        """Equal discs, near and far, at 40 and 60 dB."""
        maker = CaseMaker(self.seed)
        for touches in CROWDS:
            for spacing in (2.5, 4.0):
                scene = spaced_touches(paper_skin().outline, self.seed, 1, touches, spacing).scenes[
                    0
                ]
                case = self._case(maker, f"crowd {touches} {spacing}", 100 + touches, scene)
                for snr_db in (40.0, 60.0):
                    yield self._of_case("crowds", case, snr_db, [(FAULTS[0], case.scene)])

    def _faults(self) -> Iterator[FrameScene]:
        """Every fault of ``eitskin bench diagnostics``, at 60 dB and fewer scenes at 40 dB."""
        count = self.workspace.settings.count(FAULT_SCENES, 1)
        maker, scenes = CaseMaker(self.seed), drawn(self.seed, count)
        for number in range(count):
            case = self._case(maker, f"faults {number}", number, scenes[number], faults=True)
            for snr_db in (60.0, 40.0)[: 1 if number else 2]:
                for half, lifted in sorted({(one.half, one.lifted) for one in FAULTS}):
                    some = [f for f in FAULTS if (f.half, f.lifted) == (half, lifted)]
                    reported = [(f, None if f.lifted else case.scene) for f in some]
                    yield self._of_case("faults", case, snr_db, reported)

    def _case(
        self, maker: CaseMaker, name: str, number: int, scene: TouchScene, *, faults: bool = False
    ) -> SceneCase:
        def make() -> dict[str, FloatArray]:
            made = next(maker.cases([number], _at(number, scene))) if faults else None
            return dict((made or maker.plain(number, scene)).volts)

        volts = self.workspace.kept_arrays({"study": "constants", "case": name}, make)
        return SceneCase(self.seed, number, scene, volts)

    def _of_case(
        self,
        kind: str,
        case: SceneCase,
        snr_db: float,
        faults: Sequence[tuple[InjectedFault, TouchScene | None]],
    ) -> FrameScene:
        first = faults[0][0]
        rest = case.volts["touched" if first.lifted else "quiet"]
        tare_v = case.measured(np.tile(rest, (TARE_FRAMES, 1)), snr_db, "quiet")
        frames_v = [
            one.readings(case, case.measured(one.volts(case, case.volts["touched"])[None], snr_db,
                                             "frame")[0])
            for one, _ in faults
        ]  # fmt: skip
        if first.half:
            tare_v = copied(tare_v, PROTOCOL)
            frames_v = [copied(one, PROTOCOL) for one in frames_v]
        return self._scene(
            kind, f"{kind} {case.number} {snr_db:g} dB {first.name}", tare_v=tare_v,
            frames_v=np.array(frames_v), truth=[scene for _, scene in faults],
            named=[None if f.named is None else partial(f.named, case) for f, _ in faults],
        )  # fmt: skip

    def _imperfect(self) -> Iterator[FrameScene]:
        """Clean frames behind each imperfect front end, full and half scans: whatever is named is
        false."""
        maker, scene = CaseMaker(self.seed), drawn(self.seed, 1)[0]
        for effect, facts in IMPERFECT.items():
            effects = {"noise": {"snr_db": 60.0}} | facts
            volts = self.workspace.kept_arrays(
                {"study": "constants", "imperfect": effect},
                lambda effects=effects: {  # type: ignore[misc]
                    "volts": maker.frames(0, scene, effects, quiet_frames=TARE_FRAMES)
                },
            )["volts"]
            for half in (False, True):
                shown = copied(volts, PROTOCOL) if half else volts
                yield self._scene(
                    "front ends", f"{effect}{', half' * half}", tare_v=shown[:TARE_FRAMES],
                    frames_v=shown[TARE_FRAMES:], truth=(scene,), clean=True,
                )  # fmt: skip

    # ---- streams ----

    def _streams(self) -> Iterator[FrameScene]:
        """Fingers that come, move and go at 40 dB; two that pass one another, at 60 dB."""
        outline = paper_skin().outline
        listed = [
            *(random_streams(outline, self.seed, "constants", speed, 1)[0]
              for speed in (0, 50, 200)),
            passing_streams(self.seed, PASSING_MM_S, 1)[0],
        ]  # fmt: skip
        for one in listed:
            volts = self._stream_v(one)
            snr_db = 60.0 if one.speed_mm_s == PASSING_MM_S else 40.0
            tare_v, frames_v = self.measured(volts[0], volts[1:], snr_db, one.name)
            yield self._scene(
                "moving fingers", f"{one.name} {snr_db:g} dB", tare_v=tare_v,
                frames_v=frames_v, truth=[_there(one, k) for k in range(len(frames_v))],
                stream=True, track=True,
            )  # fmt: skip

    def _stream_v(self, one: TouchStream) -> FloatArray:
        def make() -> dict[str, FloatArray]:
            made = compile_scene(one.scene(), mesh_cache=self.meshes)
            return {"volts": simulate_frames(made).voltage_v}

        return self.workspace.kept_arrays(
            {"study": "constants", "stream": one.name, "seed of it": self.seed}, make
        )["volts"]

    def measured(
        self, rest_v: FloatArray, frames_v: FloatArray, snr_db: float, name: str
    ) -> tuple[FloatArray, FloatArray]:
        """Tare frames of ``rest_v`` (m,) and the frames (k, m), with noise and a converter."""
        how = converter_for(snr_db)
        span_v = how.adc_headroom * float(np.abs(rest_v).max())
        assert how.adc_bits is not None
        lsb_v = 2 * span_v / 2**how.adc_bits
        converter = (noise_deviation_v(rest_v, snr_db), lsb_v, span_v, self.seed)
        untouched_v = np.tile(rest_v, (TARE_FRAMES, 1))
        tare_v, _ = measure(untouched_v, *converter, f"quiet {name}")
        return tare_v, measure(frames_v, *converter, f"frame {name}")[0]

    def _drifting(self, worlds: Sequence[FrameScene]) -> Iterator[FrameScene]:
        """A skin that changes by a smooth 2 % while its reference follows, with three presses."""
        drifts = [one for one in worlds if one.kind == "no_touch_drift_2_percent"]
        touched = [one for one in worlds if one.kind == "discs_1_to_3"]
        for k, frames in zip(range(len(drifts)), FOLLOWED, strict=False):
            rest_v = drifts[k].tare_v.mean(axis=0)
            change_v = drifts[k].frames_v[0] - rest_v
            press_v = touched[k].frames_v[0] - touched[k].tare_v.mean(axis=0)
            at = np.arange(DRIFT_FRAMES)
            there = (at % 60 >= 40) & (at % 60 < 52)
            exact_v = rest_v + np.outer(at / DRIFT_FRAMES, change_v) + np.outer(there, press_v)
            tare_v, frames_v = self.measured(rest_v, exact_v, 60.0, f"drift {k}")
            scene = touched[k].truth[0]
            nothing = TouchScene("nothing", ())
            yield self._scene(
                "drift followed", f"drift {k}, {frames} frames", tare_v=tare_v,
                frames_v=frames_v, truth=[scene if one else nothing for one in there],
                stream=True, track=True, options={"reference_frames": frames},
            )  # fmt: skip


def _at(number: int, scene: TouchScene) -> tuple[TouchScene, ...]:
    """``scene`` at this place of a tuple."""
    return (scene,) * (number + 1)


def _there(one: TouchStream, frame: int) -> TouchScene:
    _, places, radii = one.true_mm(frame)
    touches = [
        TrueTouch(float(x), float(y), float(r), 5.0)
        for (x, y), r in zip(places, radii, strict=True)
    ]
    return TouchScene(f"{one.name} {frame}", tuple(touches))


# ---- made of other scenes ----


def _solvers(worlds: Sequence[FrameScene]) -> Iterator[FrameScene]:
    """Other solvers than the default, with a duality gap to reach, and a MAC limit."""
    kinds = ("discs_1_to_3", "eight_at_4_radii", "light_touches")
    some = [next(one for one in worlds if one.kind == kind) for kind in kinds]
    ways: list[dict[str, Any]] = [{"solver": name} for name in CHOICES["solver"]]
    ways += [{"solver": name, "gap_rel": 1e-4, "iterations": 500} for name in CHOICES["solver"]]
    ways += [{"mac_limit": 250_000}, {"warm_start": True}, {"lambda_rel": 0.003}]
    for options in ways:
        for one in some:
            text = ", ".join(f"{key} {value}" for key, value in options.items())
            yield replace(
                one, kind="solvers", name=f"{one.name}, {text}",
                options={**one.options, **options}, clean=False,
            )  # fmt: skip


def _left_out(worlds: Sequence[FrameScene], protocol: Protocol) -> Iterator[FrameScene]:
    """Return sets of masked rows: one row, those of one electrode, and those of three
    electrodes."""
    pairs = protocol.drive_measure
    for electrodes in ((), (3,), (3, 4), (3, 8, 12)):
        masked = np.asarray(np.isin(pairs, electrodes).any(axis=1))
        masked[7] = True
        for kind in ("discs_1_to_3", "light_touches", "no_touch"):
            for one in [one for one in worlds if one.kind == kind][:2]:
                yield replace(
                    one, kind="rows left out", name=f"{one.name}, without {electrodes}",
                    masked=masked, clean=False,
                )  # fmt: skip


def _odd_references(worlds: Sequence[FrameScene], protocol: Protocol) -> Iterator[FrameScene]:
    """References with readings that are off, of few frames, and without any noise."""
    for one in [one for one in worlds if one.kind in ("discs_1_to_3", "no_touch")][::6]:
        rms_v = float(np.sqrt(np.mean(one.tare_v**2)))
        for size in (0.003, 0.01, 0.03, 0.3):
            for rows in ((20,), (20, 77, 140)):
                off = one.tare_v.copy()
                for k, row in enumerate(rows):
                    off[2 + k, row] += size * rms_v
                for half in (False, True):
                    tare_v = copied(off, protocol) if half else off
                    frames_v = copied(one.frames_v, protocol) if half else one.frames_v
                    name = f"{one.name}, {len(rows)} readings off by {size:g}{', half' * half}"
                    yield replace(
                        one, kind="odd references", name=name, tare_v=tare_v, frames_v=frames_v,
                        clean=False,
                    )  # fmt: skip
        for count in (1, 2, 4):
            yield replace(
                one, kind="odd references", name=f"{one.name}, of {count} frames",
                tare_v=one.tare_v[:count], clean=False,
            )  # fmt: skip
        exact = np.tile(one.tare_v.mean(axis=0), (4, 1))
        yield replace(
            one, kind="odd references", name=f"{one.name}, without noise", tare_v=exact,
            clean=False, options={"noise_floor_v": 0.0},
        )  # fmt: skip
