"""Draw pictures of frames: the skin with its electrodes, the image, the true touches and the found
ones.

x points to the right and y up, seen from above, in mm. Red is more conductive than the untouched
skin, blue less, and white is no change. matplotlib is imported when a picture is drawn, and needs
no display.
"""

from __future__ import annotations

import math
import os
import sys
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import missing_extra
from eitskin.fem.grid import Grid
from eitskin.process import is_own
from eitskin.skin.skin import Skin

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "#1b1b1b"
RIM = "#4a4a4a"
ELECTRODE = "#b8860b"
TRUE = "#111111"
FOUND = "#00796b"
COLOURS = "RdBu_r"
MARGIN, SMALL_MARGIN = 0.10, 0.03  # around a skin, as fractions of its larger side
PLACE_90 = 4.605  # 90 % quantile of chi-squared with two degrees of freedom
Place = tuple[float, float, float]
STYLE = {
    "font.size": 9.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.titlesize": 10.0,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@dataclass(frozen=True)
class Mark:
    """A touch in a picture.

    Attributes:
        radius_mm: its radius, or None if unknown.
        change: its change of conductivity, or None if unknown.
        place_mm2: the covariance of its place (xx, xy, yy), or None if unknown.
        long_mm: half of its long axis if it is an ellipse.
    """

    x_mm: float
    y_mm: float
    radius_mm: float | None = None
    change: float | None = None
    place_mm2: Place | None = field(default=None, kw_only=True)
    long_mm: tuple[float, float] | None = field(default=None, kw_only=True)


def found_mark(touch: Touch) -> Mark:
    """Return the mark of a found touch."""
    xx, xy, yy = touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2
    place = None if xx is None or xy is None or yy is None else (xx, xy, yy)
    long_mm = None if touch.long_x_mm is None else (touch.long_x_mm, touch.long_y_mm or 0.0)
    return Mark(touch.x_mm, touch.y_mm, touch.radius_mm, place_mm2=place, long_mm=long_mm)


@dataclass(frozen=True, eq=False)
class Panel:
    """A skin in a picture.

    Attributes:
        title: the heading above it.
        values: pixel values (n,), or None for no image.
        truth: true touches, drawn as circles, filled with their change if ``fill_truth`` is set.
        found: found touches, drawn as crosses, with dashed discs or ellipses if their size is
            known, and with ellipses that contain the true centre with a probability of 90 % if
            that is known.
        fill_truth: draw the truth in the colours of an image.
    """

    title: str
    values: AnyArray | None = None
    truth: tuple[Mark, ...] = ()
    found: tuple[Mark, ...] = ()
    fill_truth: bool = False


def load_matplotlib() -> Any:
    """Return matplotlib, set up to draw without a display. A backend that the user's environment
    names is left to the user's own figures, and need not exist here; on the command line no setting
    of theirs counts.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    first = "matplotlib" not in sys.modules
    backend = os.environ.pop("MPLBACKEND", None) if first else None
    try:
        import matplotlib
        import matplotlib.backends.backend_agg
        import matplotlib.figure
        import matplotlib.ticker
    except ImportError:
        raise missing_extra("plot", "matplotlib") from None
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    if is_own() and first:
        matplotlib.rcdefaults()
    elif backend is not None:
        with suppress(ValueError):  # one that is not installed here
            matplotlib.rcParams["backend"] = backend
    return matplotlib


def draw_panel(
    axes: Axes,
    skin: Skin,
    grid: Grid,
    panel: Panel,
    *,
    limit: float | None = None,
    small: bool = False,
) -> Any:
    """Draw a panel on ``axes``, and return what a colour bar needs.

    Colours range from -``limit`` to ``limit``; without a limit, values are divided by the largest
    of them.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.patches import Polygon
    from matplotlib.patheffects import withStroke

    scale = 1.0 if limit is None else limit
    colour_map = colormaps[COLOURS]
    colours = ScalarMappable(Normalize(-scale, scale), COLOURS)
    colours.set_array([])
    rim = skin.outline.points_at(np.linspace(0, skin.outline.perimeter_mm, 721)[:-1])
    if skin.outline.diameter_mm is None:
        rim = np.asarray(skin.outline.vertices_mm)
    sheet = Polygon(rim, closed=True, facecolor=colour_map(0.5), edgecolor="none", zorder=0)
    axes.add_patch(sheet)
    if panel.values is not None:
        values = np.asarray(panel.values, dtype=np.float64)
        x0, y0 = grid.origin_mm
        extent = (x0, x0 + grid.nx * grid.pixel_mm, y0, y0 + grid.ny * grid.pixel_mm)
        shown = grid.image(values / largest(values) if limit is None else values)
        colour: dict[str, Any] = {"cmap": COLOURS, "vmin": -scale, "vmax": scale, "zorder": 1}
        picture = axes.imshow(
            shown, origin="lower", extent=extent, interpolation="nearest", **colour
        )
        picture.set_clip_path(sheet)
    most = largest([m.change or 0.0 for m in panel.truth])
    for mark in panel.truth:
        face: Any = "none"
        if panel.fill_truth and mark.change is not None:
            part = mark.change / most if limit is None else mark.change / limit
            face = colour_map(0.5 + 0.5 * part)
        circle = {"facecolor": face, "edgecolor": TRUE, "linewidth": 0.9, "zorder": 3}
        _circle(axes, mark, mark.radius_mm or 2.0, **circle)
    size, width = (3.5, 0.9) if small else (8.0, 1.6)
    halo = [withStroke(linewidth=width + 1.6, foreground="white")]
    for mark in panel.found:
        style: dict[str, Any] = {"markersize": size, "markeredgewidth": width, "path_effects": halo}
        axes.plot(mark.x_mm, mark.y_mm, "x", color=FOUND, zorder=4, **style)
        if mark.place_mm2 is not None:
            ellipse = {"linewidth": 0.7 * width, "path_effects": halo}
            _place_ellipse(axes, mark, mark.place_mm2, edgecolor=FOUND, zorder=4, **ellipse)
        if mark.radius_mm is not None:
            dashes = {"linestyle": (0, (3, 2)), "linewidth": width, "path_effects": halo}
            dashes |= {"facecolor": "none", "edgecolor": FOUND, "zorder": 4}
            _shape(axes, mark, mark.radius_mm, **dashes)
    line = {"facecolor": "none", "edgecolor": RIM, "linewidth": 0.7 if small else 1.2}
    axes.add_patch(Polygon(rim, closed=True, zorder=2, **line))
    _draw_electrodes(axes, skin, small)
    axes.set_title(panel.title, fontsize=8 if small else 10)
    return colours


def _circle(axes: Axes, mark: Mark, radius_mm: float, **style: Any) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle((mark.x_mm, mark.y_mm), radius_mm, **style))


def _shape(axes: Axes, mark: Mark, radius_mm: float, **style: Any) -> None:
    """Draw the disc or ellipse of a found touch."""
    from matplotlib.patches import Ellipse

    if mark.long_mm is None:
        _circle(axes, mark, radius_mm, **style)
        return
    x, y = mark.long_mm
    half = math.hypot(x, y)
    turn = math.degrees(math.atan2(y, x))
    size = 2 * half, 2 * radius_mm**2 / half
    axes.add_patch(Ellipse((mark.x_mm, mark.y_mm), *size, angle=turn, **style))


def _place_ellipse(axes: Axes, mark: Mark, place_mm2: Place, **style: Any) -> None:
    """Draw the ellipse that contains the true centre with a probability of 90 %."""
    from matplotlib.patches import Ellipse

    xx, xy, yy = place_mm2
    variances, directions = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    short, long = 2 * np.sqrt(PLACE_90 * np.maximum(variances, 0))
    x, y = directions[:, 1]
    turn = math.degrees(math.atan2(y, x))
    axes.add_patch(Ellipse((mark.x_mm, mark.y_mm), long, short, angle=turn, fill=False, **style))


def _draw_electrodes(axes: Axes, skin: Skin, small: bool) -> None:
    """Draw electrodes as bars on the rim, numbered from 0 unless ``small`` is set, and set the
    limits of the axes."""
    outline = skin.outline
    x0, y0, x1, y1 = outline.bounding_box_mm
    size = max(x1 - x0, y1 - y0)
    margin = SMALL_MARGIN if small else MARGIN
    for k, (start, end) in enumerate(skin.electrode_spans_mm()):
        along = outline.points_at(np.linspace(start, end, 9))
        axes.plot(*along.T, color=ELECTRODE, linewidth=1.6 if small else 4.0, zorder=5)
        if not small:
            outward = np.array([along[5, 1] - along[3, 1], along[3, 0] - along[5, 0]])
            x, y = along[4] + 0.055 * size * outward / max(float(np.hypot(*outward)), 1e-9)
            axes.text(x, y, str(k), ha="center", va="center", fontsize=8, color=INK, zorder=6)
    axes.set_xlim(x0 - margin * size, x1 + margin * size)
    axes.set_ylim(y0 - margin * size, y1 + margin * size)
    axes.set_aspect("equal")
    if small:
        axes.set_axis_off()
    else:
        axes.set_xlabel("x (mm)")
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)


def largest(values: npt.ArrayLike) -> float:
    """Return the largest absolute value of ``values``, or 1 if all are 0 or there are none."""
    sizes = np.abs(np.asarray(values, dtype=np.float64))
    return float(sizes.max()) if sizes.size and sizes.max() > 0 else 1.0
