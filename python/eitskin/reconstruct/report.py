"""The results of recorded frames, as a table for people and as a message for programs."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from eitskin.core.results import Reconstruction, solve_text
from eitskin.reconstruct.steps import ReconstructOutcome
from eitskin.scoring.score import FrameScore
from eitskin.session.message import frame_table, head, known


def to_text(outcome: ReconstructOutcome) -> str:
    """Return a table of the touches, followed by their cost and, if the truth is known, their
    errors."""
    results, scores = outcome.results, outcome.scores
    weighed = any(touch.force_n for result in results.values() for touch in result.touches)
    lines = [
        f"frame       touch    x mm     y mm  radius mm  strength S/m mm2{'   force N' * weighed}  "
        " error mm  solve"
    ]
    for number, result in results.items():
        lines += _lines(outcome.frames.frame_name[number][:11], result, scores.get(number), weighed)
    macs = [result.info.macs + result.info.touch_macs for result in results.values()]
    cost = f"; median {np.median(macs) / 1e6:.2f} million MACs per frame" if any(macs) else ""
    lines.append(f"{len(results)} frames, {len(outcome.refused)} refused{cost}")
    if scores:
        facts = summary(scores)
        lines.append(
            f"compared with the truth of {facts['frames']} frames: {facts['found']} of"
            f" {facts['true']} touches found, {facts['false']} false;"
            + _position_errors(facts)
            + f" MIoU image {facts['miou_image']:.3f}, solver's image"
            f" {facts['miou_solver']:.3f}, touches {facts['miou_touches']:.3f}"
        )
    return "\n".join(lines)


def _lines(
    label: str, result: Reconstruction, score: FrameScore | None, weighed: bool
) -> Iterator[str]:
    """Yield a line per touch of a frame, or one line if there is none, and one for the
    diagnostics."""
    info = result.info
    cost = solve_text(
        info.iterations,
        info.stop,
        info.gap_rel,
        info.macs + info.touch_macs,
        info.solve_us + info.touch_us,
    )
    if not result.touches:
        why = "no change above the noise" if info.stop == "below-threshold" else info.stop
        yield f"{label:11} none ({why}); {cost}"
    errors = {} if score is None else score.errors_mm
    for k, touch in enumerate(result.touches):
        error = 10 * " " if score is None else f"{errors[k]:10.2f}" if k in errors else "     false"
        force = f"{touch.force_n:10.3f}" if weighed else ""
        yield (
            f"{'' if k else label:11} {touch.id:5d} {touch.x_mm:8.2f} {touch.y_mm:8.2f}"
            f" {touch.radius_mm:9.2f} {touch.strength_s_per_m_mm2:16.3f}{force}  {error}"
            f"{'' if k else f'  {cost}'}".rstrip()
        )
    if info.diagnostics:
        yield f"{'':11} diagnostics: {'; '.join(info.found)}"


def _position_errors(facts: dict[str, Any]) -> str:
    if not facts["found"]:
        return ""
    median, worst = facts["position_median_mm"], facts["position_worst_mm"]
    return f" position error median {median:.2f} mm, worst {worst:.2f} mm;"


def summary(scores: dict[int, FrameScore]) -> dict[str, Any]:
    """Return the scores of all frames in a few numbers; position errors are NaN if no touch was
    found."""
    matchings = [score.matching for score in scores.values()]
    distances = [d for matching in matchings for d in matching.distances_mm]
    hits = sum(matching.hits for matching in matchings)
    return {
        "frames": len(scores),
        "found": hits,
        "true": hits + sum(matching.misses for matching in matchings),
        "false": sum(matching.false_touches for matching in matchings),
        "position_median_mm": float(np.median(distances)) if distances else float("nan"),
        "position_worst_mm": float(np.max(distances)) if distances else float("nan"),
        "miou_image": float(np.mean([score.miou_image for score in scores.values()])),
        "miou_solver": float(np.mean([score.miou_solver for score in scores.values()])),
        "miou_touches": float(np.mean([score.miou_touches for score in scores.values()])),
    }


def to_json(outcome: ReconstructOutcome) -> dict[str, Any]:
    """Return everything that the text states, and more, as a message of type "reconstruction"
    (docs/reference/message.md)."""
    listed = [_entry(outcome, k) for k in sorted({*outcome.results, *outcome.refused})]
    message = head("reconstruction") | {
        "model": outcome.model_name,
        "engine": outcome.engine,
        "frames": listed,
    }
    if outcome.point is not None:
        settings = outcome.point.configuration.as_dict()
        message["settings"] = settings | {"mask_threshold": outcome.point.threshold}
    if outcome.scores:
        facts = summary(outcome.scores)
        message["summary"] = {key: known(value) for key, value in facts.items()}
    return message


def _entry(outcome: ReconstructOutcome, number: int) -> dict[str, Any]:
    """Return the message of a frame."""
    frames, result = outcome.frames, outcome.results.get(number)
    time_s = None if frames.time_s is None else float(frames.time_s[number])
    if result is None:
        entry = frame_table(number, time_s=time_s, refused=outcome.refused[number])
    else:
        info = result.info
        entry = frame_table(
            number,
            time_s=time_s,
            touches=result.touches,
            diagnostics=info.diagnostics_by_name,
            found=info.found,
            info=info.as_dict(),
        )
        entry["image_is"] = result.image_is
    entry["name"] = frames.frame_name[number]
    if number in outcome.scores:
        score = outcome.scores[number]
        entry["miou_image"], entry["miou_solver"] = score.miou_image, score.miou_solver
        entry["miou_touches"] = score.miou_touches
        entry["position_errors_mm"] = list(score.matching.distances_mm)
    return entry
