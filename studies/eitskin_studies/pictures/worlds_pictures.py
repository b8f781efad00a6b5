"""Other worlds: how many scenes are counted exactly in each set, and what goes wrong."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.view.pictures import INK, RIM
from eitskin_studies.pictures.style import (
    BLUE,
    ORANGE,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
)
from eitskin_studies.worlds.worlds import in_words

FAILS_BELOW = 90.0


def draw_shares(path: Path, scores: Sequence[Mapping[str, Any]]) -> None:
    """A line a set: the share of exact scenes with its interval, and false touches per scene.
    ``scores`` has for each set its name, exact (share, low, high) and false_per_scene.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    from matplotlib.lines import Line2D

    rows = sorted(scores, key=lambda one: one["exact"][0])
    with drawing(path, 9.5, 0.24 * len(rows) + 1.4) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        for place, one in enumerate(rows):
            share, low, high = (100 * value for value in one["exact"])
            colour, marker = (VERMILION, "s") if share < FAILS_BELOW else (BLUE, "o")
            left.plot([low, high], [place, place], color=colour, linewidth=1.2)
            left.plot(share, place, marker, color=colour, markersize=4.5)
            right.plot(one["false_per_scene"], place, marker, color=colour, markersize=4.5)
        left.set_yticks(range(len(rows)), [in_words(one["name"]) for one in rows])
        left.invert_yaxis()
        left.set(xlabel="scenes counted exactly, %", xlim=(0, 102), title="exact counts")
        right.set(xlabel="false touches per scene", title="false touches")
        right.locator_params(axis="x", nbins=6)
        right.set_xlim(left=-0.01 * max(one["false_per_scene"] for one in rows) - 0.001)
        for axes in (left, right):
            plain_axes(axes)
        marks = [
            (Line2D([], [], color=colour, marker=marker, markersize=4.5, linewidth=1.2), text)
            for colour, marker, text in (
                (BLUE, "o", f"{FAILS_BELOW:g} % exact or more"),
                (VERMILION, "s", f"fewer than {FAILS_BELOW:g} % exact (lines: 95 % interval)"),
            )
        ]
        legend_below(figure, marks, 2)


def draw_examples(path: Path, data: Mapping[str, Any]) -> None:
    """A scene of each set that is counted wrong: true touches filled, found ones as circles.
    ``data`` has ``rim_mm`` (k, 2) of the skin, and ``examples``: for each set ``rims_mm`` of the
    true touches and x, y, radius of the found ones, ``found_mm``.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    rim = np.array(data["rim_mm"])
    turn = np.linspace(0, 2 * np.pi, 91)
    with drawing(path, 9.0, 6.8) as figure:
        panels = figure.subplots(2, 3, sharex=True, sharey=True)
        for axes, (name, example) in zip(panels.ravel(), data["examples"].items(), strict=False):
            axes.plot(*rim.T, color=RIM, linewidth=0.8)
            for edge in example["rims_mm"]:
                axes.fill(*np.array(edge).T, color=ORANGE, alpha=0.6, linewidth=0)
            for x, y, radius in example["found_mm"]:
                axes.plot(x + radius * np.cos(turn), y + radius * np.sin(turn), color=BLUE)
            axes.set_aspect("equal")
            axes.set_axis_off()
            axes.set_title(in_words(name), fontsize=9, color=INK)
        marks: list[tuple[Any, str]] = [
            (Patch(color=ORANGE, alpha=0.6, linewidth=0), "true touch"),
            (Line2D([], [], color=BLUE), "found touch"),
        ]
        legend_below(figure, marks, 2)
        figure.suptitle("The first scene of each set that is counted wrong", fontsize=10)
