"""The core's results for a judging scene: a digest of every bit, and the numbers by which it is
judged."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, Protocol, TypeAlias

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore
from eitskin.core.options_table import CHOICES
from eitskin.core.results import Info, Reconstruction
from eitskin.errors import EitskinError, FrameError
from eitskin.model.eitm import decode_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.scene.random_touches import TouchScene
from eitskin.scoring import metrics
from eitskin.scoring.matching import match
from eitskin.scoring.score import scorer_for

CROWDED = "crowded"
Named: TypeAlias = Callable[[Info], bool]
Solved: TypeAlias = Reconstruction | FrameError


@dataclass
class Score:
    """Sums over frames.

    Attributes:
        frames, exact: with a known truth; with every touch found and no other.
        errors_mm: distances of found touches from the true ones.
        touched, miou_image, miou_discs: frames with touches; the sums of MIoU of their images and
            of their touches as discs.
        false_names, missing_names: diagnostics that are wrong, and that should have been given.
        gestures_right, gestures_invented: of sessions of gestures.
        macs: multiply-accumulates.
    """

    frames: int = 0
    exact: int = 0
    errors_mm: list[float] = field(default_factory=list)
    touched: int = 0
    miou_image: float = 0.0
    miou_discs: float = 0.0
    false_names: int = 0
    missing_names: int = 0
    gestures_right: int = 0
    gestures_invented: int = 0
    macs: int = 0

    def add(self, other: "Score") -> None:
        """Count ``other`` in."""
        for one in fields(self):
            setattr(self, one.name, getattr(self, one.name) + getattr(other, one.name))


@dataclass(frozen=True)
class Played:
    """The result of a scene: everything that must be equal if the bits are, and its score."""

    bits: Sequence[str]
    score: Callable[[], Score]

    @property
    def digest(self) -> str:
        """The digest of the bits."""
        return hashlib.sha256("\n".join(self.bits).encode()).hexdigest()[:16]


class Scene(Protocol):
    """A judging scene.

    Attributes:
        kind, name: of the scene.
        module: only constants of this module are judged by it; None: all.
    """

    @property
    def kind(self) -> str: ...

    @property
    def name(self) -> str: ...

    @property
    def module(self) -> str | None: ...

    def play(self, runner: "Runner") -> Played:
        """Run the scenes with the present core."""


class Runner:
    """Keeps one core for each stored model; a scene sets all that it depends on."""

    def __init__(self) -> None:
        self._engines: dict[bytes, CoreEngine] = {}

    def engine(self, blob: bytes) -> CoreEngine:
        """Return the engine of a stored model."""
        if blob not in self._engines:
            self._engines[blob] = CoreEngine(blob)
        return self._engines[blob]


@dataclass(frozen=True, eq=False)
class FrameScene:
    """Frames (k, m) V after one tare on ``tare_v`` (q, m).

    Attributes:
        blob: the stored model that solves them.
        truth: of each frame its touches; None where no touches are scored.
        named: of each frame, whether its diagnostics name what is wrong; None where that is not
            asked.
        clean: any name but "crowded" is false.
        stream: the frames follow one another; else each is as if it were the first.
        track: with the options for tracking.
        options: of the core, by name.
        masked: rows that are left out, (m,).
    """

    kind: str
    name: str
    blob: bytes
    tare_v: FloatArray
    frames_v: FloatArray
    truth: Sequence[TouchScene | None]
    named: Sequence[Named | None] = ()
    clean: bool = False
    stream: bool = False
    track: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    masked: BoolArray | None = None
    module: str | None = None

    def play(self, runner: Runner) -> Played:
        """The tare, then every frame."""
        results = solved(runner.engine(self.blob), self)
        return Played([_bits(one) for one in results], lambda: _scored(self, results))


def solved(engine: CoreEngine, scene: FrameScene) -> list[Solved]:
    """Return the core's results for the frames; a frame that it rejects gives its error, and a tare
    that it rejects is the error of every frame."""
    _set_options(engine, scene)
    rows = np.zeros(engine.n_rows, dtype=np.bool_) if scene.masked is None else scene.masked
    engine.mask_rows(rows)
    try:
        engine.set_reference(scene.tare_v)
    except FrameError as error:
        return [error] * len(scene.frames_v)
    engine.forget()
    tracker = FastCore(engine)
    results: list[Solved] = []
    for frame in scene.frames_v:
        if not scene.stream:
            engine.forget()
        try:
            result = engine.reconstruct(frame)
            results.append(tracker.followed(result) if scene.stream else result)
        except FrameError as error:
            results.append(error)
    return results


def _set_options(engine: CoreEngine, scene: FrameScene) -> None:
    """The model's own, those for tracking, both as C sets them, and the scene's."""
    lib, ffi, model, context = engine.handles
    options = ffi.new("eits_options *")
    lib.eits_options_default(model, options)
    if scene.track:
        lib.eits_options_track(options)
    for name, value in scene.options.items():
        choice = CHOICES[name][value] if name in CHOICES else value
        setattr(options, name, int(choice) if isinstance(choice, bool) else choice)
    status = lib.eits_set_options(context, options)
    if status:
        raise EitskinError(f"constants: {scene.name}: the core rejects these options ({status})")


def _bits(one: Solved) -> str:
    """Everything that the core says of a frame, but for times."""
    if isinstance(one, FrameError):
        return str(one)
    info = {name: value for name, value in vars(one.info).items() if not name.endswith("_us")}
    arrays = hashlib.sha256(one.solver_image.tobytes() + one.coefficients.tobytes()).hexdigest()
    return f"{arrays} {one.touches!r} {info!r}"


# ---- scores ----


class Judge:
    """Scores frames by one model, on its raster."""

    def __init__(self, model: Model) -> None:
        self.sign = default_options(model).sign
        self._scorer = scorer_for(model).image_scorer
        self._points = self._scorer.raster.points_mm
        self._threshold = model.defaults.mask_threshold

    def score(self, truth: TouchScene, one: Reconstruction | None, sign: str) -> Score:
        """A frame with known touches; None: the core rejected it."""
        found = () if one is None else one.touches
        matched = match(truth.centres_mm(), [(t.x_mm, t.y_mm) for t in found])
        score = Score(1, int(matched.exact), list(matched.distances_mm))
        if not truth.touches:
            return score
        mask = metrics.disc_mask(self._points, truth.centres_mm(), truth.radii_mm())
        shown = np.zeros_like(mask)
        if one is not None:
            image = np.asarray(one.solver_image, dtype=np.float64)
            image = np.abs(image) if sign == "both" else -image if sign == "decrease" else image
            shown = metrics.touch_mask(self._scorer.lookup.show(image), self._threshold)
        places = np.array([(t.x_mm, t.y_mm) for t in found]).reshape(-1, 2)
        discs = metrics.disc_mask(self._points, places, [t.radius_mm for t in found])
        score.touched = 1
        score.miou_image, score.miou_discs = metrics.miou(shown, mask), metrics.miou(discs, mask)
        return score


@lru_cache(maxsize=8)
def _judge(blob: bytes) -> Judge:
    return Judge(decode_model(blob, "constants"))


def _scored(scene: FrameScene, results: Sequence[Solved]) -> Score:
    judge, total = _judge(scene.blob), Score()
    sign = str(scene.options.get("sign", judge.sign))
    named: Sequence[Named | None] = scene.named or [None] * len(results)
    for result, truth, asked in zip(results, scene.truth, named, strict=True):
        one = None if isinstance(result, FrameError) else result
        if one is not None:
            total.macs += one.info.macs + one.info.touch_macs
        right = None
        if truth is not None:
            score = judge.score(truth, one, sign)
            right = bool(score.exact)
            total.add(score)
        _count_names(total, scene.clean, one, asked, right)
    return total


def _count_names(
    total: Score, clean: bool, one: Reconstruction | None, asked: Named | None, right: bool | None
) -> None:
    """A name is false of a clean frame, and "crowded" of one whose touches are right; it is missing
    where a fault is not named, and where the touches are wrong and nothing at all is named."""
    names = set() if one is None else set(one.info.diagnostics_by_name)
    if asked is not None:
        total.missing_names += one is None or not asked(one.info)
        return
    total.false_names += clean and bool(names - {CROWDED})
    if right is not None:
        total.false_names += right and CROWDED in names
        total.missing_names += not right and not names
