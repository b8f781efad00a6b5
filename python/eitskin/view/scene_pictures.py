"""Draw an overview of a scene: the touches' paths on the skin, and the voltages of the electrodes
over time."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.fem.grid import grid_for
from eitskin.frames.frames import Frames
from eitskin.scene.description import Scene
from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, Panel, draw_panel, load_matplotlib

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIME_COLOURS = "viridis"
MAX_OUTLINES = 12


def draw_scene(path: str | Path, scene: Scene, frames: Frames) -> None:
    """Write the picture of ``scene`` and its ``frames``: touches by time on the left, voltage
    changes by row and time on the right."""
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.6, 4.9), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
        panel = Panel("touches, coloured by time")
        draw_panel(left, scene.skin, grid_for(scene.skin.outline), panel)
        _draw_touches(left, scene)
        left.set_ylabel("y (mm)")
        _draw_voltages(figure, right, scene, frames)
        named = ", ".join(scene.effects) or "none; ideal electrodes, no noise"
        title = f"{scene.name}: {scene.description}"
        figure.suptitle(title, fontsize=10.5, fontweight="bold", color=INK, wrap=True)
        figure.supxlabel(f"effects: {named}", fontsize=8, color=INK)
        save_picture(figure, path)


def _draw_touches(axes: "Axes", scene: Scene) -> None:
    """Draw each touch's path, and its outline at up to twelve times, more opaque if it presses
    harder."""
    from matplotlib import colormaps
    from matplotlib.patches import Circle

    colours = colormaps[TIME_COLOURS]
    for one in scene.samples():
        there = np.flatnonzero(one.there)
        if not len(there):
            continue
        axes.plot(one.x_mm[there], one.y_mm[there], color=INK, linewidth=0.8, alpha=0.6, zorder=3)
        most = float(np.abs(one.contrast[there] - 1).max())
        for k in there[np.unique(np.linspace(0, len(there) - 1, MAX_OUTLINES).round().astype(int))]:
            colour = colours(k / max(scene.frames - 1, 1))
            press = 0.15 + 0.85 * abs(float(one.contrast[k]) - 1) / most
            circle = Circle((one.x_mm[k], one.y_mm[k]), one.radius_mm[k], fill=False, zorder=4)
            circle.set(edgecolor=colour, linewidth=1.6, alpha=press)
            axes.add_patch(circle)


def _draw_voltages(figure: Any, axes: "Axes", scene: Scene, frames: Frames) -> None:
    reference = frames.reference_v
    change = 100 * (frames.voltage_v - reference) / np.sqrt(np.mean(reference**2))
    limit = float(np.abs(change).max()) or 1.0
    half = 0.5 / scene.rate_hz
    times = scene.times_s()
    extent = (float(times[0]) - half, float(times[-1]) + half, -0.5, change.shape[1] - 0.5)
    image = axes.imshow(
        change.T, "RdBu_r", aspect="auto", origin="lower", extent=extent,
        vmin=-limit, vmax=limit, interpolation="nearest",
    )  # fmt: skip
    axes.set_xlabel("time (s)")
    axes.set_ylabel("row of the protocol (from 0)")
    axes.set_title("frames minus reference", fontsize=10)
    figure.colorbar(image, ax=axes, pad=0.02).set_label("change (% of the reference's rms)")
