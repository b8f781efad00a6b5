"""Recorded frames to touches and images, step by step:

    read -> choose the model -> take the reference -> solve -> score against the truth -> write

:func:`reconstruct_frames` does these; ``report`` says what came of it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.config import nearest
from eitskin.core.diagnostics import plural
from eitskin.core.results import LearnedReference, Reconstruction
from eitskin.errors import ConfigError, EitskinError, FrameError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.frames.frames import Frames, load_frames
from eitskin.frames.results_file import save_results
from eitskin.model.model import Model
from eitskin.model.options import tracking
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.progress import Progress, silent
from eitskin.scoring.score import FrameScore, scorer_for
from eitskin.solve.batch import Batch, check_threads
from eitskin.solve.reconstructor import MIN_CORRELATION, Reconstructor
from eitskin.tuning.for_model import chosen_point, settings_text
from eitskin.tuning.front import Point, Target
from eitskin.view.film import check_film
from eitskin.view.frame_pictures import draw_results, film_results
from eitskin.view.panels import check_picture

Results = dict[int, Reconstruction]


@dataclass(frozen=True)
class ReconstructSettings:
    """How frames are reconstructed.

    Attributes:
        model: an .eitm file; None: the prebuilt model of the paper's skin.
        engine: "c", "c64" or "numpy".
        changes: options of the solver by name (``core.results.Options``).
        wish: a budget or an accuracy, whose measured settings are taken; or None.
        track: touches are followed from frame to frame, as a board does; None: where the frames
            are a stream, which their times tell, and threads is 1.
        threads: frames side by side, the same results; 1 with a warm start, tracking or numpy.
        only: names of the frames to reconstruct; None: all.
    """

    model: Path | None = None
    engine: str = "c"
    changes: dict[str, Any] = field(default_factory=dict)
    target: Target | None = None
    track: bool | None = None
    threads: int = 1
    only: tuple[str, ...] | None = None

    @property
    def follows(self) -> bool:
        """Whether a frame's result depends on the frames before."""
        return bool(self.track) or bool(self.changes.get("warm_start"))

    def tracked(self, frames: Frames) -> bool:
        """Whether touches of ``frames`` are followed."""
        return is_stream(frames) and self.threads == 1 if self.track is None else self.track


def is_stream(frames: Frames) -> bool:
    """Whether the frames came one after another: they have times that ascend."""
    times = frames.time_s
    return times is not None and len(times) > 1 and bool(np.all(np.diff(times) > 0))


@dataclass(frozen=True, eq=False)
class ReconstructOutcome:
    """What came of the frames.

    Attributes:
        frames, model, model_name, engine: what was reconstructed, with what.
        point: the measured point that a budget chose; or None.
        reference: as learned from the untouched frames.
        results, refused: by the frame's number: the result, or why there is none.
        scores: by number, where the frames carry the truth.
        notes: what a user should know, a line each.
    """

    frames: Frames
    model: Model
    model_name: str
    engine: str
    point: Point | None
    reference: LearnedReference
    results: Results
    refused: dict[int, str]
    scores: dict[int, FrameScore]
    notes: tuple[str, ...]


def reconstruct_frames(
    path: Path,
    settings: ReconstructSettings | None = None,
    *,
    output: Path | None = None,
    picture: Path | None = None,
    film: Path | None = None,
    progress: Progress = silent,
) -> ReconstructOutcome:
    """Reconstruct the frames of the file ``path``; those that cannot be used are named in
    ``refused``, and the others are still done. Images, touches and info go into the file ``output``
    (.npz), a ``picture`` shows the frames, a ``film`` one after another."""
    how = settings or ReconstructSettings()
    check(how, output, picture, film)
    notes: list[str] = []
    frames, chosen = read(path, how.only)
    how = replace(how, track=how.tracked(frames))
    reconstructor, blob, name = choose_model(path, frames, how)
    know_converter(reconstructor, frames)
    point = apply_options(reconstructor, how, notes)
    reference = take_reference(path, reconstructor, frames, notes)
    results, refused = solve(reconstructor, blob, frames, chosen, how, progress)
    scores = score(reconstructor.model, frames, results, reconstructor.options.sign, point, notes)
    outcome = ReconstructOutcome(
        frames, reconstructor.model, name, how.engine, point, reference, results, refused, scores,
        tuple(notes),
    )  # fmt: skip
    write(outcome, output, picture, film, progress)
    return outcome


def check(
    how: ReconstructSettings, output: Path | None, picture: Path | None, film: Path | None = None
) -> None:
    """Refuse what cannot be, before any file is read."""
    if check_threads(how.threads) > 1:
        reasons = {
            "--warm starts each frame from the last one": how.changes.get("warm_start"),
            "--track needs one frame after another": how.track,
            "the numpy engine has one": how.engine == "numpy",
        }
        for reason, applies in reasons.items():
            if applies:
                raise UsageError(f"--threads {how.threads}: {reason}; use --threads 1")
    if how.target is not None and how.engine != "c":
        raise UsageError(
            "--preset, --budget and --accuracy are of the C core in float32; leave  --engine"
            f" {how.engine}  out"
        )
    refuse_unwritable(output, picture, film)
    if picture is not None or film is not None:
        check_picture(picture)
        check_film(film)


def read(path: Path, only: tuple[str, ...] | None) -> tuple[Frames, list[int]]:
    """The frames, and the numbers of those that are named in ``only``."""
    frames = load_frames(path, allow_nonfinite=True)
    if not frames.n_frames:
        raise FrameError(f"{path}: holds a reference but no frame; nothing to reconstruct")
    for name in only or ():
        if name not in frames.frame_name:
            raise UsageError(
                f"--only {','.join(only or ())}: no frame is named {name!r};"
                f" {nearest(name, frames.frame_name)}"
            )
    names = frames.frame_name if only is None else only
    return frames, [k for k, name in enumerate(frames.frame_name) if name in names]


def choose_model(
    path: Path, frames: Frames, how: ReconstructSettings
) -> tuple[Reconstructor, bytes, str]:
    """The model that fits the frames, its bytes and name."""
    model, blob, name = load_or_prebuilt(how.model)
    reconstructor = Reconstructor(model, engine=how.engine, blob=blob)
    try:
        reconstructor.check_protocol(frames.protocol)
    except EitskinError as error:
        raise type(error)(f"{path} and {name}: {error}") from None
    return reconstructor, blob, name


def know_converter(reconstructor: Reconstructor, frames: Frames) -> None:
    """The steps of the frames' converter, where they tell, are the least noise of a row."""
    step_v = frames.meta.get("lsb_v")
    if isinstance(step_v, (int, float)) and 0 < step_v < math.inf:
        reconstructor.set_options(noise_floor_v=step_v / math.sqrt(12))


def apply_options(
    reconstructor: Reconstructor, how: ReconstructSettings, notes: list[str]
) -> Point | None:
    """Give the solver its options; with a wish those of the measured point that fulfils it."""
    reconstructor.set_options(**how.changes)
    if how.track:
        reconstructor.set_options(tracking(reconstructor.options))
    if how.target is None:
        return None

    point = chosen_point(how.target, reconstructor.model, reconstructor.options)
    reconstructor.set_options(**point.configuration.solver_settings)
    notes.append(settings_text(point, how.target.board))
    return point


def take_reference(
    path: Path, reconstructor: Reconstructor, frames: Frames, notes: list[str]
) -> LearnedReference:
    """Learn the reference from the untouched frames."""
    try:
        reference = reconstructor.tare(frames.reference_voltage_v)
    except FrameError as error:
        raise FrameError(f"{path}: {error}; run  eitskin doctor {path}") from None
    if reference.correlation < MIN_CORRELATION:
        notes.append(
            f"warning: the reference correlates with the model by {reference.correlation:.3f}"
            f" only; run  eitskin doctor {path}"
        )
    if reference.outliers:
        notes.append(
            f"{plural(reference.outliers, 'reading')} of the quiet frames left out as outliers"
        )
    return reference


def solve(
    reconstructor: Reconstructor,
    blob: bytes,
    frames: Frames,
    chosen: list[int],
    how: ReconstructSettings,
    progress: Progress,
) -> tuple[Results, dict[int, str]]:
    """The results of the ``chosen`` frames, and why there is none, by number."""
    if how.threads > 1:
        batch = Batch(
            reconstructor.model,
            threads=how.threads,
            engine=how.engine,
            options=reconstructor.options,
            blob=blob,
        )
        batch.tare(frames.reference_voltage_v)
        solved = batch.each(frames.voltage_v[chosen])
    else:
        solved = _one_by_one(reconstructor, frames.voltage_v[chosen], how.follows)
    results: Results = {}
    refused: dict[int, str] = {}
    for number, result in zip(chosen, progress(solved, len(chosen)), strict=True):
        if isinstance(result, FrameError):
            refused[number] = str(result)
        else:
            results[number] = result
    return results, refused


def _one_by_one(
    reconstructor: Reconstructor, frames_v: Any, follows: bool
) -> Iterator[Reconstruction | FrameError]:
    for frame_v in frames_v:
        if not follows:
            reconstructor.forget()
        try:
            yield reconstructor.reconstruct(frame_v)
        except FrameError as error:
            yield error


def score(
    model: Model, frames: Frames, results: Results, sign: str, point: Point | None, notes: list[str]
) -> dict[int, FrameScore]:
    """The results against the truth, where the frames carry it."""
    if frames.touch_frame is None and frames.truth_mask is None:
        return {}

    if point is not None:
        model = replace(model, defaults=replace(model.defaults, mask_threshold=point.threshold))
    try:
        scorer = scorer_for(model)
    except ConfigError as error:
        notes.append(f"warning: not compared with the truth in the frames: {error}")
        return {}
    scored = {k: scorer.score(frames, k, result, sign) for k, result in results.items()}
    return {k: one for k, one in scored.items() if one is not None}


def write(
    outcome: ReconstructOutcome,
    output: Path | None,
    picture: Path | None,
    film: Path | None = None,
    progress: Progress = silent,
) -> None:
    """The file of results, the film and the picture, where there is something to show."""
    if output is not None and outcome.results:
        save_results(output, outcome.model, outcome.frames, outcome.results)
    if film is not None and outcome.results:
        film_results(film, outcome.model, outcome.frames, outcome.results, progress=progress)
    if picture is not None and outcome.results:
        draw_results(picture, outcome.model, outcome.frames, outcome.results, outcome.scores)
