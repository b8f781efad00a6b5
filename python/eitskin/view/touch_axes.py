"""Draw a skin with its image and touches on matplotlib axes, for notebooks and your own figures."""

from collections.abc import Sequence
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from eitskin.core.diagnostics_table import Touch
from eitskin.model.model import Model
from eitskin.scene.random_touches import TrueTouch
from eitskin.view.pictures import STYLE, Mark, Panel, draw_panel, found_mark, load_matplotlib

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INCHES, DPI = 3.6, 100


def draw_touches(
    model: Model,
    touches: Sequence[Touch] = (),
    image: npt.ArrayLike | None = None,
    *,
    true: Sequence[TrueTouch] = (),
    title: str = "",
    ax: "Axes | None" = None,
) -> "Axes":
    """Draw the skin of ``model`` with an ``image`` (n,) in S/m, found touches as crosses and
    ``true`` ones as circles. Return the axes: ``ax``, or those of a new figure, which a notebook
    shows as a picture.

    Raises:
        MissingExtraError: matplotlib is not installed.
        ConfigError: the model does not hold the skin that it is for.
    """
    matplotlib = load_matplotlib()
    values = None if image is None else np.asarray(image, dtype=np.float64)
    marks = tuple(Mark(one.x_mm, one.y_mm, one.radius_mm) for one in true)
    panel = Panel(title, values, marks, tuple(map(found_mark, touches)))
    with matplotlib.rc_context(STYLE):
        if ax is None:
            figure = matplotlib.figure.Figure(figsize=(INCHES, INCHES), layout="compressed")
            matplotlib.backends.backend_agg.FigureCanvasAgg(figure)
            made: Any = figure.add_subplot()
            made._repr_png_ = partial(_png, made)
            ax = made
        draw_panel(ax, model.skin, model.grid, panel, small=True)
    return ax


def touches_png(
    model: Model,
    touches: Sequence[Touch],
    image: npt.ArrayLike | None,
    true: Sequence[TrueTouch] = (),
) -> bytes:
    """Return the picture of ``draw_touches`` as the bytes of a PNG, for ``_repr_png_``. Raises the
    same errors."""
    return _png(draw_touches(model, touches, image, true=true))


def _png(axes: "Axes") -> bytes:
    data = BytesIO()
    axes.figure.figure.savefig(data, format="png", dpi=DPI)
    return data.getvalue()
