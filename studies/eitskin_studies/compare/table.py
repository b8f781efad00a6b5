"""A comparison as text, as JSON values and as CSV: always with the conditions that the numbers
depend on."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from eitskin_studies.compare.cost import Cost
from eitskin_studies.compare.figures import Figures
from eitskin_studies.compare.run import CompareResult, Comparison
from eitskin_studies.harness.summary import Summary
from eitskin_studies.harness.thresholds import THRESHOLDS

SNR_DEFINITION = "SNR = 20 log10(rms(V0) / sigma), V0 the untouched skin's frame, rms over its rows"
THRESHOLD_RULE = "touch where x > t max(x), t per method: the best mean MIoU on the training scenes"
COLUMNS = (
    "method",
    "MIoU mean",
    "95 % interval",
    "worst tenth",
    "median position error",
    "exact count",
    "ms",
    "kB",
    "threshold t",
    "trained",
)
FIGURE_COLUMNS = (
    "method",
    "amplitude response, sd",
    "position error",
    "resolution",
    "shape deformation",
    "ringing",
)
CSV_COLUMNS = (
    *("method", "scene", "touches", "miou"),
    *("hits", "misses", "false_touches", "exact", "mean_position_error_mm"),
)


def header(comparison: Comparison) -> list[tuple[str, str]]:
    """Return the conditions of a comparison as (subject, text), in order."""
    how, setup, train, test = (
        comparison.settings,
        comparison.setup,
        comparison.train,
        comparison.test,
    )
    rules, measured, grid = how.rules, how.measurement, setup.grid
    noise = (
        "no noise"
        if measured.snr_db is None
        else f"{measured.snr_db:g} dB (sigma {1e3 * test.noise_v:.3g} mV)"
    )
    converter = (
        "no converter"
        if measured.adc_bits is None
        else (
            f"{measured.adc_bits}-bit converter over +-{measured.adc_headroom:g} max|V0| "
            f"(step {1e3 * test.lsb_v:.3g} mV, {test.clipped} values clipped)"
        )
    )
    shows = (
        "shows the nearest pixel"
        if how.lookup == "nearest"
        else "is interpolated between pixels (bilinear)"
    )
    shape = "" if rules.shape == "disc" else f" ({rules.shape})"
    own = any(result.touch_threshold is None for result in comparison.results)
    return [
        (
            "skin",
            (
                f"{setup.skin.name}, {setup.skin.electrodes.count} electrodes,"
                f" {setup.protocol.n_rows} voltages per frame; image of {grid.n_pixels} pixels of"
                f" {grid.pixel_mm:.2f} mm"
            ),
        ),
        (
            "test scenes",
            (
                f"{test.touches.name} (seed {how.seed}): {rules.count[0]} to {rules.count[1]}"
                f" touches{shape}, radius {rules.radius_mm[0]:g} to {rules.radius_mm[1]:g} mm,"
                f" contrast {rules.contrast[0]:g} to {rules.contrast[1]:g}, {rules.gap_mm:g} mm"
                f" apart edge to edge, {rules.rim_margin_mm:g} mm from the rim"
            ),
        ),
        (
            "training scenes",
            f"{train.touches.name} (seed {how.seed}): fix parameter and thresholds, give no number",
        ),
        (
            "meshes",
            (
                f"frames solved nonlinearly on {test.mesh_elements} elements ({test.mesh_nodes}"
                f" nodes); sensitivity from {setup.mesh_elements} elements ({setup.mesh_nodes}"
                " nodes)"
            ),
        ),
        ("SNR", f"{noise}; {SNR_DEFINITION}"),
        (
            "measured",
            (
                f"{converter}; contacts +-{100 * measured.contact_spread:g} %; "
                f"reference is the mean of {measured.quiet_frames} untouched frames"
            ),
        ),
        (
            "MIoU",
            (
                f"mean of IoU(touch) and IoU(background) on a raster of {how.raster_mm:g} mm whose"
                f" cell {shows}; {THRESHOLD_RULE}"
            ),
        ),
        (
            "positions",
            "weighted centroids of connected components above a second trained threshold"
            + (", or the method's own touches" if own else "")
            + f"; exact count: each touch within {how.gate_mm:g} mm and nothing else",
        ),
        (
            "ms, kB",
            "median time of one frame through Python on this computer; what is kept between frames",
        ),
        (
            "ceiling",
            (
                f"a perfect image on this grid: {comparison.ceiling:.3f} (t ="
                f" {comparison.ceiling_threshold:g})"
            ),
        ),
    ]


def to_text(comparison: Comparison) -> str:
    """Header and tables for a terminal."""
    lines = [f"{subject + ':':<17}{text}" for subject, text in header(comparison)]
    lines += ["", *_table(COLUMNS, [_cells(result) for result in comparison.results])]
    figures = [_figure_cells(result) for result in comparison.results]
    lines += ["", "GREIT's figures of small targets, without noise:"]
    lines += _table(FIGURE_COLUMNS, figures)
    return "\n".join(lines)


def _table(columns: Sequence[str], cells: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table with its head."""
    rows, lines = [columns, *cells], []
    widths = [max(len(row[k]) for row in rows) for k in range(len(columns))]
    for number, row in enumerate(rows):
        lines.append(
            " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        )
        if number == 0:
            lines.append("-|-".join("-" * width for width in widths))
    return lines


def _figure_cells(result: CompareResult) -> tuple[str, ...]:
    shown = result.figures
    return (
        result.name,
        f"{100 * shown.amplitude_spread:.0f} %",
        f"{shown.position_error_mm:.1f} mm",
        f"{shown.resolution:.3f}",
        f"{shown.shape_deformation:.3f}",
        f"{shown.ringing:.3f}",
    )


def _cells(result: CompareResult) -> tuple[str, ...]:
    miou, position = result.miou_summary, result.position_summary
    return (
        result.name,
        f"{miou.mean:.3f}",
        f"{miou.low:.3f} to {miou.high:.3f}",
        f"{miou.worst_tenth:.3f}",
        f"{position.median:.1f} mm" if position.count else "no hits",
        f"{100 * result.exact_count:.0f} %",
        "-" if math.isnan(result.cost.frame_ms) else f"{result.cost.frame_ms:.2f}",
        "-" if math.isnan(result.cost.kept_kb) else f"{result.cost.kept_kb:.0f}",
        f"{result.threshold:.2f}",
        f"{result.parameter} = {result.value:g}" if result.parameter else "",
    )


def to_json(comparison: Comparison) -> dict[str, Any]:
    """All conditions and numbers as JSON values; nan becomes None."""
    how, setup, test = comparison.settings, comparison.setup, comparison.test
    return {
        "conditions": dict(header(comparison)),
        "settings": asdict(how),
        "skin": setup.skin.name,
        "protocol_hash": f"{setup.protocol.hash:016x}",
        "pixels": setup.grid.n_pixels,
        "sets": {"train": comparison.train.touches.name, "test": test.touches.name},
        "meshes": {
            "simulated": {"elements": test.mesh_elements, "nodes": test.mesh_nodes},
            "sensitivity": {"elements": setup.mesh_elements, "nodes": setup.mesh_nodes},
        },
        "noise_v": test.noise_v,
        "lsb_v": test.lsb_v,
        "clipped": test.clipped,
        "ceiling_miou": comparison.ceiling,
        "ceiling_threshold": comparison.ceiling_threshold,
        "thresholds": list(THRESHOLDS),
        "methods": [_result_json(result) for result in comparison.results],
    }


def _result_json(result: CompareResult) -> dict[str, Any]:
    return {
        "name": result.name,
        "parameter": result.parameter,
        "value": result.value,
        "threshold": result.threshold,
        "touch_threshold": result.touch_threshold,
        "train_miou": result.train_miou,
        "miou": _numbers(result.miou_summary),
        "position_error_mm": _numbers(result.position_summary),
        "exact_count": result.exact_count,
        "hit_share": result.hit_share,
        "false_per_scene": result.false_per_scene,
        "greit_figures": _numbers(result.figures),
        **_numbers(result.cost),
        "miou_over_threshold": [float(value) for value in result.curve],
    }


def _numbers(of: Summary | Figures | Cost) -> dict[str, float | int | None]:
    return {key: None if math.isnan(value) else value for key, value in asdict(of).items()}


def to_csv(comparison: Comparison) -> str:
    """One line a method and test scene; the conditions come first, as lines that begin with '#'."""
    out = io.StringIO()
    for subject, text in header(comparison):
        out.write(f"# {subject}: {text}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for result in comparison.results:
        for scene, miou, match in zip(
            comparison.test.touches.scenes, result.miou, result.matchings, strict=True
        ):
            error = f"{sum(match.distances_mm) / match.hits:.4f}" if match.hits else ""
            counts = (match.hits, match.misses, match.false_touches, int(match.exact))
            writer.writerow(
                (result.name, scene.name, len(scene.touches), f"{miou:.6f}", *counts, error)
            )
    return out.getvalue()
