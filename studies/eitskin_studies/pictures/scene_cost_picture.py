"""The cost of each effect of a scene, beside the scene without effects."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eitskin.view.pictures import INK
from eitskin_studies.pictures.style import (
    BLUE,
    GREEN,
    PURPLE,
    VERMILION,
    drawing,
    plain_axes,
    plain_ticks,
)


def draw_scene_cost(path: str | Path, cases: Mapping[str, Mapping[str, Any]]) -> None:
    """Time and memory of each effect alone, over those of the scene without effects, and the
    numbers of factorisations and of modules that it imports; the most expensive above. ``cases``
    has for each effect ``ratio``, ``peak_mb``, ``factorisations`` and ``modules``.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    rows = sorted(cases.items(), key=lambda one: one[1]["ratio"])
    none = cases["none"]
    kinds = (
        ("time,\nwithout effects = 1", BLUE, [row["ratio"] for _, row in rows], 1.0),
        (
            "memory,\nwithout effects = 1",
            VERMILION,
            [row["peak_mb"] / none["peak_mb"] for _, row in rows],
            1.0,
        ),
        (
            "factorisations",
            GREEN,
            [row["factorisations"] for _, row in rows],
            none["factorisations"],
        ),
        ("modules imported\nbeyond those of none", PURPLE, [row["modules"] for _, row in rows], 0),
    )
    with drawing(path, 9.6, 0.2 * len(rows) + 1.5) as figure:
        panels = figure.subplots(1, len(kinds), sharey=True)
        for axes, (title, colour, values, without) in zip(panels, kinds, strict=True):
            axes.axvline(without, color=INK, linewidth=0.8, linestyle=":")
            axes.hlines(range(len(rows)), without, values, color=colour, linewidth=1.2)
            axes.plot(values, range(len(rows)), "o", color=colour, markersize=4.5)
            axes.set_title(title, fontsize=9)
            plain_axes(axes, "x")
            axes.margins(y=0.02)
        for axes in panels[:2]:
            axes.set_xscale("log")
            plain_ticks(axes.xaxis, (0.5, 1, 2, 5, 10, 20))
        names = ["no effect" if name == "none" else name.replace("_", " ") for name, _ in rows]
        panels[0].set_yticks(range(len(rows)), names, fontsize=8)
        figure.suptitle("What each effect of a scene costs; dotted: the same scene without effects")
