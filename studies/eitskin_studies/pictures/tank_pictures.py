"""Measured tank frames as each method shows them, and MIoU over the threshold, simulated and
measured."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.view.frame_pictures import true_marks
from eitskin.view.panels import draw_panels
from eitskin.view.pictures import Mark, Panel
from eitskin_studies.experiments.tank.evaluation import EvaluationSets
from eitskin_studies.experiments.tank.tanks import tank, touch_like
from eitskin_studies.harness.thresholds import THRESHOLDS
from eitskin_studies.pictures.style import (
    BLUE,
    GREY,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
)

CURVE_COLUMNS = 4
ROD_MM = 8.0  # as drawn; how thick the rods were is not stated
SHORT = (
    ("linear back projection", "back projection"),
    (" (Tikhonov)", ""),
    ("conjugate gradient", "CG"),
    ("plain FISTA", "FISTA"),
    ("non-negative", "x >= 0"),
    ("eitskin, image, levers from simulation", "eitskin, levers"),
    ("eitskin, touches as discs, change from simulation", "eitskin, discs, tuned"),
    ("eitskin, touches as discs", "eitskin, discs"),
)


def draw_gallery(
    path: str | Path, evaluation_sets: EvaluationSets, results: Sequence[dict[str, Any]], both: bool
) -> None:
    """Draw a row per frame and a column per method, truth first, as a PNG; with ``both`` signs all
    frames and rods, else those of metal.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    frames = evaluation_sets.phantoms
    numbers = list(range(frames.n_frames)) if both else touch_like(frames)
    images, discs, scores = (
        ("images_both", "discs_both", "nine") if both else ("images", "discs", "touch_like")
    )
    panels = []
    for row, number in enumerate(numbers):
        marks = true_marks(frames, number)
        panels.append(Panel(f"truth {frames.frame_name[number]}", None, marks, fill_truth=True))
        for one in results:
            name = f"{_short(one['name'])}\n{one['kind']}\n" if row == 0 else ""
            found = (
                tuple(Mark(x, y, radius) for x, y, radius, _ in one[discs][row])
                if one[discs]
                else ()
            )
            panels.append(
                Panel(f"{name}{one[scores][row]:.2f}", np.array(one[images][row]), marks, found)
            )
    for k, rods in enumerate(evaluation_sets.rods if both else ()):
        marks = tuple(Mark(x, y, ROD_MM, 1.0) for x, y in rods.metal_mm)
        marks += tuple(Mark(x, y, ROD_MM, -1.0) for x, y in rods.plastic_mm)
        panels.append(Panel(f"rods {k + 1}, as stated", None, marks, fill_truth=True))
        for one in results:
            found = (
                tuple(Mark(x, y, radius) for x, y, radius, _ in one["rod_discs"][k])
                if one["rod_discs"]
                else ()
            )
            panels.append(Panel("", np.array(one["rod_images"][k]), marks, found))
    draw_panels(
        path,
        tank()[0],
        evaluation_sets.grid,
        panels,
        1 + len(results),
        title=(
            "Measured frames of a water tank, every method on the data with which it did best on"
            " simulated frames"
        ),
        note=(
            "circles: true objects, digitised by hand; dashed: discs found; numbers: MIoU at the t"
            " of simulated frames; red: more conductive, blue: less"
        ),
    )


def draw_curves(path: Path, data: Sequence[Mapping[str, Any]]) -> None:
    """MIoU over t: on the simulated frames that t was chosen on, and on the measured ones.
    ``data`` has for each method its name, the kind of data, both curves, the chosen threshold, and
    the measured frames' MIoU there.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    rows = -(-len(data) // CURVE_COLUMNS)
    with drawing(path, 2.6 * CURVE_COLUMNS, 2.1 * rows + 0.8) as figure:
        panels = figure.subplots(rows, CURVE_COLUMNS, sharex=True, sharey=True, squeeze=False)
        for axes in panels.flat[len(data) :]:
            axes.set_axis_off()
        for axes, one in zip(panels.flat, data, strict=False):
            axes.plot(THRESHOLDS, one["simulated"], color=BLUE, label="simulated frames")
            axes.plot(THRESHOLDS, one["measured"], "--", color=VERMILION, label="measured frames")
            axes.axvline(one["threshold"], color=GREY, linewidth=0.8, linestyle=":",
                         label="t chosen on simulated frames")  # fmt: skip
            axes.plot(one["threshold"], one["miou"], "o", color=VERMILION, markersize=5)
            axes.set_title(f"{_short(one['name'])}\n({one['kind']} data)", fontsize=8)
            axes.set(xlim=(0, 1), ylim=(0.4, 1.0))
            axes.tick_params(labelbottom=True)
            plain_axes(axes)
        for axes in panels.flat[max(0, len(data) - CURVE_COLUMNS) : len(data)]:
            axes.set_xlabel("t: an object is where x > t max(x)", fontsize=8)
        figure.supylabel("mean MIoU of the frames with metal", fontsize=9)
        legend_below(figure, panels.flat[0], 3)


def curves_data(results: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The numbers of :func:`draw_curves`."""
    return [
        {
            "name": one["name"],
            "kind": one["kind"],
            "simulated": np.round(one["tuned_curve"], 4).tolist(),
            "measured": np.round(one["touch_like_curve"], 4).tolist(),
            "threshold": one["threshold"],
            "miou": round(float(np.mean(one["touch_like"])), 4),
        }
        for one in results
    ]


def _short(name: str) -> str:
    for long, short in SHORT:
        name = name.replace(long, short)
    return name
