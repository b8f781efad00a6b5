"""Count how often a fault of a frame is named correctly, and measure its effect on the image, with
the diagnostics and without.

Every frame is compared with the same one without the fault: same scene, contacts, noise and
reference. Rules and thresholds were chosen under other seeds (docs/reference/diagnostics.md).
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.results import Info, Reconstruction
from eitskin.errors import FrameError
from eitskin.model.prebuilt import load_prebuilt
from eitskin.progress import Progress, silent
from eitskin.scene.random_touches import TouchScene
from eitskin.scoring import metrics
from eitskin.scoring.score import scorer_for
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.benchmarks.diagnostics_faults import (
    CROWDED,
    DETACHED,
    FAULTS,
    NONE,
    InjectedFault,
)
from eitskin_studies.benchmarks.diagnostics_scenes import (
    IMPERFECT,
    PROTOCOL,
    UNTOUCHED_FRAMES,
    CaseMaker,
    SceneCase,
    drawn,
)
from eitskin_studies.harness.discs import spaced_touches
from eitskin_studies.harness.sessions import copied

SNRS_DB, HEADLINE_DB, BETWEEN_DB = (40.0, 60.0, 80.0), 60.0, 50.0
MAX_TOUCHES, SPACINGS = 12, (2.5, 4.0)  # radii
IMPERFECT_DB = 60.0
NORMAL_95 = 1.96


@dataclass(frozen=True)
class Mean:
    """Statistics of differences over scenes: their mean, half of its 95 % interval (1.96 standard
    errors), the mean of the worst tenth."""

    mean: float
    half_95: float
    worst_tenth: float


@dataclass(frozen=True)
class DetectionRate:
    """A fault at one SNR over all scenes.

    ``named``: share called by its name; ``other``: share about which anything but "crowded" was
    said; ``crowded``; ``miou``: mean of the spoilt frames' images. ``lost``: image MIoU lost;
    ``lost_discs``: that of the touches as discs; ``lost_blind``: with the diagnostics off, at 60
    dB; ``peak_lost``: share of the peak, gain apart.
    """

    fault: str
    snr_db: float
    scenes: int
    refused: int
    named: float | None
    other: float
    crowded: float
    miou: float | None
    lost: Mean | None
    lost_discs: Mean | None
    lost_blind: Mean | None
    peak_lost: Mean | None


@dataclass(frozen=True)
class Crowd:
    """Frames of ``touches`` equal touches: how many there are, how many with the right count, how
    many said to be crowded, and how many of those with the right count."""

    touches: int
    snr_db: float
    frames: int
    right: int
    said: int
    right_said: int


@dataclass(frozen=True)
class Imperfect:
    """Clean frames behind an imperfect front end: how many, and about how many anything but
    "crowded" was said, by scan."""

    effect: str
    frames: int
    full: int
    half: int


@dataclass(frozen=True)
class Findings:
    """All of a run."""

    seed: int
    rates: tuple[DetectionRate, ...]
    crowds: tuple[Crowd, ...]
    imperfect: tuple[Imperfect, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def rate(self, fault: str, snr_db: float = HEADLINE_DB) -> DetectionRate:
        """One of them."""
        return next(one for one in self.rates if (one.fault, one.snr_db) == (fault, snr_db))


@dataclass(frozen=True)
class _Seen:
    """One frame: what was said (None: refused), MIoU of image and discs, the image's peak."""

    info: Info | None
    image: float
    discs: float
    peak: float

    def says_other(self) -> bool:
        return self.info is not None and bool(set(self.info.diagnostics_by_name) - {CROWDED})

    def says_crowded(self) -> bool:
        return self.info is not None and CROWDED in self.info.diagnostics_by_name


class _Eye:
    """Tares on untouched frames and judges what comes after, each frame as if it were the first."""

    def __init__(self) -> None:
        model, blob = load_prebuilt()
        self._solver = Reconstructor(model, blob=blob)
        self._all = self._solver.options.diagnostics
        self._image_scorer, self._threshold = (
            scorer_for(model).image_scorer,
            model.defaults.mask_threshold,
        )
        self._points = self._image_scorer.raster.points_mm

    def truth(self, scene: TouchScene) -> BoolArray:
        return metrics.disc_mask(self._points, scene.centres_mm(), scene.radii_mm())

    def tare(self, untouched_v: FloatArray) -> None:
        self._solver.set_options(diagnostics=self._all)
        self._solver.tare(untouched_v)

    def look(self, frame_v: FloatArray, blind: bool = False) -> Reconstruction | None:
        """None if the frame is refused."""
        self._solver.set_options(diagnostics=0 if blind else self._all)
        self._solver.forget()
        try:
            return self._solver.reconstruct(frame_v)
        except FrameError:
            return None

    def see(self, frame_v: FloatArray, truth: BoolArray, blind: bool = False) -> _Seen:
        """A frame that is refused shows nothing."""
        result = self.look(frame_v, blind)
        if result is None:
            nothing = metrics.miou(np.zeros_like(truth), truth)
            return _Seen(None, nothing, nothing, 0.0)
        image = np.asarray(result.solver_image, dtype=np.float64)
        shown = metrics.touch_mask(self._image_scorer.lookup.show(image), self._threshold)
        centres, radii = (
            [(t.x_mm, t.y_mm) for t in result.touches],
            [t.radius_mm for t in result.touches],
        )
        discs = metrics.disc_mask(self._points, centres, radii)
        return _Seen(
            result.info, metrics.miou(shown, truth), metrics.miou(discs, truth), float(image.max())
        )


@dataclass(frozen=True)
class _Sample:
    named: bool | None
    seen: _Seen
    clean: _Seen
    blind: _Seen | None
    clean_blind: _Seen | None


Samples = dict[tuple[str, float], list[_Sample]]


def _frames(case: SceneCase, fault: InjectedFault, snr_db: float) -> FloatArray:
    """The frame with the fault (m,) V."""
    exact = fault.volts(case, case.volts["touched"])
    reading = fault.readings(case, case.measured(exact[None], snr_db, "frame")[0])
    return copied(reading, PROTOCOL) if fault.half else reading


def _untouched(case: SceneCase, fault: InjectedFault, snr_db: float) -> FloatArray:
    rest = case.volts["touched" if fault.lifted else "quiet"]
    measured = case.measured(np.tile(rest, (UNTOUCHED_FRAMES, 1)), snr_db, "quiet")
    return copied(measured, PROTOCOL) if fault.half else measured


def _look_at(
    case: SceneCase, snr_db: float, faults: Sequence[InjectedFault], eye: _Eye, samples: Samples
) -> None:
    """All ``faults`` of a case, those of a kind of reference after one another."""
    truth = eye.truth(case.scene)
    for half, lifted in sorted({(fault.half, fault.lifted) for fault in faults}):
        of_kind = [fault for fault in faults if (fault.half, fault.lifted) == (half, lifted)]
        eye.tare(_untouched(case, of_kind[0], snr_db))
        frame = _frames(case, InjectedFault(NONE, None, half=half), snr_db)
        clean = eye.see(frame, truth)
        judged_blind = snr_db == HEADLINE_DB and not lifted
        clean_blind = eye.see(frame, truth, blind=True) if judged_blind else None
        for fault in of_kind:
            spoilt = _frames(case, fault, snr_db)
            seen = eye.see(spoilt, truth)
            named = (
                None
                if fault.named is None
                else seen.info is not None and fault.named(case, seen.info)
            )
            blind = eye.see(spoilt, truth, blind=True) if judged_blind else None
            samples[fault.name, snr_db].append(_Sample(named, seen, clean, blind, clean_blind))


def mean_of(differences: Iterable[float]) -> Mean | None:
    """Return the statistics of one number per scene; None if there is none."""
    values = np.sort(np.asarray(list(differences), dtype=np.float64))
    if not len(values):
        return None
    tenth = max(1, len(values) // 10)
    spread = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    return Mean(
        float(values.mean()), NORMAL_95 * spread / len(values) ** 0.5, float(values[-tenth:].mean())
    )


def _rate(fault: InjectedFault, snr_db: float, samples: Sequence[_Sample]) -> DetectionRate:
    named = None if fault.named is None else float(np.mean([one.named for one in samples]))
    other = float(np.mean([one.seen.says_other() for one in samples]))
    crowded = float(np.mean([one.seen.says_crowded() for one in samples]))
    refused = sum(one.seen.info is None for one in samples)
    if fault.lifted:
        return DetectionRate(
            fault.name,
            snr_db,
            len(samples),
            refused,
            named,
            other,
            crowded,
            None,
            None,
            None,
            None,
            None,
        )
    blind = [
        o.clean_blind.image - o.blind.image
        for o in samples
        if o.blind is not None and o.clean_blind is not None
    ]
    gain = fault.gain
    return DetectionRate(
        fault.name, snr_db, len(samples), refused, named, other, crowded,
        float(np.mean([one.seen.image for one in samples])),
        mean_of(one.clean.image - one.seen.image for one in samples),
        mean_of(one.clean.discs - one.seen.discs for one in samples),
        mean_of(blind),
        None if gain is None else mean_of(
            1 - o.seen.peak / (gain * o.clean.peak) for o in samples if o.clean.peak > 0
        ),
    )  # fmt: skip


def rates(
    seed: int, scenes: int, eye: _Eye, table: CaseMaker, progress: Progress = silent
) -> tuple[DetectionRate, ...]:
    """Every fault at 40, 60 and 80 dB, and clean and detached frames at 50 dB."""
    samples: Samples = defaultdict(list)
    few = [fault for fault in FAULTS if fault.name in (NONE, DETACHED)]
    all_scenes = drawn(seed, scenes)
    for number in progress(range(scenes)):
        (case,) = table.cases([number], all_scenes)
        for snr_db in SNRS_DB:
            _look_at(case, snr_db, FAULTS, eye, samples)
        _look_at(case, BETWEEN_DB, few, eye, samples)
    by_name = {fault.name: fault for fault in FAULTS}
    return tuple(_rate(by_name[name], snr_db, each) for (name, snr_db), each in samples.items())


def crowds(
    seed: int, frames: int, eye: _Eye, table: CaseMaker, progress: Progress = silent
) -> tuple[Crowd, ...]:
    """``frames`` scenes of 1 to 12 touches of radius 9 mm and contrast 5, half of them at least
    2.5, half 4 radii apart."""
    outline, found = paper_skin().outline, []
    for count in progress(range(1, MAX_TOUCHES + 1)):
        scenes = [s for k, spacing in enumerate(SPACINGS)
                  for s in spaced_touches(outline, seed, (frames + 1 - k) // 2, count,
                  spacing).scenes]  # fmt: skip
        cases = [table.plain(10_000 * count + k, scene) for k, scene in enumerate(scenes)]
        for snr_db in SNRS_DB:
            right, said = np.zeros(len(cases), dtype=np.bool_), np.zeros(len(cases), dtype=np.bool_)
            for k, case in enumerate(cases):
                eye.tare(_untouched(case, FAULTS[0], snr_db))
                result = eye.look(_frames(case, FAULTS[0], snr_db))
                if result is not None:
                    right[k] = len(result.touches) == count
                    said[k] = CROWDED in result.info.diagnostics_by_name
            found.append(
                Crowd(
                    count,
                    snr_db,
                    len(cases),
                    int(right.sum()),
                    int(said.sum()),
                    int((right & said).sum()),
                )
            )
    return tuple(found)


def imperfect(
    seed: int, frames: int, eye: _Eye, table: CaseMaker, progress: Progress = silent
) -> tuple[Imperfect, ...]:
    """``frames`` scenes behind each front end, the reference taken behind the same."""
    scenes, found = drawn(seed, frames), []
    for effect in progress(list(IMPERFECT)):
        said = {False: 0, True: 0}
        for k, scene in enumerate(scenes):
            effects = {"noise": {"snr_db": IMPERFECT_DB}} | IMPERFECT[effect]
            volts = table.frames(k, scene, effects, quiet_frames=UNTOUCHED_FRAMES)
            for half in said:
                shown = copied(volts, PROTOCOL) if half else volts
                eye.tare(shown[:UNTOUCHED_FRAMES])
                result = eye.look(shown[UNTOUCHED_FRAMES])
                said[half] += result is None or bool(
                    set(result.info.diagnostics_by_name) - {CROWDED}
                )
        found.append(Imperfect(effect, frames, said[False], said[True]))
    return tuple(found)


def run(
    seed: int, scenes: int, crowd_frames: int, imperfect_frames: int, *, progress: Progress = silent
) -> Findings:
    """All three tables.

    Raises:
        UsageError: the C core is not built.
        MissingExtraError: the mesher or scipy is not installed.
    """
    eye, table = _Eye(), CaseMaker(seed)
    return Findings(
        seed,
        rates(seed, scenes, eye, table, progress),
        crowds(seed, crowd_frames, eye, table, progress),
        imperfect(seed, imperfect_frames, eye, table, progress),
    )
