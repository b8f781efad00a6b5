"""The pictures of the experiment on many touches: exact counts, example scenes, and what doubt is
worth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.fem.grid import grid_for
from eitskin.skin.skin import Skin
from eitskin.view.panels import draw_panels
from eitskin.view.pictures import INK, Mark, Panel
from eitskin_studies.experiments.multitouch.ambiguity import ScoredFrame
from eitskin_studies.experiments.multitouch.ambiguity_tables import found_some, reliabilities
from eitskin_studies.experiments.multitouch.cells import GEOMETRIES, MAX, MIN, NARROW, RING, WIDE
from eitskin_studies.experiments.multitouch.counts import Score, Share, auc, roc, share_of
from eitskin_studies.experiments.multitouch.gallery import Example
from eitskin_studies.experiments.multitouch.measure import Ambiguities, CountedScenes
from eitskin_studies.experiments.multitouch.tables import NAMES, SHORT
from eitskin_studies.experiments.multitouch.test_data import CLASSICAL, HEADLINE_DB, SNRS_DB
from eitskin_studies.pictures.comparison_pictures import truth_marks
from eitskin_studies.pictures.style import (
    BLACK,
    BLUE,
    COLOURS,
    GREY,
    PURPLE,
    SNR_COLOURS,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CLASSICAL_COLOURS, CLASSICAL_MARKERS = (GREY, BLACK, PURPLE), ("s", "^", "D")
TITLES = {RING: "ring of 60 mm", WIDE: "random, 4 radii apart", NARROW: "random, 2.5 radii apart"}
NEAREST_EDGES = (0.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.5, 20.0)
REPORTED, NOT_REPORTED = VERMILION, BLUE


def draw_counts(path: str | Path, counted: CountedScenes) -> None:
    """Exact counts over the number of touches: a row a variant of the core beside the classical
    methods, a column a geometry.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    with drawing(path, 10.5, 2.9 * len(NAMES) + 0.5) as figure:
        panels = figure.subplots(len(NAMES), len(GEOMETRIES), sharex=True, sharey=True)
        for row, variant in zip(panels, NAMES, strict=True):
            lines = [
                (variant, snr_db, SNR_COLOURS[snr_db], "o", f"core, {snr_db:g} dB")
                for snr_db in SNRS_DB
            ]
            lines += [
                (name, HEADLINE_DB, colour, marker, f"{SHORT.get(name, name)}, {HEADLINE_DB:g} dB")
                for name, colour, marker in zip(
                    CLASSICAL, CLASSICAL_COLOURS, CLASSICAL_MARKERS, strict=True
                )
            ]
            for axes, geometry in zip(row, GEOMETRIES, strict=True):
                for place, (name, snr_db, colour, marker, label) in enumerate(lines):
                    points = [
                        (k, counted.scores[geometry, k, name, snr_db])
                        for k in range(MIN, MAX + 1)
                        if (geometry, k, name, snr_db) in counted.scores
                    ]
                    if points:
                        shift = (place - len(lines) / 2) * 0.06
                        _line(axes, points, shift, colour, marker, label)
                axes.set(ylim=(-3, 105), xticks=range(MIN, MAX + 1))
                axes.set_title(f"{variant}: {TITLES[geometry]}", fontsize=9)
                axes.tick_params(labelbottom=True)
                plain_axes(axes)
            row[0].set_ylabel("scenes counted exactly, %")
        for axes in panels[-1]:
            axes.set_xlabel("touches")
        legend_below(figure, panels[0, 0], 6)


def _line(
    axes: Axes,
    points: Sequence[tuple[int, Score]],
    shift: float,
    colour: str,
    marker: str,
    label: str,
) -> None:
    """Shares in %, with their intervals, side by side."""
    mean, errors = (100 * values for values in _means([score.exact for _, score in points]))
    x = np.array([k for k, _ in points]) + shift
    axes.errorbar(
        x, mean, errors, color=colour, marker=marker, label=label, elinewidth=0.7, capsize=1.5,
        linewidth=1.3, markersize=3,
    )  # fmt: skip


def _means(shares: Sequence[Share]) -> tuple[FloatArray, FloatArray]:
    """Means (k,) and how far their intervals reach below and above (2, k)."""
    values = (
        np.array([(one.mean, one.low, one.high) for one in shares], dtype=np.float64)
        .reshape(-1, 3)
        .T
    )
    return values[0], np.maximum([values[0] - values[1], values[2] - values[0]], 0.0)


def draw_gallery(path: str | Path, skin: Skin, examples: Sequence[Example]) -> None:
    """A column an example: truth, the core, Gauss-Newton.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    truths = [truth_marks(one.scene, skin.conductivity_s_per_m) for one in examples]
    panels = [
        Panel(f"{one.title}", None, truth, fill_truth=True)
        for one, truth in zip(examples, truths, strict=True)
    ]
    for one, truth in zip(examples, truths, strict=True):
        found = tuple(Mark(*map(float, row)) for row in one.found)
        panels.append(
            Panel(f"core: {len(found)}{', crowded' if one.said else ''}", one.image, truth, found)
        )
    for one, truth in zip(examples, truths, strict=True):
        found = tuple(Mark(*map(float, row)) for row in one.classical)
        panels.append(Panel(f"Gauss-Newton: {len(found)}", one.classical_image, truth, found))
    note = (
        "60 dB; the first scene of each set. Circles: true touches; crosses (dashed: radius): found"
        " ones; above each: how many"
    )
    draw_panels(
        path,
        skin,
        grid_for(skin.outline, 32),
        panels,
        len(examples),
        title="Truth, core, Gauss-Newton",
        note=note,
    )


def draw_ambiguity(path: str | Path, ambiguities: Ambiguities) -> None:
    """Draw how well ``crowded`` and the score predict errors, by a frame's features; mixed test
    scenes, the default variant.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    frames = ambiguities.mixed[NAMES[0]]
    says = {
        "crowded": np.array([f.said for f in frames], dtype=np.bool_),
        "score": ambiguities.rule.says(frames),
    }
    with drawing(path, 11.5, 6.8) as figure:
        for row, (signal, said) in enumerate(says.items()):
            for column, (title, ticks, group) in enumerate(_groupings(frames)):
                axes = figure.add_subplot(2, 4, 4 * row + column + 1)
                _bars(axes, frames, said, group, ticks)
                if (row, column) == (0, 0):
                    axes.legend(frameon=False, fontsize=7, loc="lower left")
                axes.set_xlabel(title)
                axes.set_title(
                    f"{signal}: reported in {100 * said.mean():.0f} % of frames", fontsize=9
                )
                if column == 0:
                    axes.set_ylabel("share with the right count")
        axes = figure.add_subplot(2, 4, 4)
        _chances(axes, ambiguities)
        axes = figure.add_subplot(2, 4, 8)
        _trade(axes, ambiguities)
        for axes in figure.axes:
            plain_axes(axes)


def _groupings(frames: Sequence[ScoredFrame]) -> list[tuple[str, list[str], IntArray]]:
    found = np.array([f.found for f in frames])
    near = np.digitize([f.nearest for f in frames], NEAREST_EDGES[1:])
    snr = np.array([SNRS_DB.index(f.snr_db) for f in frames])
    edges = ["0", *(f"{low:g}" for low in NEAREST_EDGES[1:-1]), "one"]
    return [
        ("touches found", [str(k) for k in range(int(found.max()) + 1)], found),
        ("nearest pair / sum of its radii, from", edges, near),
        ("SNR, dB", [f"{one:g}" for one in SNRS_DB], snr),
    ]


def _bars(
    axes: Axes,
    frames: Sequence[ScoredFrame],
    said: BoolArray,
    group: IntArray,
    ticks: Sequence[str],
) -> None:
    right = np.array([f.right for f in frames], dtype=np.bool_)
    for offset, which, colour, label in (
        (-0.15, ~said, NOT_REPORTED, "frames without the report"),
        (0.15, said, REPORTED, "frames with it"),
    ):
        shares = [share_of(right[which & (group == k)]) for k in range(len(ticks))]
        kept = [(k, one) for k, one in enumerate(shares) if one.count >= 5]
        _points(axes, [k + offset for k, _ in kept], [one for _, one in kept], colour, label)
    whole = np.array([max(1, int((group == k).sum())) for k in range(len(ticks))])
    axes.bar(range(len(ticks)), [said[group == k].sum() / whole[k] for k in range(len(ticks))],
        color=REPORTED, alpha=0.13, zorder=0,
             label="share of frames with it")  # fmt: skip
    axes.set(ylim=(0, 1.03), xlim=(-0.6, len(ticks) - 0.4))
    axes.set_xticks(range(len(ticks)), ticks, fontsize=7)


def _points(
    axes: Axes, x: Sequence[float], shares: Sequence[Share], colour: str, label: str
) -> None:
    mean, errors = _means(shares)
    axes.errorbar(
        x,
        mean,
        errors,
        color=colour,
        marker="o",
        markersize=4,
        linestyle="none",
        elinewidth=1.0,
        label=label,
    )


def _chances(axes: Axes, ambiguities: Ambiguities) -> None:
    axes.plot([0, 1], [0, 1], color=INK, linewidth=0.7, linestyle=":")
    for number, name in enumerate(NAMES):
        one = reliabilities(ambiguities, name)["all"]
        kept = [(c, t) for c, t in zip(one.chance, one.truth, strict=True) if t.count >= 5]
        _points(
            axes,
            [c for c, _ in kept],
            [t for _, t in kept],
            COLOURS[number],
            f"{name}, Brier {one.brier:.3f}",
        )
    axes.set(xlabel="chance by the score", ylabel="share exact", xlim=(0, 1), ylim=(0, 1.03))
    axes.set_title("score: reliability", fontsize=9)
    axes.legend(frameon=False, fontsize=7, loc="upper left")


def _trade(axes: Axes, ambiguities: Ambiguities) -> None:
    """Exact frames of those not said, over how many are not said: as the bar moves, and where
    ``crowded`` is."""
    name = NAMES[0]
    for snr_db, colour in SNR_COLOURS.items():
        mine = [f for f in found_some(ambiguities.mixed[name]) if f.snr_db == snr_db]
        if not mine:
            continue
        exact = np.array([f.exact for f in mine])[
            np.argsort(-ambiguities.rule.scores(mine), kind="stable")
        ]
        part = np.arange(1, len(exact) + 1) / len(exact)
        so_far = np.cumsum(exact) / np.arange(1, len(exact) + 1)
        axes.plot(part, so_far, color=colour, linewidth=1.2, label=f"score, {snr_db:g} dB")
        untouched = [f for f in mine if not f.said]
        if untouched:
            axes.plot(
                len(untouched) / len(mine),
                np.mean([f.exact for f in untouched]),
                "x",
                color=colour,
                markersize=7,
            )
    axes.axhline(0.95, color=INK, linewidth=0.7, linestyle=":")
    axes.set(
        xlabel="share of frames without the report",
        ylabel="share of these that are exact",
        xlim=(0, 1),
        ylim=(0.3, 1.03),
    )
    axes.set_title("any threshold; crosses: crowded", fontsize=9)
    axes.legend(frameon=False, fontsize=7, loc="lower left")


def draw_touch_scores(path: str | Path, ambiguities: Ambiguities) -> None:
    """How a touch's numbers order true and false touches: ROC curves, a panel a variant.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    with drawing(path, 3.6 * len(NAMES), 4.4) as figure:
        panels = figure.subplots(1, len(NAMES), sharey=True)
        for axes, name in zip(panels, NAMES, strict=True):
            one = ambiguities.touches[name]
            named = (
                ("explained", one.explained),
                ("its root over noise", one.over_noise),
                ("strength / greatest", one.strength),
            )
            for (text, values), colour in zip(named, COLOURS, strict=False):
                false, true = roc(values, one.true)
                label = f"{text}: {auc(values, one.true):.3f}"
                axes.plot(100 * false, 100 * true, linewidth=1.3, color=colour, label=label)
            axes.plot([0, 100], [0, 100], color=INK, linewidth=0.7, linestyle=":")
            axes.set(xlabel="false touches above the threshold, %", title=name, aspect="equal")
            plain_axes(axes)
            axes.legend(frameon=False, fontsize=8, loc="lower right", title="area below the curve",
                        title_fontsize=8)  # fmt: skip
        panels[0].set_ylabel("true touches above the threshold, %")
