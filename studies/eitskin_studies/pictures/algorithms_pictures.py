"""The pictures of the experiment ``algorithms``: images, the same with a threshold, curves, and
bars beside the paper's."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.arrays import BoolArray
from eitskin.fem.grid import Grid
from eitskin.scoring import metrics
from eitskin.skin.skin import Skin
from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, Mark, Panel, draw_panel, load_matplotlib
from eitskin_studies.experiments.algorithms.results import FIXED_THRESHOLD, AlgorithmResult
from eitskin_studies.experiments.algorithms.scenes import shown_set
from eitskin_studies.harness.thresholds import THRESHOLDS
from eitskin_studies.pictures.comparison_pictures import truth_marks

if TYPE_CHECKING:
    from matplotlib.axes import Axes


LEFT_OUT = (
    "plain FISTA 30, signed",
    "plain FISTA 300, signed",
)  # of pictures of images: they look as the non-negative ones do
HIT, FALSE, MISSED, SKIN = "#1b7f6b", "#e8902e", "#7d7d7d", "#f1f1ef"
FIXED, BEST, PAPER = "#b9c7d8", "#1f5fa8", "#b3261e"
PANEL_INCH = 1.3


def draw_images(path: Path, *, skin: Skin, grid: Grid, results: Sequence[AlgorithmResult]) -> None:
    """A row a scene, a column a method at its best parameter, the truth first and drawn into each,
    as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    kept = _kept(results)
    matplotlib = load_matplotlib()
    scenes = shown_set(0).scenes
    with matplotlib.rc_context(STYLE):
        figure, axes = _panels(matplotlib, len(scenes), 1 + len(kept))
        for k, scene in enumerate(scenes):
            marks = truth_marks(scene, skin.conductivity_s_per_m)
            draw_panel(
                axes[k, 0], skin, grid, Panel(scene.name, None, marks, fill_truth=True), small=True
            )
            for column, one in enumerate(kept, start=1):
                found = tuple(
                    Mark(float(x), float(y))
                    for x, y in one.shown["found_mm"][one.shown["found_in"] == k]
                )
                miou = one.shown[metrics.LOOKUP][k, THRESHOLDS.index(one.chosen.threshold)]
                panel = Panel(_title(one, k, float(miou)), one.shown["images"][k], marks, found)
                draw_panel(axes[k, column], skin, grid, panel, small=True)
        figure.suptitle(
            "The same frames by every method, each at the parameter that was best on tuning scenes",
            fontsize=11,
        )
        note = (
            "circles: true touches, crosses: found; red: more conductive, blue: less, each panel by"
            " its own largest size; number: MIoU at the method's own t"
        )
        figure.supxlabel(note, fontsize=8)
        save_picture(figure, path)


def draw_masks(path: Path, *, skin: Skin, grid: Grid, results: Sequence[AlgorithmResult]) -> None:
    """Draw the pixels that are taken for touches: two rows a scene, at the fixed parameter and t,
    and at the chosen ones; raises as draw_images."""
    from matplotlib.patches import Patch

    kept = _kept(results)
    matplotlib = load_matplotlib()
    scenes, raster = shown_set(0).scenes, metrics.raster_inside(skin.outline)
    lookup = metrics.lookup_for(raster.points_mm, grid, metrics.LOOKUP)
    with matplotlib.rc_context(STYLE):
        figure, axes = _panels(matplotlib, 2 * len(scenes), len(kept))
        for k, scene in enumerate(scenes):
            truth = metrics.disc_mask(raster.points_mm, scene.centres_mm(), scene.radii_mm())
            for column, one in enumerate(kept):
                for below, (of, t) in enumerate(
                    ((one.shown_fixed, FIXED_THRESHOLD), (one.shown, one.chosen.threshold))
                ):
                    image = of["images"][k]
                    # as in Judge.curves: above t times the largest pixel, not the largest cell
                    top = float(image.max())
                    mask = (
                        lookup.show(image) > t * top
                        if top > 0
                        else np.zeros(len(truth), dtype=np.bool_)
                    )
                    here: Axes = axes[2 * k + below, column]
                    draw_panel(here, skin, grid, Panel("", None), small=True)
                    _show_cells(here, raster, truth, mask)
                    name = f"{one.candidate.short}\n" if k == below == 0 else ""
                    here.set_title(f"{name}t = {t:g}: {metrics.miou(mask, truth):.2f}", fontsize=8)
        handles = [Patch(color=HIT, label="touch, found"),
            Patch(color=FALSE, label="taken for touch, is none"),
                   Patch(color=MISSED, label="touch, missed")]  # fmt: skip
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
        figure.suptitle(
            "What is taken for touch: x > t max(x). Upper row of each scene: fixed parameter, "
            f"t = {FIXED_THRESHOLD:g}; lower: both chosen on tuning scenes. Number: MIoU",
            fontsize=11,
        )
        save_picture(figure, path)


def draw_curves(path: Path, *, results: Sequence[AlgorithmResult]) -> None:
    """Mean MIoU of all test scenes over t, at fixed parameters and at the chosen ones; raises as
    draw_images."""
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(11.5, 5.0), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, fixed in ((left, True), (right, False)):
            for k, one in enumerate(_kept(results)):
                curve = one.curve(fixed)
                (line,) = axes.plot(THRESHOLDS, curve, **_line(one, k), label=one.candidate.name)
                t = FIXED_THRESHOLD if fixed else one.chosen.threshold
                axes.plot(t, curve[THRESHOLDS.index(t)], "o", color=line.get_color(), markersize=4)
            axes.axhspan(0.4, 0.5, color=PAPER, alpha=0.08, linewidth=0)
            axes.axhline(0.84, color=PAPER, linewidth=0.9, linestyle=(0, (2, 2)))
            axes.set_xlim(0, 1)
            axes.set_xlabel("threshold t: touch where x > t max(x)")
            axes.grid(linewidth=0.4, alpha=0.5)
        left.axvline(FIXED_THRESHOLD, color=INK, linewidth=0.9, linestyle=":")
        left.set_title(f"parameters fixed; dots: t = {FIXED_THRESHOLD:g}")
        right.set_title("each method's best parameter; dots: t chosen on tuning scenes")
        left.set_ylabel("mean MIoU of all test scenes")
        left.text(0.99, 0.845, "the paper: FISTA 0.84", color=PAPER, fontsize=8, ha="right")
        left.text(0.99, 0.405, "the paper: others 0.4 to 0.5", color=PAPER, fontsize=8, ha="right")
        right.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
        save_picture(figure, path)


def draw_bars(path: Path, *, results: Sequence[AlgorithmResult]) -> None:
    """MIoU at fixed parameters and threshold, at the chosen ones, and what the paper gives; raises
    as draw_images."""
    from matplotlib.lines import Line2D

    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(8.6, 5.4), layout="constrained")
        axes = figure.add_subplot()
        places = np.arange(len(results))[::-1]
        for up, colour, ink, label, summaries in (
            (
                0.2,
                FIXED,
                INK,
                f"fixed parameter, t = {FIXED_THRESHOLD:g}",
                [one.at_fixed() for one in results],
            ),
            (
                -0.2,
                BEST,
                "white",
                "both chosen on tuning scenes",
                [one.at_best() for one in results],
            ),
        ):
            means = [s.mean for s in summaries]
            reach = [[s.mean - s.low for s in summaries], [s.high - s.mean for s in summaries]]
            axes.barh(
                places + up,
                means,
                0.38,
                color=colour,
                label=label,
                xerr=reach,
                error_kw={"linewidth": 0.8},
            )
            for place, summary in zip(places, summaries, strict=True):
                axes.text(
                    0.01, place + up, f"{summary.mean:.2f}", va="center", fontsize=7, color=ink
                )
        for place, one in zip(places, results, strict=True):
            if one.candidate.claimed is not None:
                low, high = one.candidate.claimed
                axes.plot(
                    [low, high],
                    [place, place],
                    color=PAPER,
                    linewidth=3.0,
                    marker="|",
                    markersize=16,
                    markeredgewidth=1.6,
                )
        handles, labels = axes.get_legend_handles_labels()
        handles.append(Line2D([], [], color=PAPER, linewidth=3.0, marker="|", markersize=12))
        axes.legend(handles, [*labels, "the paper, on its own images"], frameon=False, fontsize=8,
            loc="upper center",
                    bbox_to_anchor=(0.5, -0.1), ncols=3)  # fmt: skip
        axes.set_yticks(places, [one.candidate.name for one in results])
        axes.set_xlim(0, 1.0)
        axes.set_xlabel("mean MIoU of all test scenes; thin lines: 95 % interval")
        axes.set_title("One rule for all, or each at its best")
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        save_picture(figure, path)


def _kept(results: Sequence[AlgorithmResult]) -> list[AlgorithmResult]:
    return [one for one in results if one.candidate.name not in LEFT_OUT]


def _title(one: AlgorithmResult, row: int, miou: float) -> str:
    return f"{one.candidate.short}\n{miou:.2f}" if row == 0 else f"{miou:.2f}"


def _panels(matplotlib: Any, rows: int, columns: int) -> tuple[Any, Any]:
    size = (PANEL_INCH * columns + 0.2, (PANEL_INCH + 0.2) * rows + 1.0)
    figure = matplotlib.figure.Figure(figsize=size, layout="compressed")
    return figure, figure.subplots(rows, columns, squeeze=False)


def _show_cells(axes: "Axes", raster: metrics.Raster, truth: BoolArray, mask: BoolArray) -> None:
    """Hits, false and missed cells in their colours, the truth's edge drawn in."""
    from matplotlib.colors import ListedColormap

    step = raster.spacing_mm
    low = raster.points_mm.min(axis=0) - step / 2
    place = np.floor((raster.points_mm - low) / step).astype(np.int64)
    cells = np.full(place.max(axis=0)[::-1] + 1, np.nan)
    cells[place[:, 1], place[:, 0]] = np.where(truth, np.where(mask, 1, 3), np.where(mask, 2, 0))
    extent = (low[0], low[0] + cells.shape[1] * step, low[1], low[1] + cells.shape[0] * step)
    colours = ListedColormap([SKIN, HIT, FALSE, MISSED])
    axes.imshow(
        cells,
        origin="lower",
        extent=extent,
        cmap=colours,
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
        zorder=1,
    )


def _line(one: AlgorithmResult, place: int) -> dict[str, Any]:
    """Plain FISTA in reds by its iterations, dashed where signed; what is here in black; the others
    by turns."""
    if one.candidate.own:
        return {
            "color": INK,
            "linewidth": 2.0,
            "linestyle": "-" if "image" in one.candidate.name else "--",
        }
    for iterations, colour in ((3000, "#8c1515"), (300, "#d9534f"), (30, "#f0a8a0")):
        if one.candidate.name.startswith(f"plain FISTA {iterations},"):
            return {
                "color": colour,
                "linewidth": 1.3,
                "linestyle": "--" if "signed" in one.candidate.name else "-",
            }
    return {
        "color": ("#7f7f7f", "#1f77b4", "#17a2b8", "#2ca02c", "#9467bd")[place % 5],
        "linewidth": 1.3,
    }
