"""Drawings of a container: its measures, from one hole to one wire, and a picture of its STL."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fileio import write_beside
from eitskin.view.pictures import INK, STYLE, load_matplotlib
from eitskin_hardware.circuit.instrument import instrument
from eitskin_hardware.container.container import Container

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GEL, WALL, METAL = "#dceaf2", "#c9b08a", "#7a7a7a"
SMALL = 8.0
ELEVATION, AZIMUTH = np.radians(38.0), np.radians(-70.0)  # of the picture
SALT = "eitskin"  # of the identifiers in an SVG file, so that it repeats


def draw_measures(container: Container, path: str | Path) -> None:
    """Draw the container from above and cut through a post, with its measures in mm."""
    matplotlib = load_matplotlib()
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": SALT, "svg.fonttype": "none"}):
        figure = matplotlib.figure.Figure(figsize=(13.0, 6.0))
        above, cut = figure.subplots(1, 2, width_ratios=(1.0, 1.35))
        _above(above, container)
        for k, (x, y, angle) in enumerate(container.holes_mm):
            away = container.wall_mm + 15.0
            _text_outside(above, x, y, angle, away, str(k))
        low, high = container.outline_mm.min(axis=0), container.outline_mm.max(axis=0)
        wall = container.wall_mm
        _measure(
            above, (low[0], low[1] - 32), (high[0], low[1] - 32), f"{high[0] - low[0]:.1f} inside"
        )
        _measure(
            above, (low[0] - wall, low[1] - 46), (high[0] + wall, low[1] - 46),
            f"{high[0] - low[0] + 2 * wall:.1f} outside",
        )  # fmt: skip
        gaps = np.linalg.norm(
            container.holes_mm[:, :2] - np.roll(container.holes_mm[:, :2], 1, axis=0), axis=1
        )
        above.set_title(
            f"{container.name}: {len(gaps)} holes of {container.hole_mm:g} mm,"
            f" {_range(gaps)} mm apart inside"
        )
        _cut(cut, container)
        _save(figure, path)


def _range(numbers: FloatArray) -> str:
    low, high = f"{numbers.min():.1f}", f"{numbers.max():.1f}"
    return low if low == high else f"{low} to {high}"


def draw_wires(container: Container, path: str | Path) -> None:
    """Draw which hole goes to which pin of J2 and which switch of the multiplexers."""
    matplotlib = load_matplotlib()
    pins = {pin.name: pin.number for pin in instrument()["J2"].kind.pins}
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": SALT, "svg.fonttype": "none"}):
        figure = matplotlib.figure.Figure(figsize=(7.0, 7.0))
        axes = figure.add_subplot()
        _above(axes, container)
        for k, (x, y, angle) in enumerate(container.holes_mm):
            at = f"{k}\nJ2-{pins[f'E{k}']}\nS{k + 1}" if f"E{k}" in pins else str(k)
            _text_outside(axes, x, y, angle, container.wall_mm + 23.0, at)
        middle = container.outline_mm.mean(axis=0)
        note = (
            "seen from above\nelectrode, pin of J2,\nswitch of U6 to U9\n"
            "even pins of J2: AGND,\nbetween the wires, cut off at the dish"
        )
        axes.text(*middle, note, ha="center", va="center", fontsize=SMALL)
        axes.margins(0.16)
        axes.set_title(f"{container.name}: from each hole to its wire")
        _save(figure, path)


def draw_picture(faces: FloatArray, path: str | Path, title: str) -> None:
    """Draw triangles (n, 3, 3) as a shaded body."""
    matplotlib = load_matplotlib()
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    length = np.linalg.norm(normals, axis=1)
    faces, normals = faces[length > 0], normals[length > 0] / length[length > 0, None]
    towards = np.array(
        [
            np.cos(ELEVATION) * np.cos(AZIMUTH),
            np.cos(ELEVATION) * np.sin(AZIMUTH),
            np.sin(ELEVATION),
        ]
    )
    seen = normals @ towards > 0
    faces, normals = faces[seen], normals[seen]
    light = np.array([0.35, -0.5, 0.8])
    shade = 0.45 + 0.5 * np.clip(normals @ (light / np.linalg.norm(light)), 0, 1)
    colours = np.column_stack([shade * c for c in (0.88, 0.80, 0.66)])
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(7.0, 4.4))
        axes = figure.add_axes((0.0, 0.0, 1.0, 0.94), projection="3d")
        axes.add_collection3d(
            Poly3DCollection(faces, facecolors=colours, edgecolors=colours, linewidths=0.4)
        )
        low, high = faces.reshape(-1, 3).min(axis=0), faces.reshape(-1, 3).max(axis=0)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(high - low, zoom=1.35)
        axes.view_init(elev=np.degrees(ELEVATION), azim=np.degrees(AZIMUTH))
        axes.axis("off")
        figure.suptitle(title)
        _save(figure, path)


def _save(figure: Figure, path: str | Path) -> None:
    kind = Path(path).suffix.lstrip(".")
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    with write_beside(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=100, metadata=metadata)


def _above(axes: Axes, container: Container) -> None:
    from matplotlib.patches import Polygon, Rectangle
    from matplotlib.transforms import Affine2D

    axes.set_aspect("equal")
    axes.axis("off")
    outside = container.outline_mm + 0.0
    centre = outside.mean(axis=0)
    outside = centre + (outside - centre) * _grow(container)
    axes.add_patch(Polygon(outside, facecolor=WALL, edgecolor=INK, linewidth=0.8))
    axes.add_patch(Polygon(container.outline_mm, facecolor=GEL, edgecolor=INK, linewidth=0.8))
    for x, y, angle in container.holes_mm:
        post = Rectangle((-6, -container.hole_mm / 2), container.wall_mm + 14, container.hole_mm)
        post.set(facecolor=METAL, edgecolor=INK, linewidth=0.5)
        post.set_transform(Affine2D().rotate_deg(angle).translate(x, y) + axes.transData)
        axes.add_patch(post)
    axes.update_datalim(outside)
    axes.autoscale_view()


def _grow(container: Container) -> FloatArray:
    size = np.ptp(container.outline_mm, axis=0)
    return np.asarray((size + 2 * container.wall_mm) / size)


def _text_outside(axes: Axes, x: float, y: float, angle: float, away_mm: float, text: str) -> None:
    turn = np.radians(angle)
    at = (x + away_mm * np.cos(turn), y + away_mm * np.sin(turn))
    axes.text(*at, text, ha="center", va="center", fontsize=SMALL)
    axes.update_datalim([at])


def _measure(axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str) -> None:
    style = {"arrowstyle": "<->", "color": INK, "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=style)
    upright = abs(end[1] - start[1]) > abs(end[0] - start[0])
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    axes.text(
        *middle, f" {text} ", ha="left" if upright else "center",
        va="center" if upright else "bottom", fontsize=SMALL,
    )  # fmt: skip
    axes.update_datalim([start, end])
    axes.autoscale_view()


def _cut(axes: Axes, c: Container) -> None:
    """The wall at a post: x from the inside of the wall, inside to the left."""
    from matplotlib.patches import Rectangle

    def box(x: float, y: float, width: float, height: float, colour: str) -> None:
        axes.add_patch(
            Rectangle((x, y), width, height, facecolor=colour, edgecolor=INK, linewidth=0.8)
        )

    axes.set_aspect("equal")
    axes.axis("off")
    middle = c.hole_height_mm
    box(-40, 0, 40 + c.wall_mm, c.floor_mm, WALL)
    box(0, 0, c.wall_mm, c.height_mm, WALL)
    box(-40, c.floor_mm, 40, c.gel_mm, GEL)
    inside = c.post_mm - c.wall_mm - 12.0
    box(-inside, middle - c.hole_mm / 2, c.post_mm, c.hole_mm, METAL)
    for x, width, half in (
        (-1, 1, c.washer_mm / 2), (-4.2, 3.2, c.nut_mm / 2), (c.wall_mm, 1, c.washer_mm / 2),
        (c.wall_mm + 1, 3.2, c.nut_mm / 2), (c.wall_mm + 5.2, 3.2, c.nut_mm / 2),
    ):  # fmt: skip
        box(x, middle - half, width, 2 * half, "#b5b5b5")
    names = "nut, washer | wall | washer, nut,\nsolder lug with the wire, nut"
    axes.text(c.wall_mm + 1, middle + 6, names, fontsize=SMALL, va="bottom")
    right = c.wall_mm + 18
    _measure(axes, (right, 0), (right, middle), f"{middle:g} to the middle")
    _measure(axes, (right + 22, 0), (right + 22, c.height_mm), f"{c.height_mm:g}")
    _measure(axes, (-34, c.floor_mm), (-34, c.floor_mm + c.gel_mm), f"{c.gel_mm:g} gel")
    _measure(axes, (-28, 0), (-28, c.floor_mm), f"{c.floor_mm:g}")
    _measure(axes, (0, -4), (c.wall_mm, -4), f"{c.wall_mm:g}")
    _measure(axes, (-inside, c.floor_mm + 0.8), (0, c.floor_mm + 0.8), f"{inside:g}")
    axes.set(xlim=(-42, right + 28), ylim=(-8, c.height_mm + 5))
    axes.set_title(f"cut through a post: M4 x {c.post_mm:g}, hole {c.hole_mm:g} mm")
