"""Make a short film of frames: the skin with its image and touches, with the same colour scale for
all frames, at the speed of the frames' own times."""

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
MAX_FRAMES = 240  # limits the memory, as a film is held there until it is written
MIN_MS, MAX_MS = 40, 2000  # how long a frame is shown
DPI = 140
COLOURS = 256


def check_film(path: str | Path | None) -> None:
    """Raise an error if the film cannot be made, before any work is done for it.

    Raises:
        UsageError: the suffix is not that of a film.
        MissingExtraError: pillow is not installed.
    """
    if path is None:
        return
    check_path(path, FORMATS, "film")
    load_pillow()


def load_pillow() -> Any:
    """Return the module ``PIL.Image``.

    Raises:
        MissingExtraError: pillow is not installed.
    """
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
    """Write ``panels`` as an animated WebP or GIF, as the suffix says.

    ``times_s`` are the ascending times of the panels. Each is shown until the next one's time, but
    for 40 ms to 2 s. Of more than 240 panels, 240 evenly spaced ones are shown.
    """
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
    """Return the numbers of at most MAX_FRAMES of ``count`` frames, evenly spaced, including the
    first and the last."""
    most = min(count, MAX_FRAMES)
    return [int(k) for k in np.unique(np.linspace(0, count - 1, most).round())]


def _image(model: Model, panel: Panel, limit: float) -> "Image":
    """Return a frame with 256 colours, which need a third of the memory."""
    figure = panels_figure(model.skin, model.grid, [panel], limit=limit, large=False)
    figure.set_dpi(DPI)
    canvas: Any = figure.canvas
    canvas.draw()
    pillow = load_pillow()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    image: Image = pillow.fromarray(pixels.copy()).quantize(COLOURS)
    return image
