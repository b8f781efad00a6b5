"""Other worlds: how many scenes are counted exactly in each set, and what goes wrong."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.skin.outline import Outline
from eitskin.view.panels import DPI
from eitskin.view.pictures import FOUND, INK, RIM, load_matplotlib
from eitskin_studies.worlds.worlds import in_words

WRONG = "#b2182b"
FAILS_BELOW = 90.0


def draw_shares(path: Path, scores: Sequence[Mapping[str, Any]]) -> None:
    """A bar a set: the share of exact scenes with its interval, and false touches a scene.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    load_matplotlib()
    import matplotlib.pyplot as plt

    rows = sorted(scores, key=lambda one: one["exact"][0])
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(9.5, 0.24 * len(rows) + 0.9), sharey=True, layout="constrained"
    )
    for place, one in enumerate(rows):
        share, low, high = (100 * value for value in one["exact"])
        colour = WRONG if share < FAILS_BELOW else FOUND
        left.barh(place, share, color=colour)
        left.plot([low, high], [place, place], color=INK, linewidth=1)
        right.barh(place, one["false_per_scene"], color=colour)
    left.set_yticks(range(len(rows)), [in_words(one["name"]) for one in rows])
    left.invert_yaxis()
    left.set(xlabel="scenes counted exactly, %", xlim=(0, 100), title="exact counts")
    right.set(xlabel="false touches per scene", title=f"red: exact in fewer than {FAILS_BELOW:g} %")
    figure.savefig(path, dpi=DPI)
    plt.close(figure)


def draw_examples(path: Path, examples: Mapping[str, Mapping[str, Any]], outline: Outline) -> None:
    """A scene of each set that is counted wrong: true touches filled, found ones as circles.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    load_matplotlib()
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, 3, figsize=(9, 6.4), layout="constrained")
    rim = outline.points_at(np.linspace(0, outline.perimeter_mm, 361))
    turn = np.linspace(0, 2 * np.pi, 91)
    for axes, (name, example) in zip(panels.ravel(), examples.items(), strict=False):
        axes.plot(*rim.T, color=RIM, linewidth=0.8)
        for edge in example["rims_mm"]:
            axes.fill(*np.array(edge).T, color="#f2b5ab", linewidth=0)
        for x, y, radius in example["found_mm"]:
            axes.plot(x + radius * np.cos(turn), y + radius * np.sin(turn), color=FOUND)
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_title(in_words(name), fontsize=9)
    figure.savefig(path, dpi=DPI)
    plt.close(figure)
