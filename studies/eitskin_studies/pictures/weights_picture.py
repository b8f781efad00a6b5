"""The paper's Figure 12: weights placed one after another, as each method shows them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from eitskin.arrays import FloatArray
from eitskin.fem.grid import Grid
from eitskin.scene.random_touches import TouchScene
from eitskin.skin.skin import Skin
from eitskin.view.panels import save_picture
from eitskin.view.pictures import STYLE, Panel, draw_panel, load_matplotlib
from eitskin_studies.pictures.comparison_pictures import truth_marks

PANEL_INCH = 1.45


def draw_weights(
    path: Path,
    *,
    skin: Skin,
    scenes: Sequence[TouchScene],
    images: Mapping[str, FloatArray],
    grids: Mapping[str, Grid],
) -> None:
    """A row a method, a column a number of weights; the true weights are drawn as circles.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: it cannot be written.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(
            figsize=(PANEL_INCH * len(scenes), 0.7 + PANEL_INCH * len(images)),
            layout="constrained",
        )
        axes = figure.subplots(len(images), len(scenes), squeeze=False)
        for row, (name, shown) in enumerate(images.items()):
            for column, scene in enumerate(scenes):
                marks = truth_marks(scene, skin.conductivity_s_per_m)
                number = len(scene.touches)
                title = f"{number} weight{'s' if number > 1 else ''}" if row == 0 else ""
                panel = Panel(title, shown[column], marks)
                draw_panel(axes[row, column], skin, grids[name], panel, small=True)
            axes[row, 0].set_axis_on()
            axes[row, 0].set(xticks=[], yticks=[], frame_on=False, ylabel=name)
        figure.suptitle("Weights of 5 mm radius placed one after another, 60 dB", fontsize=11)
        figure.supxlabel(
            "circles: true weights, edges 6 mm from the boundary; red: more conductive, each panel"
            " by its own largest value",
            fontsize=8,
        )
        save_picture(figure, path)
