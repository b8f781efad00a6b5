"""Reconstruct recorded frames, step by step:

    read -> choose the model -> take the reference -> solve -> score against the truth -> write

:func:`reconstruct_frames` runs these steps; ``report`` describes the result.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.config import nearest
from eitskin.core.constants_table import MIN_REFERENCE_FRAMES
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
from eitskin.tuning.for_model import operating_point_for, settings_text
from eitskin.tuning.front import OperatingPoint, Preset
from eitskin.view.film import check_film
from eitskin.view.frame_pictures import draw_results, film_results
from eitskin.view.panels import check_picture

Results = dict[int, Reconstruction]


@dataclass(frozen=True)
class ReconstructSettings:
    """The settings for reconstructing frames.

    Attributes:
        model: an .eitm file; None is the prebuilt model of the paper's skin.
        engine: "c", "c64" or "numpy".
        changes: options of the solver by name (``core.results.Options``).
        preset: a preset whose measured settings are used; or None.
        threads: how many frames are solved in parallel, each by itself; it must be 1 with a warm
            start or numpy.
        only: names of the frames to reconstruct; None is all.
    """

    model: Path | None = None
    engine: str = "c"
    changes: dict[str, Any] = field(default_factory=dict)
    preset: Preset | None = None
    threads: int = 1
    only: tuple[str, ...] | None = None

    @property
    def warm(self) -> bool:
        """Return whether each frame starts from the last one's result."""
        return bool(self.changes.get("warm_start"))

    def tracked(self, frames: Frames) -> bool:
        """Return whether the touches of ``frames`` are followed from frame to frame: the frames are
        a stream, and one thread solves them in the C core."""
        return is_stream(frames) and self.threads == 1 and self.engine != "numpy"


def is_stream(frames: Frames) -> bool:
    """Return whether the frames form a stream, which means that their times ascend."""
    times = frames.time_s
    return times is not None and len(times) > 1 and bool(np.all(np.diff(times) > 0))


IDS_OF_FRAMES = (
    "the frames have no ascending times, so ids number the touches of each frame alone; if the"
    " frames are a stream, import them with --time"
)


@dataclass(frozen=True, eq=False)
class ReconstructOutcome:
    """The outcome of a reconstruction.

    Attributes:
        frames, model, model_name, engine: what was reconstructed, and how.
        point: the operating point that the preset chose; or None.
        reference: the reference as learned from the untouched frames.
        results, refused: by frame number, the result or the reason why there is none.
        scores: by frame number, if the frames hold the truth.
        notes: lines that the user should see.
    """

    frames: Frames
    model: Model
    model_name: str
    engine: str
    point: OperatingPoint | None
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
    """Reconstruct the frames of the file ``path``.

    Frames that cannot be used are named in ``refused``, and the others are still reconstructed.
    Images, touches and info are written to the file ``output`` (.npz); a ``picture`` shows all
    frames, and a ``film`` shows them one after another.

    Raises:
        FileError: a file cannot be read or written.
        UsageError: the settings contradict each other, or the preset cannot be fulfilled.
        FrameError, ProtocolError: the frames, or their untouched frames, cannot be used with the
            model.
    """
    how = settings or ReconstructSettings()
    check(how, output, picture, film)
    notes: list[str] = []
    frames, chosen = read(path, how.only)
    reconstructor, blob, name = choose_model(path, frames, how)
    know_converter(reconstructor, frames)
    apply_options(reconstructor, frames, how)
    reference = take_reference(path, reconstructor, frames, notes)
    point = apply_preset(reconstructor, how, reference, notes)
    results, refused = solve(reconstructor, blob, frames, chosen, how, progress)
    scores = score(reconstructor.model, frames, results, reconstructor.options.sign, point, notes)
    several = sum(bool(one.touches) for one in results.values()) > 1
    if not is_stream(frames) and several and not scores:
        notes.append(IDS_OF_FRAMES)
    outcome = ReconstructOutcome(
        frames, reconstructor.model, name, how.engine, point, reference, results, refused, scores,
        tuple(notes),
    )  # fmt: skip
    write(outcome, output, picture, film, progress)
    return outcome


def check(
    how: ReconstructSettings, output: Path | None, picture: Path | None, film: Path | None = None
) -> None:
    """Reject invalid settings before any file is read."""
    if check_threads(how.threads) > 1:
        reasons = {
            "--warm starts each frame from the last one": how.warm,
            "the numpy engine uses one thread": how.engine == "numpy",
        }
        for reason, applies in reasons.items():
            if applies:
                raise UsageError(f"--threads {how.threads}: {reason}; use --threads 1")
    if how.preset is not None and how.engine != "c":
        raise UsageError(f"--preset needs the C core in float32; leave out  --engine {how.engine}")
    refuse_unwritable(output, picture, film)
    if picture is not None or film is not None:
        check_picture(picture)
        check_film(film)


def read(path: Path, only: tuple[str, ...] | None) -> tuple[Frames, list[int]]:
    """Return the frames, and the numbers of those named in ``only`` (None: all)."""
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
    """Return a reconstructor with the model for the frames, the bytes of the model, and its
    name."""
    model, blob, name = load_or_prebuilt(how.model)
    reconstructor = Reconstructor(model, engine=how.engine, blob=blob)
    try:
        reconstructor.check_protocol(frames.protocol)
    except EitskinError as error:
        raise type(error)(f"{path} and {name}: {error}") from None
    return reconstructor, blob, name


def know_converter(reconstructor: Reconstructor, frames: Frames) -> None:
    """Set the least noise of a row from the converter's step, if the frames state it."""
    step_v = frames.meta.get("lsb_v")
    if isinstance(step_v, (int, float)) and 0 < step_v < math.inf:
        reconstructor.set_options(noise_floor_v=step_v / math.sqrt(12))


def apply_options(reconstructor: Reconstructor, frames: Frames, how: ReconstructSettings) -> None:
    """Set the solver's options that are named."""
    reconstructor.set_options(**how.changes)
    if how.tracked(frames):
        reconstructor.set_options(tracking(reconstructor.options))


def apply_preset(
    reconstructor: Reconstructor,
    how: ReconstructSettings,
    reference: LearnedReference,
    notes: list[str],
) -> OperatingPoint | None:
    """If a preset is named, set and return the operating point that fulfils it at the SNR that the
    tare measured."""
    if how.preset is None:
        return None

    preset = how.preset.at_snr(reference.snr_db)
    point = operating_point_for(preset, reconstructor.model, reconstructor.options)
    reconstructor.set_options(**point.configuration.solver_settings)
    notes.append(settings_text(point, preset))
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
            f"warning: the reference correlates with the model only by {reference.correlation:.3f};"
            f" run  eitskin doctor {path}"
        )
    if reference.frames < MIN_REFERENCE_FRAMES:
        notes.append(
            f"{plural(reference.frames, 'untouched frame')}: the noise is unknown, so that noise"
            f" may be reported as a touch or as crowded; {MIN_REFERENCE_FRAMES} or more show it"
        )
    if reference.outliers:
        notes.append(
            f"{plural(reference.outliers, 'reading')} of the untouched frames left out as outliers"
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
    """Return the results of the ``chosen`` frames, and for the others the reason, by frame
    number."""
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
        solved = _one_by_one(reconstructor, frames, chosen, how)
    results: Results = {}
    refused: dict[int, str] = {}
    for number, result in zip(chosen, progress(solved, len(chosen)), strict=True):
        if isinstance(result, FrameError):
            refused[number] = str(result)
        else:
            results[number] = result
    return results, refused


def _one_by_one(
    reconstructor: Reconstructor, frames: Frames, chosen: list[int], how: ReconstructSettings
) -> Iterator[Reconstruction | FrameError]:
    tracked = how.tracked(frames)
    for k in chosen:
        if not (tracked or how.warm):
            reconstructor.forget()
        try:
            if tracked:
                yield reconstructor.follow(frames.voltage_v[k], frames.row_times_s(k))
            else:
                yield reconstructor.reconstruct(frames.voltage_v[k])
        except FrameError as error:
            yield error


def score(
    model: Model,
    frames: Frames,
    results: Results,
    sign: str,
    point: OperatingPoint | None,
    notes: list[str],
) -> dict[int, FrameScore]:
    """Compare the results with the truth, if the frames hold it."""
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
    """Write the file of results, the film and the picture, if there is any result."""
    if output is not None and outcome.results:
        save_results(output, outcome.model, outcome.frames, outcome.results)
    if film is not None and outcome.results:
        film_results(film, outcome.model, outcome.frames, outcome.results, progress=progress)
    if picture is not None and outcome.results:
        draw_results(picture, outcome.model, outcome.frames, outcome.results, outcome.scores)
