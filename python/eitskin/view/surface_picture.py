"""Draw a surface with its electrodes, and its flattened copy by scale. Needs matplotlib."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.skin.skin import Skin
from eitskin.surface.surface_map import SurfaceMap, SurfaceTouch
from eitskin.view.panels import check_picture, save_picture

ELECTRODE, TOUCH = "#1f5f99", "#c2410c"
LABEL_POINTS = 9  # from an electrode to its number


def draw_surface(path: str | Path, skin: Skin, touches: Sequence[SurfaceTouch] = ()) -> None:
    """Write the picture of ``skin``, which has a surface, to ``path`` (.png, .pdf, .svg): to the
    left in the link's frame, with ``touches`` and their normals; to the right the flattened
    copy."""
    check_picture(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    assert skin.surface is not None
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    left = figure.add_subplot(1, 2, 1, projection="3d")
    right = figure.add_subplot(1, 2, 2)
    _draw_space(left, skin, skin.surface, touches)
    _draw_copy(figure, right, skin, skin.surface)
    save_picture(figure, path)


def _draw_space(
    panel: Any, skin: Skin, surface: SurfaceMap, touches: Sequence[SurfaceTouch]
) -> None:
    points = surface.points_mm
    panel.plot_trisurf(
        *points.T, triangles=surface.triangles, color="#d8d3c8", linewidth=0, alpha=0.75
    )
    centres = 1e3 * surface.at(skin.electrode_centres_mm()).point_m
    panel.scatter(*centres.T, color=ELECTRODE, s=14, depthshade=False)
    for k, centre in enumerate(centres):
        panel.text(*centre, f" {k}", fontsize=7, color=ELECTRODE)
    length = 0.2 * float(np.ptp(points, axis=0).max())
    turn = np.linspace(0, 2 * np.pi, 40)
    for number, one in enumerate(touches):
        edge = np.column_stack([np.cos(turn), np.sin(turn)]) @ one.tangents.T
        ring = 1e3 * (one.point_m + one.radius_m * edge) + 0.02 * length * one.normal
        label = None if number else "touch and the normal of the surface"
        panel.plot(*ring.T, color=TOUCH, lw=1.5, zorder=5, label=label)
        arrow = 1e3 * one.point_m + np.outer([0.0, length], one.normal)
        panel.plot(*arrow.T, color=TOUCH, lw=1.5, zorder=5)
    panel.set_box_aspect(np.ptp(points, axis=0))
    panel.set(zlabel="z, mm")
    panel.set_xlabel("x, mm", labelpad=10)
    panel.set_ylabel("y, mm", labelpad=14)
    panel.set_title("the surface in its link's frame, with its electrodes", fontsize=10, loc="left")
    if touches:
        panel.legend(loc="upper left", fontsize=8, frameon=False)


def _draw_copy(figure: Any, panel: Any, skin: Skin, surface: SurfaceMap) -> None:
    shown = panel.tripcolor(
        *surface.flat_mm.T, surface.triangles, surface.scales, shading="gouraud", cmap="viridis"
    )
    figure.colorbar(shown, ax=panel, label="true mm per mm of the copy", shrink=0.8)
    rim = np.vstack([surface.rim_mm, surface.rim_mm[:1]])
    panel.plot(*rim.T, color="#444", lw=0.8)
    centres = skin.electrode_centres_mm()
    panel.scatter(*centres.T, color=ELECTRODE, s=14, zorder=3)
    outward = centres - surface.rim_mm.mean(axis=0)
    outward *= LABEL_POINTS / np.linalg.norm(outward, axis=1, keepdims=True)
    for k, (centre, offset) in enumerate(zip(centres, outward, strict=True)):
        panel.annotate(str(k), centre, fontsize=7, color=ELECTRODE, xytext=offset,
                       textcoords="offset points", ha="center", va="center")  # fmt: skip
    panel.margins(0.08)
    panel.set(aspect="equal", xlabel="x of the copy, mm", ylabel="y of the copy, mm")
    panel.set_title("its flattened copy", fontsize=10, loc="left")
