"""``eitskin reconstruct FRAMES``: images and touches of recorded frames."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.cli.budget_options import add_wish, wished
from eitskin.cli.device_options import add_solver, check_solver
from eitskin.config import nearest
from eitskin.core.findings import plural
from eitskin.errors import ConfigError, EitskinError, FrameError, MissingExtraError, UsageError

if TYPE_CHECKING:
    from eitskin.core.results import Reconstruction
    from eitskin.frames.frames import Frames
    from eitskin.scoring.score import FrameScore
    from eitskin.solve.reconstructor import Reconstructor
    from eitskin.tuning.front import Point


def add_parser(subparsers: Any) -> None:
    """Add ``reconstruct``."""
    parser = subparsers.add_parser(
        "reconstruct",
        help="touches and images of the frames in a file",
        description=(
            "Turn frames into touches in millimetres and images. Where the frames carry the truth,"
            " the touches are held against it."
        ),
    )
    parser.add_argument(
        "frames", type=Path, metavar="FRAMES.npz", help="a frames file (eitskin import makes one)"
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="MODEL.eitm",
        help="default: the prebuilt model of the paper's skin",
    )
    parser.add_argument(
        "--engine",
        choices=("c", "c64", "numpy"),
        default="c",
        help="default: c, float32 as on a board",
    )
    parser.add_argument(
        "--sign",
        choices=("increase", "decrease", "both"),
        default="increase",
        help="which changes to look for",
    )
    parser.add_argument("--only", metavar="NAME,...", help="frames with these names only")
    add_solver(parser)
    parser.add_argument(
        "--gap",
        type=float,
        metavar="REL",
        help="stop once the duality gap is below this share of |y|^2 / 2",
    )
    add_wish(parser)
    parser.add_argument(
        "--warm", action="store_true", help="start each frame from the last one's result"
    )
    parser.add_argument(
        "--refine",
        action="store_true",
        help="solve again with what touches do to each other taken out of the data",
    )
    parser.add_argument(
        "--track",
        action="store_true",
        help=(
            "the frames are a stream, 48 or 96 a second: confirm births, keep ids, smooth places,"
            " as a board does"
        ),
    )
    parser.add_argument(
        "--threads",
        type=int,
        default=1,
        metavar="N",
        help="frames side by side, the same results (default: 1; not with --warm or --track)",
    )
    parser.add_argument(
        "--saturation-v", type=float, metavar="V", help="leave channels at or beyond +-V out"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT.npz", help="write images, touches and solver info"
    )
    parser.add_argument(
        "--picture", type=Path, metavar="PNG", help="draw all frames, with the truth where known"
    )
    parser.add_argument("--json", action="store_true")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct all frames; those that cannot be used are named, and the others are still done
    and written."""
    from eitskin.cli.cmd_model import load_or_prebuilt
    from eitskin.fileio import refuse_unwritable
    from eitskin.frames.frames import load_frames
    from eitskin.solve.reconstructor import MIN_CORRELATION, Reconstructor

    _check_threads(options)
    if wished(options) and options.engine != "c":
        raise UsageError(
            "--budget and --accuracy are of the C core in float32; leave  --engine"
            f" {options.engine}  out"
        )
    refuse_unwritable(options.output, options.picture)
    if options.picture is not None:
        from eitskin.view.pictures import load_matplotlib

        load_matplotlib()
    frames = load_frames(options.frames, allow_nonfinite=True)
    if not frames.n_frames:
        raise FrameError(
            f"{options.frames}: holds a reference but no frame; nothing to reconstruct"
        )
    model, blob, name = load_or_prebuilt(options.model)
    reconstructor = Reconstructor(model, engine=options.engine, blob=blob)
    try:
        reconstructor.check_protocol(frames.protocol)
    except EitskinError as error:
        raise type(error)(f"{options.frames} and {name}: {error}") from None
    _apply(options, reconstructor)
    point = _point(options, reconstructor)
    try:
        baseline = reconstructor.tare(frames.reference_voltage_v)
    except FrameError as error:
        raise FrameError(
            f"{options.frames}: {error}; run  eitskin doctor {options.frames}"
        ) from None
    if baseline.correlation < MIN_CORRELATION:
        print(
            "eitskin: warning: the reference correlates with the model by"
            f" {baseline.correlation:.3f} only; run  eitskin doctor {options.frames}",
            file=sys.stderr,
        )
    if baseline.glitches:
        print(
            f"eitskin: {plural(baseline.glitches, 'reading')} of the quiet frames left out as"
            " glitches",
            file=sys.stderr,
        )
    chosen = _chosen(frames, options.only)
    if options.threads > 1:
        results, refused = _reconstruct_threaded(
            reconstructor, blob, frames, chosen, options.threads
        )
    else:
        results, refused = _reconstruct_all(
            reconstructor, frames, chosen, options.warm or options.track
        )
    scores = _scores(
        reconstructor, frames, results, options.sign, None if point is None else point.threshold
    )
    if options.output is not None and results:
        from eitskin.frames.results_file import save_results

        save_results(options.output, model, frames, results)
    if options.picture is not None and results:
        from eitskin.view.frame_pictures import draw_results

        draw_results(options.picture, model, frames, results, scores)
    if options.json:
        print(
            json.dumps(
                _as_json(frames, results, scores, refused, name, options.engine, point), indent=2
            )
        )
    else:
        _print(frames, results, scores, refused)
    for number, reason in refused.items():
        print(
            f"eitskin: {options.frames}: frame {number} ({frames.frame_name[number]}) refused:"
            f" {reason}",
            file=sys.stderr,
        )
    return FrameError.exit_code if refused else 0


def _apply(options: argparse.Namespace, reconstructor: Reconstructor) -> None:
    from eitskin.solve.options import tracking

    changes: dict[str, Any] = {"sign": options.sign, "warm_start": options.warm}
    if options.solver is not None:
        changes["solver"] = options.solver
    check_solver(options)
    if options.iterations is not None:
        changes["iterations"] = options.iterations
    if options.refine:
        changes["refine"] = True
    if options.mac_limit is not None:
        changes["mac_limit"] = options.mac_limit
    if options.gap is not None:
        if not 0 < options.gap <= 1:
            raise UsageError(f"--gap {options.gap:g} is out of range; use above 0 to 1")
        changes["gap_rel"] = options.gap
    if options.saturation_v is not None:
        if not options.saturation_v > 0:
            raise UsageError(f"--saturation-v {options.saturation_v:g} must be above 0")
        changes["saturation_v"] = options.saturation_v
    reconstructor.with_options(**changes)
    if options.track:
        reconstructor.set_options(tracking(reconstructor.options))


def _point(options: argparse.Namespace, reconstructor: Reconstructor) -> Point | None:
    """The measured point that ``--budget`` and ``--accuracy`` choose, its settings applied and
    said; None without them."""
    if not wished(options):
        return None
    from eitskin.cli.budget_options import chosen_point, settings_text

    point = chosen_point(options, reconstructor.model, reconstructor.options, "host")
    reconstructor.with_options(**point.configuration.solver_settings)
    print(f"eitskin: {settings_text(point, 'host')}", file=sys.stderr)
    return point


def _chosen(frames: Frames, only: str | None) -> list[int]:
    """The numbers of the frames that ``--only`` names; all without it."""
    if only is None:
        return list(range(frames.n_frames))
    names = only.split(",")
    for name in names:
        if name not in frames.frame_name:
            raise UsageError(
                f"--only {only}: no frame is named {name!r}; {nearest(name, frames.frame_name)}"
            )
    return [number for number, name in enumerate(frames.frame_name) if name in names]


def _reconstruct_all(
    reconstructor: Reconstructor, frames: Frames, chosen: list[int], follow: bool
) -> tuple[dict[int, Reconstruction], dict[int, str]]:
    from tqdm import tqdm

    results: dict[int, Reconstruction] = {}
    refused: dict[int, str] = {}
    for number in tqdm(chosen, desc="frames", leave=False, disable=not sys.stderr.isatty()):
        if not follow:
            reconstructor.forget()
        try:
            results[number] = reconstructor.reconstruct(frames.voltage_v[number])
        except FrameError as error:
            refused[number] = str(error)
    return results, refused


def _check_threads(options: argparse.Namespace) -> None:
    from eitskin.solve.batch import check_threads

    if check_threads(options.threads) > 1 and (
        options.warm or options.track or options.engine == "numpy"
    ):
        what = "the numpy engine has one"
        if options.warm or options.track:
            what = (
                "--warm starts each frame from the last one"
                if options.warm
                else "--track needs one frame after another"
            )
        raise UsageError(f"--threads {options.threads}: {what}; use --threads 1")


def _reconstruct_threaded(
    reconstructor: Reconstructor, blob: bytes, frames: Frames, chosen: list[int], threads: int
) -> tuple[dict[int, Reconstruction], dict[int, str]]:
    from tqdm import tqdm

    from eitskin.solve.batch import Batch

    batch = Batch(
        reconstructor.model,
        threads=threads,
        engine=reconstructor.engine,
        options=reconstructor.options,
        blob=blob,
    )
    batch.tare(frames.reference_voltage_v)
    results: dict[int, Reconstruction] = {}
    refused: dict[int, str] = {}
    hidden = not sys.stderr.isatty()
    shown = tqdm(
        batch.each(frames.voltage_v[chosen]),
        desc="frames",
        total=len(chosen),
        leave=False,
        disable=hidden,
    )
    for number, result in zip(chosen, shown, strict=True):
        if isinstance(result, FrameError):
            refused[number] = str(result)
        else:
            results[number] = result
    return results, refused


def _scores(
    reconstructor: Reconstructor,
    frames: Frames,
    results: dict[int, Reconstruction],
    sign: str,
    threshold: float | None,
) -> dict[int, FrameScore]:
    if frames.touch_frame is None and frames.truth_mask is None:
        return {}
    from eitskin.scoring.score import scorer_for

    model = reconstructor.model
    if threshold is not None:
        model = replace(model, defaults=replace(model.defaults, mask_threshold=threshold))
    try:
        scorer = scorer_for(model)
        scored = {
            number: scorer.score(frames, number, result, sign) for number, result in results.items()
        }
    except (ConfigError, MissingExtraError) as error:
        print(
            f"eitskin: warning: not held against the truth in the frames: {error}", file=sys.stderr
        )
        return {}
    return {number: score for number, score in scored.items() if score is not None}


def _print(
    frames: Frames,
    results: dict[int, Reconstruction],
    scores: dict[int, FrameScore],
    refused: dict[int, str],
) -> None:
    import numpy as np

    from eitskin.core.results import NEWTONS_PER_GRAM

    weighed = any(touch.load_n for result in results.values() for touch in result.touches)
    print(
        f"frame       touch    x mm     y mm  radius mm  strength S/m mm2{'    load g' * weighed}  "
        " error mm  solve"
    )
    for number, result in results.items():
        score = scores.get(number)
        errors = {} if score is None else errors_by_touch(score)
        label = frames.frame_name[number][:11]
        if not result.touches:
            why = "no change above the noise" if result.info.stop == "gate" else result.info.stop
            print(f"{label:11} none ({why}); {_solve(result)}")
        for k, touch in enumerate(result.touches):
            error = (
                f"{errors[k]:10.2f}"
                if k in errors
                else ("     false" if score is not None else 10 * " ")
            )
            grams = f"{touch.load_n / NEWTONS_PER_GRAM:10.1f}" if weighed else ""
            print(
                f"{label if k == 0 else '':11} {touch.id:5d} {touch.x_mm:8.2f} {touch.y_mm:8.2f}"
                f" {touch.radius_mm:9.2f}"
                f" {touch.strength_s_per_m_mm2:16.3f}{grams}"
                f"  {error}{f'  {_solve(result)}' if k == 0 else ''}".rstrip()
            )
        if result.info.findings:
            print(f"{'':11} found: {'; '.join(result.info.found)}")
    macs = [result.info.macs + result.info.touch_macs for result in results.values()]
    cost = f"; median {np.median(macs) / 1e6:.2f} million MACs a frame" if any(macs) else ""
    print(f"{len(results)} frames, {len(refused)} refused{cost}")
    if scores:
        facts = summary(scores)
        print(
            f"against the truth of {facts['frames']} frames: {facts['found']} of {facts['true']}"
            f" touches found, {facts['false']} false; position error median"
            f" {facts['position_median_mm']:.2f} mm, worst {facts['position_worst_mm']:.2f} mm;"
            f" MIoU image {facts['miou_image']:.3f}, touches {facts['miou_touches']:.3f}"
        )


def _solve(result: Reconstruction) -> str:
    from eitskin.core.results import solve_text

    info = result.info
    return solve_text(
        info.iterations,
        info.stop,
        info.gap_rel,
        info.macs + info.touch_macs,
        info.solve_us + info.touch_us,
    )


def errors_by_touch(score: FrameScore) -> dict[int, float]:
    """Position error in mm of each found touch that has a true one."""
    return {
        found: d
        for (_, found), d in zip(score.matching.pairs, score.matching.distances_mm, strict=True)
    }


def summary(scores: dict[int, FrameScore]) -> dict[str, Any]:
    """The scores of all frames in a few numbers; positions are NaN where nothing was found."""
    import numpy as np

    distances = [d for score in scores.values() for d in score.matching.distances_mm]
    hits = sum(score.matching.hits for score in scores.values())
    return {
        "frames": len(scores),
        "found": hits,
        "true": hits + sum(score.matching.misses for score in scores.values()),
        "false": sum(score.matching.false_touches for score in scores.values()),
        "position_median_mm": float(np.median(distances)) if distances else float("nan"),
        "position_worst_mm": float(np.max(distances)) if distances else float("nan"),
        "miou_image": float(np.mean([score.miou_image for score in scores.values()])),
        "miou_touches": float(np.mean([score.miou_touches for score in scores.values()])),
    }


def _as_json(
    frames: Frames,
    results: dict[int, Reconstruction],
    scores: dict[int, FrameScore],
    refused: dict[int, str],
    model: str,
    engine: str,
    point: Point | None,
) -> dict[str, Any]:
    from dataclasses import asdict

    listed = []
    for number in sorted({*results, *refused}):
        entry: dict[str, Any] = {"frame": number, "name": frames.frame_name[number]}
        if number in refused:
            entry["refused"] = refused[number]
        else:
            result = results[number]
            entry["touches"] = [asdict(touch) for touch in result.touches]
            entry["info"] = result.info.as_dict()
        if number in scores:
            score = scores[number]
            entry["miou_image"], entry["miou_touches"] = score.miou_image, score.miou_touches
            entry["position_errors_mm"] = list(score.matching.distances_mm)
        listed.append(entry)
    whole: dict[str, Any] = {"model": model, "engine": engine, "frames": listed}
    if point is not None:
        whole["settings"] = point.configuration.as_dict() | {"mask_threshold": point.threshold}
    if scores:
        whole["summary"] = {
            key: None if value != value else value for key, value in summary(scores).items()
        }
    return whole
