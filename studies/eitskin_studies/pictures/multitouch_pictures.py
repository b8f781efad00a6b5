"""The pictures of the experiment on many touches: exact counts, example scenes, what ``crowded`` is
worth, and what a touch's own numbers say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.fem.grid import grid_for
from eitskin.skin.skin import Skin
from eitskin.view.panels import draw_panels
from eitskin.view.pictures import INK, Mark, Panel
from eitskin_studies.experiments.multitouch.ambiguity import ScoredFrame
from eitskin_studies.experiments.multitouch.ambiguity_tables import found_some
from eitskin_studies.experiments.multitouch.cells import GEOMETRIES, MAX, MIN, NARROW, RING, WIDE
from eitskin_studies.experiments.multitouch.counts import Share, auc, roc, share_of
from eitskin_studies.experiments.multitouch.gallery import Example
from eitskin_studies.experiments.multitouch.measure import Ambiguities, CountedScenes
from eitskin_studies.experiments.multitouch.tables import NAMES, SHORT
from eitskin_studies.experiments.multitouch.test_data import CLASSICAL, HEADLINE_DB, SNRS_DB
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.comparison_pictures import truth_marks
from eitskin_studies.pictures.style import (
    BLACK,
    BLUE,
    COLOURS,
    GREY,
    MARKERS,
    PURPLE,
    SKY,
    SNR_COLOURS,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CORE, OTHERS = NAMES[0], (*NAMES[1:], *CLASSICAL)
OTHER_COLOURS = (VERMILION, SKY, GREY, BLACK, PURPLE)
TITLES = {RING: "ring of 60 mm", WIDE: "random, 4 radii apart", NARROW: "random, 2.5 radii apart"}
NEAREST_EDGES = (0.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.5, 20.0)
REPORTED, NOT_REPORTED = VERMILION, BLUE
LEAST_FRAMES = 5  # a share of fewer frames is not drawn
STEPS = 101  # of a curve

# a share as stored numbers have it: mean, low, high
Range = Sequence[float]


def _range(one: Share) -> list[float]:
    return [round(value, 4) for value in (one.mean, one.low, one.high)]


# ---- exact counts ----


def counts_drawing(counted: CountedScenes) -> Drawing:
    """Exact counts over the number of touches: a row the core by SNR, a row the core beside its
    variants and other methods at 60 dB."""
    rows = [
        [(CORE, snr_db, f"core, {snr_db:g} dB") for snr_db in SNRS_DB],
        [(CORE, HEADLINE_DB, f"core, {HEADLINE_DB:g} dB")]
        + [(name, HEADLINE_DB, f"{SHORT.get(name, name)}, 60 dB") for name in OTHERS],
    ]

    def line(geometry: str, name: str, snr_db: float) -> list[list[float]]:
        return [
            [k, *_range(counted.scores[geometry, k, name, snr_db].exact)]
            for k in range(MIN, MAX + 1)
            if (geometry, k, name, snr_db) in counted.scores
        ]

    return Drawing(
        draw_counts,
        [
            {
                label: {geometry: line(geometry, name, snr_db) for geometry in GEOMETRIES}
                for name, snr_db, label in row
            }
            for row in rows
        ],
    )


def draw_counts(
    path: Path, rows: Sequence[Mapping[str, Mapping[str, Sequence[Sequence[float]]]]]
) -> None:
    """Lines by label and geometry, of points [touches, mean, low, high].

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    colours = {f"core, {snr_db:g} dB": colour for snr_db, colour in SNR_COLOURS.items()}
    with drawing(path, 10.5, 6.4) as figure:
        panels = figure.subplots(len(rows), len(GEOMETRIES), sharex=True, sharey=True)
        for row, lines in zip(panels, rows, strict=True):
            for axes, geometry in zip(row, GEOMETRIES, strict=True):
                others = iter(zip(OTHER_COLOURS, MARKERS[1:], strict=False))
                for place, (label, line) in enumerate(lines.items()):
                    colour, marker = (
                        (colours[label], MARKERS[0]) if label in colours else next(others)
                    )
                    shift = (place - (len(lines) - 1) / 2) * 0.07
                    _line(axes, line[geometry], shift, colour, marker, label)
                axes.set(ylim=(-3, 104), xticks=range(MIN, MAX + 1))
                axes.tick_params(labelbottom=True)
                plain_axes(axes)
            row[0].set_ylabel("scenes counted exactly, %")
        for axes, geometry in zip(panels[0], GEOMETRIES, strict=True):
            axes.set_title(TITLES[geometry])
        for axes in panels[-1]:
            axes.set_xlabel("touches")
        named = {
            label: handle
            for axes in panels[:, 0]
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        legend_below(figure, [(handle, label) for label, handle in named.items()], 4)


def _line(
    axes: Axes,
    points: Sequence[Sequence[float]],
    shift: float,
    colour: str,
    marker: str,
    label: str,
) -> None:
    """Shares in %, with their intervals, side by side."""
    if not points:
        return
    mean, errors = (100 * values for values in _means([one[1:] for one in points]))
    axes.errorbar(
        [one[0] + shift for one in points], mean, errors, color=colour, marker=marker, label=label,
        elinewidth=0.6, linewidth=1.3, markersize=3.5,
    )  # fmt: skip


def _means(ranges: Sequence[Range]) -> tuple[FloatArray, FloatArray]:
    """Means (k,) and how far their intervals reach below and above (2, k)."""
    values = np.array(ranges, dtype=np.float64).reshape(-1, 3).T
    return values[0], np.maximum([values[0] - values[1], values[2] - values[0]], 0.0)


# ---- examples ----


def draw_gallery(path: str | Path, skin: Skin, examples: Sequence[Example]) -> None:
    """A column an example: truth, the core, Gauss-Newton.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    truths = [truth_marks(one.scene, skin.conductivity_s_per_m) for one in examples]
    panels = [
        Panel(one.title, None, truth, fill_truth=True)
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
    draw_panels(
        path,
        skin,
        grid_for(skin.outline, 32),
        panels,
        len(examples),
        title="The truth, the core, and Gauss-Newton, at 60 dB",
        note="Circles: true touches. Crosses: found touches, with their radius dashed; their number"
        " is above each panel. Each column is the first scene of its set.",
    )


# ---- what crowded is worth ----


def doubt_drawing(ambiguities: Ambiguities) -> Drawing:
    """How well ``crowded`` predicts wrong counts, by a frame's features; and the share of exact
    frames beside that of a linear score at any threshold. Mixed test scenes, the core."""
    frames = ambiguities.mixed[CORE]
    said = np.array([f.said for f in frames], dtype=np.bool_)
    curves = {}
    for snr_db in SNRS_DB:
        mine = [f for f in found_some(frames) if f.snr_db == snr_db]
        if mine:
            curves[f"{snr_db:g}"] = _curve(mine, ambiguities.rule.scores(mine))
    return Drawing(
        draw_doubt,
        {
            "groups": [
                {"title": title, "ticks": ticks, **_grouped(frames, said, group, len(ticks))}
                for title, ticks, group in _groupings(frames)
            ],
            "curves": curves,
        },
    )


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


def _grouped(
    frames: Sequence[ScoredFrame], said: BoolArray, group: IntArray, groups: int
) -> dict[str, Any]:
    """In each group the share of frames with the report, and of the right counts without and with
    it; None of too few frames."""
    right = np.array([f.right for f in frames], dtype=np.bool_)

    def shares(which: BoolArray) -> list[list[float] | None]:
        found = [share_of(right[which & (group == k)]) for k in range(groups)]
        return [_range(one) if one.count >= LEAST_FRAMES else None for one in found]

    whole = [max(1, int((group == k).sum())) for k in range(groups)]
    return {
        "reported": [round(float(said[group == k].sum() / whole[k]), 4) for k in range(groups)],
        "right without": shares(~said),
        "right with": shares(said),
    }


def _curve(frames: Sequence[ScoredFrame], scores: FloatArray) -> dict[str, Any]:
    """The share of exact frames among those with the highest scores, over how many these are; and
    where ``crowded`` is."""
    exact = np.array([f.exact for f in frames])
    so_far = np.cumsum(exact[np.argsort(-scores, kind="stable")]) / np.arange(1, len(exact) + 1)
    part = np.linspace(1, len(exact), min(STEPS, len(exact))).round().astype(int)
    silent = exact[~np.array([f.said for f in frames], dtype=np.bool_)]
    return {
        "score": [[round(k / len(exact), 4), round(float(so_far[k - 1]), 4)] for k in part],
        "crowded": [round(len(silent) / len(exact), 4), round(float(silent.mean()), 4)]
        if len(silent)
        else None,
    }


def draw_doubt(path: Path, data: Mapping[str, Any]) -> None:
    """A panel a grouping, and one with the curves.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    groups = data["groups"]
    widths = [len(group["ticks"]) + 4 for group in groups]
    with drawing(path, 11.5, 4.0) as figure:
        *panels, last = figure.subplots(1, len(groups) + 1, width_ratios=[*widths, 11])
        for axes, group in zip(panels, groups, strict=True):
            _bars(axes, group)
            axes.set_xlabel(group["title"])
        panels[0].set_ylabel("share of frames")
        panels[0].set_title("the report 'crowded'", loc="left")
        legend_below(figure, panels[0], 3)
        for name, curve in data["curves"].items():
            colour = SNR_COLOURS[float(name)]
            parts, exact = zip(*curve["score"], strict=True)
            last.plot(parts, exact, color=colour, linewidth=1.3, label=f"{name} dB")
            if curve["crowded"] is not None:
                last.plot(*curve["crowded"], "X", color=colour, markersize=8, markeredgecolor=INK)
        last.set(xlabel="share of frames without a report", ylim=(0, 1.03), xlim=(0, 1.03))
        last.set_ylabel("share of these that are exact")
        last.set_title(
            "lines: reported by the score\ncrosses: reported as 'crowded'", loc="left", fontsize=9
        )
        last.legend(frameon=False, fontsize=8, loc="lower left")
        for axes in (*panels, last):
            plain_axes(axes)


def _bars(axes: Axes, group: Mapping[str, Any]) -> None:
    for offset, key, colour, marker, label in (
        (-0.15, "right without", NOT_REPORTED, "o", "count right, frames without the report"),
        (0.15, "right with", REPORTED, "s", "count right, frames with it"),
    ):
        kept = [(k, one) for k, one in enumerate(group[key]) if one is not None]
        mean, errors = _means([one for _, one in kept])
        axes.errorbar(
            [k + offset for k, _ in kept], mean, errors, color=colour, marker=marker,
            markersize=4, linestyle="none", elinewidth=1.0, label=label,
        )  # fmt: skip
    at = range(len(group["ticks"]))
    axes.bar(
        at, group["reported"], color=REPORTED, alpha=0.15, zorder=0, label="frames with the report"
    )
    axes.set(ylim=(0, 1.03), xlim=(-0.6, len(at) - 0.4))
    axes.set_xticks(at, group["ticks"], fontsize=8)


# ---- a touch's own numbers ----


def touch_scores_drawing(ambiguities: Ambiguities) -> Drawing:
    """How a touch's numbers order true and false touches: ROC curves, a panel a variant."""
    at = np.linspace(0, 1, STEPS)
    curves: dict[str, dict[str, Any]] = {}
    for name in NAMES:
        one = ambiguities.touches[name]
        for text, values in (
            ("share explained", one.explained),
            ("its root over the noise", one.over_noise),
            ("strength / greatest", one.strength),
        ):
            true = np.interp(at, *roc(values, one.true))
            curves.setdefault(name, {})[text] = {
                "area": round(float(auc(values, one.true)), 3),
                "true": [round(float(value), 4) for value in true],
            }
    return Drawing(draw_touch_scores, curves)


def draw_touch_scores(path: Path, curves: Mapping[str, Mapping[str, Any]]) -> None:
    """True touches above a threshold over false ones, at equal steps of the latter.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    with drawing(path, 3.4 * len(curves), 3.9) as figure:
        panels = figure.subplots(1, len(curves), sharey=True)
        for axes, (name, lines) in zip(panels, curves.items(), strict=True):
            for (text, line), colour, style in zip(
                lines.items(), COLOURS, ("-", "--", "-."), strict=False
            ):
                false = np.linspace(0, 100, len(line["true"]))
                axes.plot(
                    false, 100 * np.array(line["true"]), style, linewidth=1.4, color=colour,
                    label=text,
                )  # fmt: skip
            areas = ", ".join(f"{line['area']:.3f}" for line in lines.values())
            axes.plot([0, 100], [0, 100], color=INK, linewidth=0.7, linestyle=":")
            axes.set_xlabel("false touches above the threshold, %")
            axes.set_title(f"{name}\nareas below: {areas}", fontsize=9)
            plain_axes(axes)
        panels[0].set_ylabel("true touches above the threshold, %")
        legend_below(figure, panels[0], 3)
