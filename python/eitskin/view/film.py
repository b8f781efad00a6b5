"""A short film of frames: the skin with its image and touches, one scale of colours throughout, in
the frames' own time."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.errors import missing_extra
from eitskin.fileio import write_beside
from eitskin.model.model import Model
from eitskin.progress import Progress, silent
from eitskin.view.panels import check_path, panels_figure
from eitskin.view.pictures import Panel, largest

if TYPE_CHECKING:
    from PIL.Image import Image

FORMATS = (".webp", ".gif")
MAX_FRAMES = 240  # of a film, which is kept in memory until it is written
MIN_MS, MAX_MS = 40, 2000  # that a frame is seen
DPI = 140
COLOURS = 256


def check_film(path: str | Path | None) -> None:
    """Refuse a film that cannot be made, before anything is done for it."""
    if path is None:
        return
    check_path(path, FORMATS, "film")
    load_pillow()


def load_pillow() -> Any:
    """pillow's images."""
    try:
        import PIL.Image
    except ImportError:
        raise missing_extra("plot", "pillow") from None
    return PIL.Image


def draw_film(
    path: str | Path,
    model: Model,
    panels: Sequence[Panel],
    times_s: Sequence[float],
    *,
    progress: Progress = silent,
) -> None:
    """``panels``, at ``times_s`` that ascend, as an animated WebP or GIF; of more than 240 evenly
    spaced ones. A frame is seen 40 ms to 2 s."""
    check_film(path)
    chosen = thinned(len(panels))
    limit = max((largest(p.values) for p in panels if p.values is not None), default=1.0)
    seen = [panels[k] for k in chosen]
    images = [_image(model, panel, limit) for panel in progress(seen, len(seen))]
    shown = np.asarray(times_s, dtype=np.float64)[chosen]
    steps = np.diff(shown, append=2 * shown[-1] - shown[-2] if len(shown) > 1 else shown[-1] + 1)
    durations = np.clip(np.nan_to_num(1e3 * steps), MIN_MS, MAX_MS).round().astype(int).tolist()
    kind = Path(path).suffix[1:].lower()
    more: dict[str, Any] = {"method": 4, "quality": 80} if kind == "webp" else {"optimize": True}
    with write_beside(path) as temporary:
        images[0].save(
            temporary, format=kind.upper(), save_all=True, append_images=images[1:],
            duration=durations, loop=0, **more,
        )  # fmt: skip


def thinned(count: int) -> list[int]:
    """At most MAX_FRAMES of ``count`` frames, evenly spaced, the first and the last among them."""
    most = min(count, MAX_FRAMES)
    return [int(k) for k in np.unique(np.linspace(0, count - 1, most).round())]


def _image(model: Model, panel: Panel, limit: float) -> "Image":
    """One frame; 256 colours, which take a third of the memory."""
    figure = panels_figure(model.skin, model.grid, [panel], limit=limit, large=False)
    figure.set_dpi(DPI)
    canvas: Any = figure.canvas
    canvas.draw()
    pillow = load_pillow()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    image: Image = pillow.fromarray(pixels.copy()).quantize(COLOURS)
    return image
