"""Draw the result of teaching: each press with its place as estimated from the other presses, the
error by number of presses, and how much of each row is explained. Needs matplotlib."""

from pathlib import Path
from typing import Any

import numpy as np

from eitskin.teaching.teach import Taught
from eitskin.view.panels import check_picture, save_picture

GIVEN, FOUND, STRANGE = "#1f5f99", "#b0b7bd", "#c2410c"


def draw_taught(path: str | Path, taught: Taught) -> None:
    """Write the picture to ``path`` (.png, .pdf, .svg)."""
    check_picture(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.35, 1, 1))
    place, found = taught.learned.process.place_mm, taught.left_out.place_mm
    strange = np.isin(np.arange(len(place)), taught.report["strange_presses"])
    for k in range(len(place)):
        left.plot(*np.stack([place[k], found[k]]).T, color=FOUND, lw=1, zorder=1)
    left.scatter(*place.T, s=12, c=np.where(strange, STRANGE, GIVEN), zorder=2)
    if "skin" in taught.model.meta:
        rim = np.array(taught.model.skin.outline.vertices_mm)
        left.plot(*np.vstack([rim, rim[:1]]).T, color="#444", lw=0.8)
    left.set(aspect="equal", xlabel="mm")
    _title(left, "presses, and their places estimated from the others")
    curve = taught.report["held_out_by_presses"]
    for kind, style in (("measured", "o-"), ("expected", "o:")):
        points = [(int(n.split("_")[1]), v) for n, v in curve.items() if n.startswith(kind)]
        middle.plot(*np.array(points).T, style, color=GIVEN, label=kind)
    middle.set(xlabel="presses", ylim=(0, None))
    _title(middle, "median error, mm")
    middle.legend(frameon=False)
    right.plot(taught.left_out.explained, ".", color=GIVEN, ms=4)
    right.set(xlabel="row", ylim=(-0.1, 1))
    _title(right, "share of energy explained by the others")
    for panel in (left, middle, right):
        panel.spines[["top", "right"]].set_visible(False)
    save_picture(figure, path)


def _title(panel: Any, text: str) -> None:
    panel.set_title(text, fontsize=10, loc="left")
