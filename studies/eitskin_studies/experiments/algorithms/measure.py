"""The measurements: curves of MIoU over the threshold, positions, counts and MACs, in parts that
are kept as soon as they are computed."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray, FloatArray
from eitskin.scoring import metrics
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.solve.image_touches import touches_in_image
from eitskin_studies.compare.families import FindsTouches, Learns, Method, Setup, setup_for
from eitskin_studies.experiments.algorithms.candidates import Candidate, macs_of
from eitskin_studies.experiments.algorithms.scenes import NUMBERS, SHOWN, shown_set, touch_set
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, SIMULATED_ELEMENTS, Workspace
from eitskin_studies.harness.sessions import FrameSession, SceneSolver
from eitskin_studies.harness.thresholds import best_threshold, match_all, miou_curves

Arrays = dict[str, AnyArray]

SNR_DB = 60.0
TOUCH_THRESHOLDS = tuple(round(0.1 * k, 1) for k in range(1, 10))
TUNING, TEST = "tuning", "test"


@dataclass(frozen=True)
class ChosenParameter:
    """The choices made on tuning scenes: the parameter's ``value``, t of MIoU for each lookup, and
    t of positions (None if the method reports touches itself)."""

    value: float
    thresholds: dict[str, float]
    touch_threshold: float | None

    @property
    def threshold(self) -> float:
        """t of MIoU as it is reported."""
        return self.thresholds[metrics.LOOKUP]


@dataclass(eq=False)
class Field:
    """Scenes, judges and methods, each made when it is first needed: where all is kept, nothing is
    made.

    Attributes:
        tuning, test: scenes a set, there is one for each number of touches.
    """

    workspace: Workspace
    skin: Skin
    protocol: Protocol
    tuning: int
    test: int

    def __post_init__(self) -> None:
        self._sessions: dict[tuple[str, int], FrameSession] = {}

    @cached_property
    def setup(self) -> Setup:
        """The data that methods are built from."""
        return setup_for(self.skin, self.protocol, elements=MODEL_ELEMENTS)

    @cached_property
    def image_scorers(self) -> dict[str, metrics.ImageScorer]:
        """By lookup; all on one raster."""
        raster = metrics.raster_inside(self.skin.outline)
        grid = self.setup.grid
        return {
            k: metrics.ImageScorer(
                raster, metrics.lookup_for(raster.points_mm, grid, k), grid.n_pixels
            )
            for k in metrics.LOOKUPS
        }

    @cached_property
    def solver(self) -> SceneSolver:
        """The simulator of scenes, on a mesh of its own."""
        return self.workspace.scenes(self.skin, self.protocol)

    def seed_and_count(self, role: str) -> tuple[int, int]:
        """Return seed and size of the set "tuning" or "test"."""
        settings = self.workspace.settings
        return (settings.tuning_seed, self.tuning) if role == TUNING else (settings.seed, self.test)

    def session(self, role: str, number: int = 0) -> FrameSession:
        """The set "tuning" or "test" of scenes with ``number`` touches, or "shown"; solved when
        first asked for."""
        if (role, number) not in self._sessions:
            drawn = shown_set(self.workspace.settings.seed)
            if role != SHOWN:
                drawn = touch_set(self.skin.outline, number, *self.seed_and_count(role))
            name = role if role == SHOWN else f"{drawn.role} touch, {role}"
            self._sessions[role, number] = self.solver.session(drawn, self.workspace.progress, name)
        return self._sessions[role, number]

    def facts(
        self, part: str, candidate: Candidate, value: float, role: str, number: int, **more: Any
    ) -> dict[str, Any]:
        """All that a part depends on."""
        elements = [SIMULATED_ELEMENTS, MODEL_ELEMENTS]
        sets = [role, number, *(() if role == SHOWN else self.seed_and_count(role))]
        return {"experiment": "algorithms", "part": part, "method": candidate.name, "value": value,
            "set": sets, "snr_db": SNR_DB,
                "elements": elements, **more}  # fmt: skip


def choose(field: Field, candidate: Candidate) -> ChosenParameter:
    """The value and t with the best mean MIoU on all tuning scenes, each value at its own best t,
    as ``eitskin compare`` does."""
    curves = {value: tuning_curves(field, candidate, value) for value in candidate.values}
    value = max(curves, key=lambda v: curves[v][metrics.LOOKUP].max())
    thresholds = {lookup: best_threshold(curve[None]) for lookup, curve in curves[value].items()}
    scores = np.array([_counting(field, candidate, value, number) for number in NUMBERS]).sum(
        axis=0
    )
    if not len(scores):
        return ChosenParameter(value, thresholds, None)
    best = max(range(len(scores)), key=lambda k: (*scores[k], -k))
    return ChosenParameter(value, thresholds, TOUCH_THRESHOLDS[best])


def tuning_curves(field: Field, candidate: Candidate, value: float) -> dict[str, FloatArray]:
    """Mean MIoU over all tuning scenes at each of ``THRESHOLDS``, (T,), by lookup."""
    of_number = [_tuning(field, candidate, value, number) for number in NUMBERS]
    return {
        lookup: np.mean([one[lookup] for one in of_number], axis=0) for lookup in metrics.LOOKUPS
    }


def judged(
    field: Field,
    candidate: Candidate,
    value: float,
    number: int,
    touch_threshold: float | None = None,
) -> Arrays:
    """The test scenes of ``number`` touches: MIoU (k, T) by lookup, "macs" (k,), and with t of
    positions, or where the method reports touches itself, "exact" (k,) 0 or 1, "hits", "false" (k,)
    and "distances_mm" of all hits.
    """

    def make() -> Arrays:
        session, dv = field.session(TEST, number), _differences(field.session(TEST, number))
        method, images = _reconstructed(field, candidate, value, session, dv)
        found = _found(field, method, dv, images, touch_threshold)
        positions = {} if found is None else _positions(session, found)
        return {**_curves(field, session, images), "macs": macs_of(method, dv), **positions}

    return field.workspace.kept_arrays(
        field.facts("test", candidate, value, TEST, number, touch_threshold=touch_threshold), make
    )


def shown(
    field: Field, candidate: Candidate, value: float, touch_threshold: float | None
) -> Arrays:
    """The scenes of the pictures: "images" (3, n), MIoU (3, T) by lookup, "found_mm" (f, 2), each
    in scene "found_in"."""

    def make() -> Arrays:
        session, dv = field.session(SHOWN), _differences(field.session(SHOWN))
        method, images = _reconstructed(field, candidate, value, session, dv)
        found = _found(field, method, dv, images, touch_threshold) or []
        where = np.array([k for k, places in enumerate(found) for _ in places], dtype=np.int64)
        places = np.concatenate([np.zeros((0, 2)), *found])
        return {
            **_curves(field, session, images),
            "images": images,
            "found_mm": places,
            "found_in": where,
        }

    return field.workspace.kept_arrays(
        field.facts("shown", candidate, value, SHOWN, 0, touch_threshold=touch_threshold), make
    )


def _tuning(field: Field, candidate: Candidate, value: float, number: int) -> dict[str, FloatArray]:
    def make() -> dict[str, list[float]]:
        session = field.session(TUNING, number)
        images = _reconstructed(field, candidate, value, session, _differences(session))[1]
        return {
            lookup: curves.mean(axis=0).round(7).tolist()
            for lookup, curves in _curves(field, session, images).items()
        }

    kept = field.workspace.kept(field.facts("tuning", candidate, value, TUNING, number), make)
    return {lookup: np.array(curve) for lookup, curve in kept.items()}


def _counting(field: Field, candidate: Candidate, value: float, number: int) -> list[list[int]]:
    """For each t of positions: exactly counted tuning scenes, hits less false touches. Empty where
    the method reports touches."""

    def make() -> list[list[int]]:
        session = field.session(TUNING, number)
        dv = _differences(session)
        method, images = _reconstructed(field, candidate, value, session, dv)
        if isinstance(method, FindsTouches):
            return []
        truths = [scene.centres_mm() for scene in session.touches.scenes]
        scores = []
        for threshold in TOUCH_THRESHOLDS:
            found = _found(field, method, dv, images, threshold)
            matchings = match_all(truths, found or [])
            scores.append(
                [sum(m.exact for m in matchings), sum(m.hits - m.false_touches for m in matchings)]
            )
        return scores

    scores: list[list[int]] = field.workspace.kept(
        field.facts("counting", candidate, value, TUNING, number), make
    )
    return scores


def _differences(session: FrameSession) -> FloatArray:
    measured = session.measured(SNR_DB)
    return np.asarray(measured.frames_v[:, -1] - measured.untouched_v.mean(axis=0))


def _reconstructed(
    field: Field, candidate: Candidate, value: float, session: FrameSession, dv: FloatArray
) -> tuple[Method, FloatArray]:
    method = candidate.make(field.setup, value)
    if isinstance(method, Learns):
        method.learn(session.measured(SNR_DB).untouched_v)
    return method, np.asarray(method.reconstruct(dv), dtype=np.float64)


def _curves(field: Field, session: FrameSession, images: FloatArray) -> dict[str, FloatArray]:
    image_scorers = field.image_scorers
    truths = session.truths(image_scorers[metrics.LOOKUP].raster)
    return {
        lookup: miou_curves(image_scorer, images, truths)
        for lookup, image_scorer in image_scorers.items()
    }


def _found(
    field: Field, method: Method, dv: FloatArray, images: FloatArray, threshold: float | None
) -> list[FloatArray] | None:
    if isinstance(method, FindsTouches):
        return [np.asarray(places).reshape(-1, 2) for places in method.touches(dv)]
    if threshold is None:
        return None
    grid = field.setup.grid
    return [touches_in_image(image, grid.index, grid.centres_mm(), threshold) for image in images]


def _positions(session: FrameSession, found: Sequence[FloatArray]) -> Arrays:
    matchings = match_all([scene.centres_mm() for scene in session.touches.scenes], found)
    return {
        "exact": np.array([m.exact for m in matchings], dtype=np.int64),
        "hits": np.array([m.hits for m in matchings], dtype=np.int64),
        "false": np.array([m.false_touches for m in matchings], dtype=np.int64),
        "distances_mm": np.array([d for m in matchings for d in m.distances_mm]),
    }
