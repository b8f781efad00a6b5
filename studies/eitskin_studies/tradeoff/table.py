"""A front as text and CSV."""

import csv
import io
from collections.abc import Sequence
from typing import Any

from eitskin.tuning.front import MIN_SWEEPS, Conditions, Front, OperatingPoint
from eitskin_studies.tradeoff.fronts import pareto

MIN_GAIN = 0.002  # of MIoU: a fifth of the 95 % interval of 180 scenes
COSTS = ("flash_bytes", "ram_bytes", "pixels_kept", "acquisition_us")


def x_of(point: OperatingPoint, where: Conditions) -> float | None:
    """Return the cost that the front is drawn over: the mean instructions of solve and touches, or
    MACs if no instructions are known."""
    if point.instructions is not None:
        return float(point.instructions["mean"])
    macs = point.macs(where)
    return None if macs is None else macs[0]


def best_points(points: Sequence[OperatingPoint], where: Conditions) -> list[OperatingPoint]:
    """The Pareto front of points that begin each frame again and fit touches fully, in steps of
    ``MIN_GAIN`` or more."""
    alike = [
        one
        for one in points
        if not one.configuration.warm_start and one.configuration.touch_sweeps >= MIN_SWEEPS
    ]
    return pareto(alike, lambda p: x_of(p, where), lambda p: p.accuracy(where), MIN_GAIN)


def to_csv(front: Front) -> str:
    """A line a configuration, set and SNR; empty if something was not measured."""
    lines = io.StringIO()
    rows = [row for point in front.points for row in _rows(point)]
    writer = csv.DictWriter(lines, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return lines.getvalue()


def _rows(point: OperatingPoint) -> list[dict[str, Any]]:
    instructions, host = point.instructions or {}, point.host_us or {}
    fixed = point.configuration.as_dict() | {
        "threshold": point.threshold,
        "force_scale": point.force_scale,
    }
    fixed |= {name: point.costs[name] for name in COSTS}
    counted = {
        "instructions_kind": instructions.get("kind"),
        "instructions_mean": instructions.get("mean"),
        "instructions_most": instructions.get("most"),
        "host_p50_us": host.get("p50"),
        "host_p99_us": host.get("p99"),
        "host_most_us": host.get("most"),
    }
    rows = []
    for name, by_snr in point.scores.items():
        for snr_db, score in by_snr.items():
            cell: dict[str, Any] = {"set": name, "snr_db": snr_db, "scenes": score["scenes"]}
            for judged in ("image", "discs"):
                cell |= {f"{judged}_{key}": value for key, value in score[judged].items()}
            for error in ("position_mm", "force_error"):
                cell |= {f"{error}_{key}": value for key, value in score[error].items()}
            for key in (
                "exact_count",
                "hit_share",
                "false_per_scene",
                "iterations",
                "gap_rel",
                "most_macs",
            ):
                cell[key] = score[key]
            cell |= {
                "solve_macs_mean": score["solve_macs"][0],
                "touch_macs_mean": score["touch_macs"][0],
            }
            rows.append({**fixed, **counted, **cell})
    return rows


def to_text(front: Front, where: Conditions) -> str:
    """Every configuration at ``where``, cheapest first; those on the front are marked."""
    best = {one.name for one in best_points(front.points, where)}
    how = front.settings
    lines = [
        (
            f"{where}: {how.get('scenes')} test scenes, t and scale of force from"
            f" {how.get('train_scenes')} training scenes, seed {how.get('seed')}; instructions"
            f" {how.get('instructions')}; host: {how.get('machine')}, {how.get('kernels')}"
        ),
        "",
        (
            f"  {'configuration':<34} {'image':>6} {'worst':>6} {'discs':>6} {'exact':>6} {'mm':>5}"
            f" {'force':>6} {'kMAC':>7} {'k instr':>9} {'most':>9} {'p50 us':>8} {'p99 us':>8}"
            f" {'flash':>7} {'RAM':>7} {'scan ms':>8}"
        ),
    ]
    for point in sorted(front.points, key=lambda p: x_of(p, where) or 0.0):
        score = point.score(where)
        if score is None:
            continue
        instructions, host, macs = (
            point.instructions or {},
            point.host_us or {},
            point.macs(where) or (0.0, 0.0),
        )
        mark = "*" if point.name in best else " "
        estimated = "~" if instructions.get("kind") == "estimated" else ""
        shown = [
            (
                f"{mark} {point.name:<34} {score['image']['mean']:6.3f}"
                f" {score['image']['worst_tenth']:6.3f}"
            ),
            f"{score['discs']['mean']:6.3f} {100 * score['exact_count']:5.1f}%",
            (
                f"{_or_dash(score['position_mm']['median'], '.2f'):>5}"
                f" {_or_dash(score['force_error']['median'], '.3f'):>6}"
            ),
            f"{macs[0] / 1e3:7.0f} {estimated + _or_dash(instructions.get('mean'), '.0f', 1e3):>9}",
            f"{_or_dash(instructions.get('most'), '.0f', 1e3):>9}",
            f"{_or_dash(host.get('p50'), '.1f'):>8} {_or_dash(host.get('p99'), '.1f'):>8}",
            f"{point.costs['flash_bytes'] / 1e3:6.0f}k {point.costs['ram_bytes'] / 1e3:6.0f}k",
            f"{point.costs['acquisition_us'] / 1e3:8.1f}",
        ]
        lines.append(" ".join(shown))
    lines += [
        "",
        (
            f"* on the front: nothing that costs no more is as accurate to {MIN_GAIN}, but for"
            " warm and half fitted ones"
        ),
    ]
    return "\n".join(lines)


def _or_dash(value: float | None, how: str, divide: float = 1.0) -> str:
    return "-" if value is None else format(value / divide, how)
