"""Bars of the cost of each effect of a scene, beside the scene without effects."""

from pathlib import Path
from typing import Any

from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, load_matplotlib

TIME, MEMORY = "#1f6fb4", "#d1661f"


def draw_scene_cost(path: str | Path, result: dict[str, Any]) -> None:
    """Time and memory of each effect alone, and the numbers of factorisations, dearest first.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    cases = sorted(result["cases"].items(), key=lambda one: one[1]["ratio"])
    at = range(len(cases))
    none_mb = result["cases"]["none"]["peak_mb"]
    with matplotlib.rc_context(STYLE):
        size = (8.0, 0.2 * len(cases) + 1.0)
        figure = matplotlib.figure.Figure(figsize=size, layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, color, title, values in (
            (left, TIME, "time", [row["ratio"] for _, row in cases]),
            (right, MEMORY, "memory", [row["peak_mb"] / none_mb for _, row in cases]),
        ):
            axes.barh(at, values, color=color, height=0.7)
            axes.axvline(1.0, color=INK, linewidth=0.8, linestyle=":")
            axes.set_xscale("log")
            axes.set_title(f"{title}, of the scene without effects", fontsize=9)
            axes.spines[["top", "right"]].set_visible(False)
            axes.tick_params(labelsize=8)
            axes.margins(y=0.01)
        for k, (_, row) in enumerate(cases):
            text = f" {row['factorisations']}"
            left.text(row["ratio"], k, text, va="center", fontsize=6, color=INK)
        left.set_yticks(at, [name.replace("_", " ") for name, _ in cases], fontsize=8)
        left.set_xlabel("numbers: factorisations", fontsize=8)
        save_picture(figure, path)
