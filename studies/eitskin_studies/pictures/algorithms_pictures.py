"""The pictures of the experiment ``algorithms``: images, the same with a threshold, curves, and
bars beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.fem.grid import grid_for
from eitskin.scoring import metrics
from eitskin.skin.skin import Skin, paper_skin
from eitskin.view.pictures import INK, Mark, Panel, draw_panel
from eitskin_studies.experiments.algorithms.scenes import shown_set
from eitskin_studies.pictures.comparison_pictures import truth_marks
from eitskin_studies.pictures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HIT, FALSE, MISSED, EMPTY = GREEN, ORANGE, GREY, "#f1f1ef"
FIXED, BEST, PAPER = SKY, BLUE, VERMILION
CURVES = {
    "linear back projection": GREY,
    "Gauss-Newton (Tikhonov)": SKY,
    "NOSER": GREEN,
    "GREIT-like": PURPLE,
    "plain FISTA 30, non-negative": ORANGE,
    "plain FISTA 300, non-negative": VERMILION,
    "plain FISTA 3000, non-negative": BLACK,
    "eitskin 60, solver's image": BLUE,
    "eitskin 60, image shown": BLUE,
}  # the methods that have a curve and a column of images
PANEL_INCH = 1.15


def draw_images(path: Path, data: Mapping[str, Any]) -> None:
    """A row a scene, a column a method at its best parameter, the truth first and drawn into each.
    ``data`` has the test ``seed`` and the ``methods``: short name, and for each scene the image in
    hundredths of its largest value, the places found, and MIoU at the chosen threshold.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    skin, kept = paper_skin(), data["methods"]
    scenes = shown_set(data["seed"]).scenes
    with drawing(path, *_size(len(scenes), 1 + len(kept))) as figure:
        axes = figure.subplots(len(scenes), 1 + len(kept), squeeze=False)
        for row, scene in enumerate(scenes):
            marks = truth_marks(scene, skin.conductivity_s_per_m)
            truth = Panel(f"truth,\n{scene.name}", None, marks, fill_truth=True)
            _small_panel(axes[row, 0], skin, truth)
            for here, one in zip(axes[row, 1:], kept, strict=True):
                found = tuple(Mark(x, y) for x, y in one["found_mm"][row])
                heading = f"{one['short']}\n" if row == 0 else ""
                title = f"{heading}{one['miou'][row]:.2f}"
                image = np.array(one["images"][row])
                _small_panel(here, skin, Panel(title, image, marks, found))
        figure.suptitle("The same frames by each method; the number is the MIoU", fontsize=10)
        figure.supxlabel(
            "circles: true touches; crosses: found touches; red: more conductive, blue: less,"
            " relative to the largest change in the panel",
            fontsize=8,
        )


def draw_masks(path: Path, data: Mapping[str, Any]) -> None:
    """The pixels of the scene with three touches that are taken for touches: a row at the fixed
    parameter and t, and one at the chosen ones. ``data`` has the test ``seed`` and two ``rows``:
    title, and for each method its short name, t, image in thousandths of its largest value, and
    MIoU; raises as draw_images."""
    from matplotlib.patches import Patch

    skin, rows = paper_skin(), data["rows"]
    scene, raster = shown_set(data["seed"]).scenes[-1], metrics.raster_inside(skin.outline)
    lookup = metrics.lookup_for(raster.points_mm, grid_for(skin.outline), metrics.LOOKUP)
    truth = metrics.disc_mask(raster.points_mm, scene.centres_mm(), scene.radii_mm())
    columns = len(rows[0]["methods"])
    with drawing(path, *_size(len(rows), columns)) as figure:
        axes = figure.subplots(len(rows), columns, squeeze=False)
        for k, row in enumerate(rows):
            for here, one in zip(axes[k], row["methods"], strict=True):
                image = np.array(one["image"])
                # as in miou_curves: above t times the largest pixel, not the largest cell
                mask = lookup.show(image) > one["t"] * max(float(image.max()), 0.0)
                heading = "" if k else f"{one['short']}\n"
                title = f"{heading}t = {one['t']:g}\nMIoU {one['miou']:.2f}"
                _small_panel(here, skin, Panel(title, None))
                kinds = np.where(truth, np.where(mask, 1, 3), np.where(mask, 2, 0))
                _show_cells(here, raster, kinds)
        legend_below(
            figure,
            [
                (Patch(color=HIT), "true touch, found"),
                (Patch(color=FALSE), "no touch, but taken for one"),
                (Patch(color=MISSED), "true touch, missed"),
            ],
            3,
        )
        above, below = (row["title"] for row in rows)
        figure.suptitle(f"Pixels with x > t max(x). Above: {above}; below: {below}", fontsize=10)


def draw_curves(path: Path, data: Mapping[str, Any]) -> None:
    """Mean MIoU of all test scenes over t, at fixed parameters and at the chosen ones. ``data`` has
    ``thresholds``, ``fixed_threshold`` and the ``methods``: name, both curves and the chosen
    threshold; raises as draw_images."""
    ts = data["thresholds"]
    with drawing(path, 10.5, 5.4) as figure:
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        for axes, curve in ((left, "fixed_curve"), (right, "best_curve")):
            for one in data["methods"]:
                name, values = one["name"], one[curve]
                ours = name.startswith("eitskin")
                axes.plot(ts, values, "--" if name.endswith("shown") else "-", label=name,
                          color=CURVES[name], linewidth=2.0 if ours else 1.2)  # fmt: skip
                t = data["fixed_threshold"] if curve == "fixed_curve" else one["threshold"]
                axes.plot(t, values[ts.index(t)], "o", color=CURVES[name], markersize=4)
            axes.axhspan(0.4, 0.5, color=PAPER, alpha=0.1, linewidth=0)
            axes.axhline(0.84, color=PAPER, linewidth=0.9, linestyle=":")
            axes.set(xlim=(0, 1), xlabel="threshold t: a touch is where x > t max(x)")
            plain_axes(axes)
        left.set_title(f"fixed parameter; dots: t = {data['fixed_threshold']:g}")
        right.set_title("parameter and t (dots) chosen on tuning scenes")
        left.set_ylabel("mean MIoU of all test scenes")
        for y, text in ((0.845, "the paper's FISTA: 0.84"), (0.405, "its others: 0.4 to 0.5")):
            left.text(0.99, y, text, color=PAPER, fontsize=8, ha="right")
        legend_below(figure, left, 3)


def draw_bars(path: Path, data: Mapping[str, Any]) -> None:
    """MIoU at fixed parameters and threshold, at the chosen ones, and what the paper gives.
    ``data`` has ``fixed_threshold`` and the ``methods``: name, ``fixed`` and ``best`` (mean, low,
    high), and the range that the paper ``claimed`` or null; raises as draw_images."""
    from matplotlib.lines import Line2D

    methods, t = data["methods"], data["fixed_threshold"]
    with drawing(path, 8.6, 5.4) as figure:
        axes = figure.subplots()
        for key, up, colour, ink, label in (
            ("fixed", -0.2, FIXED, INK, f"fixed parameter, t = {t:g}"),
            ("best", 0.2, BEST, "white", "parameter and t chosen on tuning scenes"),
        ):
            mean, low, high = np.array([one[key] for one in methods]).T
            places = np.arange(len(methods)) + up
            axes.barh(places, mean, 0.38, color=colour, label=label, xerr=[mean - low, high - mean],
                      error_kw={"linewidth": 0.8})  # fmt: skip
            for place, value in zip(places, mean, strict=True):
                axes.text(0.01, place, f"{value:.2f}", va="center", fontsize=7, color=ink)
        end: dict[str, Any] = {
            "color": PAPER,
            "linewidth": 2.5,
            "marker": "|",
            "markeredgewidth": 2.5,
        }
        for place, one in enumerate(methods):
            if one["claimed"] is not None:
                axes.plot(one["claimed"], [place, place], markersize=14, **end)
        axes.set_yticks(range(len(methods)), [one["name"] for one in methods])
        axes.invert_yaxis()
        axes.set(xlim=(0, 1), xlabel="mean MIoU of all test scenes; thin lines: 95 % interval")
        axes.set_title("One rule for all methods, and each method at its best")
        plain_axes(axes, "x")
        bars, labels = axes.get_legend_handles_labels()
        entries = list(zip(bars, labels, strict=True))
        legend_below(
            figure, [*entries, (Line2D([], [], markersize=10, **end), "the paper's images")], 3
        )


def _size(rows: int, columns: int) -> tuple[float, float]:
    return PANEL_INCH * columns + 0.2, (PANEL_INCH + 0.3) * rows + 0.9


def _small_panel(axes: Axes, skin: Skin, panel: Panel) -> None:
    draw_panel(axes, skin, grid_for(skin.outline), panel, small=True)


def _show_cells(axes: Axes, raster: metrics.Raster, kind: Any) -> None:
    """Cells of the raster in the colours of their kind: empty, hit, false, missed."""
    from matplotlib.colors import ListedColormap

    step = raster.spacing_mm
    low = raster.points_mm.min(axis=0) - step / 2
    place = np.floor((raster.points_mm - low) / step).astype(np.int64)
    cells = np.full(place.max(axis=0)[::-1] + 1, np.nan)
    cells[place[:, 1], place[:, 0]] = kind
    axes.imshow(
        cells,
        origin="lower",
        extent=(low[0], low[0] + cells.shape[1] * step, low[1], low[1] + cells.shape[0] * step),
        cmap=ListedColormap([EMPTY, HIT, FALSE, MISSED]),
        vmin=-0.5,
        vmax=3.5,
        interpolation="nearest",
        zorder=1,
    )
