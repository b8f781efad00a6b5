"""The core's error beside the Cramer-Rao bound, as a picture: a panel for each table."""

from pathlib import Path

from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, load_matplotlib
from eitskin_studies.benchmarks.limit import LimitResult

ERROR, BOUND = "#d1661f", "#1f6fb4"
TITLES = {
    "place": "distance from the rim",
    "contrast": "contrast",
    "snr": "SNR",
    "touches": "touches",
    "pattern": "drive pattern, noise",
}


def draw_limit(path: str | Path, result: LimitResult) -> None:
    """Medians (points) to 95th percentiles (lines) of the error and of the bound, in mm, line by
    line of each table, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    tables = [name for name in TITLES if result.table(name)]
    with matplotlib.rc_context(STYLE):
        size = (2.2 * len(tables) + 1.0, 3.9)
        figure = matplotlib.figure.Figure(figsize=size, layout="constrained")
        panels = figure.subplots(1, len(tables), sharey=True, squeeze=False)[0]
        for axes, name in zip(panels, tables, strict=True):
            rows = result.table(name)
            for shift, color, label, values in (
                (-0.12, ERROR, "the core's error", [(r.median_mm, r.p95_mm) for r in rows]),
                (0.12, BOUND, "the bound", [(r.bound_mm, r.bound_p95_mm) for r in rows]),
            ):
                at = [k + shift for k in range(len(rows))]
                lows, highs = [v[0] for v in values], [v[1] for v in values]
                axes.vlines(at, lows, highs, color=color, alpha=0.5)
                axes.plot(at, lows, "o", color=color, label=label)
            labels = [r.name.replace(", ", ",\n", 1).replace(" of its own rms", "") for r in rows]
            axes.set_xticks(range(len(rows)), labels, rotation=60, ha="right", fontsize=7)
            axes.set_yscale("log")
            axes.set_title(TITLES[name], color=INK)
            axes.grid(axis="y", which="both", alpha=0.25)
        panels[0].set_ylabel("place, mm: median to p95")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=2, frameon=False)
        save_picture(figure, path)
