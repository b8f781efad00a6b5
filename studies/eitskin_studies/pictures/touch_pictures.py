"""One picture per law or shape of a touch: the law or shape itself, and its effect on a frame.

On the right stands the frame of a press on the paper's skin: of a law minus the untouched one, of a
shape minus that of the disc. ``eitskin draw touch NAME -o PNG`` makes one picture.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.config import nearest
from eitskin.errors import UsageError
from eitskin.scene.laws import DRIVING_KEY, KINDS, LAW_KEYS
from eitskin.scene.touch_shape import SHAPES, named_shape
from eitskin.view.pictures import STYLE, load_matplotlib
from eitskin_studies.pictures.effect_pictures import draw_difference, press_frames, save_small_png
from eitskin_studies.pictures.effect_sketches import LIGHT, STRONG

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = (*LAW_KEYS, *SHAPES)
GRAMS = 200.0


def draw_touch(path: str | Path, name: str) -> None:
    """The picture of the law or shape ``name`` as a PNG.

    Raises:
        UsageError: there is no such law or shape.
        MissingExtraError: matplotlib, scipy or netgen is not installed.
        FileError: the file cannot be written.
    """
    if name not in NAMES:
        raise UsageError(f"no picture of a touch {name!r}; {nearest(name, NAMES)}")
    matplotlib = load_matplotlib()
    key = "shape" if name in SHAPES else "law"
    table: dict[str, Any] = {key: name}
    if key == "law" and DRIVING_KEY[name] == "grams":
        table["grams"] = GRAMS
    frames, _, _ = press_frames({}, table)
    other = frames[0] if key == "law" else press_frames({})[0][-1]
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(8.2, 3.3), layout="compressed")
        left, right = figure.subplots(1, 2)
        (_draw_shape if key == "shape" else _draw_law)(left, name)
        draw_difference(right, frames[-1] - other, other)
        right.set_ylabel("with - untouched (mV)" if key == "law" else "with - disc (mV)")
        words = ", ".join(f"{k} = {v!r}" for k, v in table.items()).replace("'", '"')
        figure.suptitle(f"[[touch]]  {words}", fontsize=10, fontweight="bold", family="monospace")
        save_small_png(figure, path)


def _draw_law(axes: "Axes", name: str) -> None:
    """Contrast over what drives it."""
    most = GRAMS if DRIVING_KEY[name] == "grams" else 1.0
    drive = np.linspace(0, most, 200)
    axes.axhline(1, color=LIGHT, linestyle="--")
    axes.plot(drive, KINDS[name]().contrast_at(drive), color=STRONG)
    axes.set(xlabel=DRIVING_KEY[name], ylabel="contrast", xlim=(0, most), title="the law")
    axes.set_ylim(bottom=0)


def _draw_shape(axes: "Axes", name: str) -> None:
    """The change from above, for a radius of 1."""
    shape = named_shape(name)
    at = np.linspace(-2.5, 2.5, 201)
    change = shape.change_at(*np.meshgrid(at, at), 1.0)
    extent = (-2.5, 2.5, -2.5, 2.5)
    shown = axes.imshow(change, origin="lower", cmap="Reds", vmin=0, vmax=1, extent=extent)
    axes.figure.colorbar(shown, ax=axes, shrink=0.8).set_label("change / that in the middle")
    turn = np.linspace(0, 2 * np.pi, 181)
    axes.plot(np.cos(turn), np.sin(turn), color=LIGHT, linewidth=0.8)
    axes.set(xlabel="x / radius", ylabel="y / radius", title="the shape, and the disc of its area")
