"""Evaluation scenes whose touches extend over time: sessions of gestures, and the fast path's
scans."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.gestures import Gestures, Zone
from eitskin.errors import FrameError
from eitskin.model.model import Model
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments.constants.judged import FrameScene, Played, Runner, Score, solved
from eitskin_studies.experiments.constants.scenes import SceneMaker
from eitskin_studies.experiments.fast_path import rows as fast_rows
from eitskin_studies.experiments.fast_path.scans import Outcome, Player, Scan, TrueInTime
from eitskin_studies.experiments.fast_path.states import ELEMENTS, draw_states
from eitskin_studies.gestures.drawn import DrawnSession, draw_session
from eitskin_studies.gestures.judged import judge, reported_gestures
from eitskin_studies.gestures.simulated import RATE_HZ, Simulator, TouchedFrame

SESSIONS, FAST_SCENES = 6, 1
SNRS_DB = (40.0, 60.0)
ZONES = (
    Zone("right half", corners_mm=((0.0, -90.0), (90.0, -90.0), (90.0, 90.0), (0.0, 90.0))),
    Zone("middle", outer_mm=30.0),
    Zone("ring", inner_mm=30.0, outer_mm=80.0),
)


@dataclass(frozen=True, eq=False)
class GestureScene:
    """Play a session's ``frames`` through the core. ``found`` gives the touches if the core that
    finds them is not judged."""

    session: DrawnSession
    frames: FrameScene
    found: Sequence[TouchedFrame] | None = None
    kind: str = "gestures"
    module: str | None = None

    @property
    def name(self) -> str:
        """Its own."""
        return self.frames.name

    def play(self, runner: Runner) -> Played:
        """Run the scene in the way a board follows touches."""
        macs, found = 0, self.found
        if found is None:
            results = solved(runner.engine(self.frames.blob), self.frames)
            found = found_in(results)
            macs = sum(
                one.info.macs + one.info.touch_macs
                for one in results
                if not isinstance(one, FrameError)
            )
        reported = reported_gestures(found, Gestures())
        zoned = Gestures(ZONES)
        events = [zoned.update(one.touches, one.time_us) for one in found]

        def score() -> Score:
            count = judge(self.session, reported)
            return Score(
                macs=macs, gestures_right=count.right_gestures,
                gestures_invented=count.invented.total(),
            )  # fmt: skip

        return Played([repr(events), str(macs)], score)


def found_in(results: Sequence[Any]) -> list[TouchedFrame]:
    """The touches of each frame."""
    return [
        TouchedFrame(
            round(number * 1e6 / RATE_HZ), () if isinstance(one, FrameError) else one.touches
        )
        for number, one in enumerate(results)
    ]


def gesture_scenes(maker: SceneMaker) -> Iterator[GestureScene]:
    """One session from frames on, at 40 dB, by which the whole core is judged; more from
    touches on, by which the gestures' own constants are."""
    simulator = Simulator(maker.model, maker.workspace.folder / "gestures")
    reach_mm = (paper_skin().outline.diameter_mm or 0.0) / 2
    runner = Runner()
    for number in range(maker.workspace.settings.count(SESSIONS, 1)):
        session = draw_session(reach_mm, maker.seed, "judging", number, each=1)
        volts = simulator.exact_v(session, maker.seed)
        for snr_db in SNRS_DB:
            name = f"gestures {session.name} {snr_db:g} dB"
            tare_v, frames_v = maker.measured(volts[0], volts[1:], snr_db, name)
            frames = FrameScene(
                kind="gestures", name=name, blob=maker.blob, tare_v=tare_v, frames_v=frames_v,
                truth=[None] * len(frames_v), stream=True, track=True,
            )  # fmt: skip
            if number == 0 and snr_db == SNRS_DB[0]:
                yield GestureScene(session, frames)
            found = found_in(solved(runner.engine(maker.blob), frames))
            yield GestureScene(session, frames, found, "gestures from touches")


@dataclass(frozen=True, eq=False)
class FastScene:
    """Scans in time, given drive by drive."""

    kind: str
    name: str
    model: Model
    blob: bytes
    tare_v: FloatArray
    scan: Scan
    volts: FloatArray
    truth: Sequence[TrueInTime]
    fault: tuple[str, ...]
    module: str | None = "fast"

    def play(self, runner: Runner) -> Played:
        """Its touches after each drive."""
        player = Player(self.model, self.blob)
        player.engine.set_reference(self.tare_v)
        player.engine.forget()
        player.fast.begin()
        out = player.play(self.scan, self.volts, self.truth)

        def score() -> Score:
            errors = [one for some in out.errors for one in some]
            exact = not out.false and all(out.first)
            right = any(name in out.named for name in self.fault)
            return Score(
                1, int(exact), errors, false_names=int(bool(out.named) and not self.fault),
                missing_names=int(bool(self.fault) and not right),
            )  # fmt: skip

        return Played([repr(out)], score)


class _Keeper(Player):
    """Keeps its scenes instead of running them."""

    given: tuple[Scan, FloatArray, Sequence[TrueInTime]]
    tare_v: FloatArray

    def tare(self, v0: FloatArray, sigma: float, rng: np.random.Generator) -> None:
        self.tare_v = v0 + sigma * rng.standard_normal((16, len(v0)))

    def play(self, scan: Scan, volts: FloatArray, truth: Sequence[TrueInTime]) -> Outcome:
        self.given = scan, volts, truth
        return Outcome()


def fast_scenes(maker: SceneMaker) -> Iterator[FastScene]:
    """Each line of ``eitskin study fast-path`` on the prebuilt skin."""
    count = maker.workspace.settings.count(FAST_SCENES, 1)
    states = {
        kind: draw_states(maker.model, kind, count, maker.seed, ELEMENTS)
        for kind in ("presses", "swipes", "pairs")
    }
    keeper = _Keeper(maker.model, maker.blob)
    for number, row in enumerate(fast_rows()):
        for k in range(count):
            rng = np.random.default_rng([maker.seed, number, k])
            v0 = states[row.kind].v0[k]
            sigma = float(np.sqrt(np.mean(v0**2))) / 10 ** (row.snr_db / 20)
            keeper.tare(v0, sigma, rng)
            row.make(keeper, states[row.kind], k, rng, sigma)
            yield FastScene(
                "fast path", f"{row.name} {k}", maker.model, maker.blob, keeper.tare_v,
                *keeper.given, row.fault,
            )  # fmt: skip
