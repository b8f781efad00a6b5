"""Skins of several shapes: how sensitive they are where, one reconstruction, and which touches were
found."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.fem.grid import grid_for
from eitskin.skin.skin import Skin
from eitskin.view.pictures import RIM, Mark, Panel, draw_panel
from eitskin_studies.pictures.style import BLUE, VERMILION, drawing, legend_below

MIN_LOG10 = -3.0
FOUND, MISSED = BLUE, VERMILION
SENSITIVITY = "log10 of the sensitivity\nrelative to the greatest"
CHANGE = "change of conductivity\nrelative to its largest"


@dataclass(frozen=True, eq=False)
class ShapePanel:
    """The data that a skin's picture shows.

    Attributes:
        name: above its column.
        sensitivity_log10: (n,) of each pixel, over the greatest.
        image: (n,) of one scene, S/m.
        true, found: its touches and those found, [x, y, radius] in mm.
        places: of every test touch, [x, y] in mm; ``hit`` says which were found.
    """

    name: str
    skin: Skin
    sensitivity_log10: Sequence[float]
    image: Sequence[float]
    true: Sequence[Sequence[float]]
    found: Sequence[Sequence[float]]
    places: Sequence[Sequence[float]]
    hit: Sequence[bool]


def draw_shapes(path: str | Path, shapes: Sequence[ShapePanel]) -> None:
    """A column a skin: sensitivity with electrodes | a reconstruction with its truth | every test
    touch, found or missed; PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    with drawing(path, 1.8 * len(shapes) + 1.3, 6.6) as figure:
        cells = figure.add_gridspec(3, len(shapes) + 1, width_ratios=[1.0] * len(shapes) + [0.06])
        rows = [[figure.add_subplot(cells[row, k]) for k in range(len(shapes))] for row in range(3)]
        seen: Any = None
        coloured: Any = None
        for k, shape in enumerate(shapes):
            grid = grid_for(shape.skin.outline)
            draw_panel(rows[0][k], shape.skin, grid, Panel(shape.name), small=True)
            x0, y0 = grid.origin_mm
            extent = (x0, x0 + grid.nx * grid.pixel_mm, y0, y0 + grid.ny * grid.pixel_mm)
            colours: dict[str, Any] = {
                "cmap": "viridis",
                "vmin": MIN_LOG10,
                "vmax": 0.0,
                "interpolation": "nearest",
            }
            seen = rows[0][k].imshow(
                grid.image(shape.sensitivity_log10),
                origin="lower",
                extent=extent,
                zorder=1,
                **colours,
            )
            rim = shape.skin.outline.points_at(
                np.linspace(0, shape.skin.outline.perimeter_mm, 721)[:-1]
            )
            sheet = Polygon(
                rim, closed=True, facecolor="none", edgecolor=RIM, linewidth=0.7, zorder=2
            )
            rows[0][k].add_patch(sheet)
            seen.set_clip_path(sheet)
            true, found = (
                tuple(Mark(*one) for one in discs) for discs in (shape.true, shape.found)
            )
            panel = Panel("", np.asarray(shape.image), true, found)
            coloured = draw_panel(rows[1][k], shape.skin, grid, panel, small=True)
            draw_panel(rows[2][k], shape.skin, grid, Panel(""), small=True)
            places, hit = (
                np.asarray(shape.places).reshape(-1, 2),
                np.asarray(shape.hit, dtype=np.bool_),
            )
            rows[2][k].plot(*places[hit].T, ".", color=FOUND, markersize=2.2, zorder=3)
            rows[2][k].plot(
                *places[~hit].T, "x", color=MISSED, markersize=4.5, markeredgewidth=1.1, zorder=4
            )
        for number, (handle, label) in enumerate(((seen, SENSITIVITY), (coloured, CHANGE))):
            figure.colorbar(handle, cax=figure.add_subplot(cells[number, -1])).set_label(label)
        marks = [
            (Line2D([], [], marker=".", color=FOUND, linestyle="none"), "found touch"),
            (Line2D([], [], marker="x", color=MISSED, linestyle="none"), "missed touch"),
        ]
        legend_below(figure, marks, 2)
        figure.suptitle(
            "Sensitivity; one scene (solid: true touches, dashed: found ones); every test touch",
            fontsize=10,
        )
