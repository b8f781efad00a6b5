"""The core's error beside the Cramer-Rao bound, as a picture: a panel for each table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eitskin_studies.benchmarks.limit import LimitResult
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.style import (
    BLUE,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
    plain_ticks,
)

TITLES = {
    "place": "distance from the rim",
    "contrast": "contrast",
    "snr": "SNR",
    "touches": "touches",
    "pattern": "drive pattern, noise",
}
TICKS_MM = (0.01, 0.03, 0.1, 0.3, 1, 3)


def limit_drawing(result: LimitResult) -> Drawing:
    """The picture of a result."""
    shown = {
        name: [
            {
                "name": row.name,
                "error_mm": [row.median_mm, row.p95_mm],
                "bound_mm": [row.bound_mm, row.bound_p95_mm],
            }
            for row in result.table(name)
        ]
        for name in TITLES
        if result.table(name)
    }
    return Drawing(draw_limit, shown)


def draw_limit(path: Path, tables: Mapping[str, Sequence[Mapping[str, Any]]]) -> None:
    """Medians (points) to 95th percentiles (lines) of the error and of the bound, in mm, line by
    line of each table.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    widths = [len(rows) + 1.5 for rows in tables.values()]
    with drawing(path, 12.0, 4.4) as figure:
        panels = figure.subplots(1, len(tables), sharey=True, squeeze=False, width_ratios=widths)[0]
        for axes, (name, rows) in zip(panels, tables.items(), strict=True):
            for shift, colour, marker, key, label in (
                (-0.12, VERMILION, "o", "error_mm", "the core's error (line: to its p95)"),
                (0.12, BLUE, "s", "bound_mm", "the bound (line: to its p95)"),
            ):
                at = [k + shift for k in range(len(rows))]
                lows, highs = zip(*(row[key] for row in rows), strict=True)
                axes.vlines(at, lows, highs, color=colour, alpha=0.6)
                axes.plot(at, lows, marker, color=colour, markersize=5, label=label)
            labels = [
                row["name"].replace(", ", ",\n", 1).replace(" of its own rms", "") for row in rows
            ]
            axes.set_xticks(range(len(rows)), labels, rotation=90, fontsize=7.5)
            axes.set_yscale("log")
            axes.tick_params(axis="y", which="minor", left=False)
            axes.set_title(TITLES[name])
            axes.set_xlim(-0.7, len(rows) - 0.3)
            plain_axes(axes, "y")
        plain_ticks(panels[0].yaxis, TICKS_MM)
        panels[0].set_ylabel("place, median (mm)")
        legend_below(figure, panels[0], 2)
