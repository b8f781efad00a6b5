"""The bound of a touch's place and the product's error, by pattern and by where the noise comes
from."""

from collections.abc import Mapping
from pathlib import Path

from eitskin_studies.pictures.style import COLOURS, MARKERS, drawing, legend_below, plain_axes


def draw_patterns(path: str | Path, data: Mapping[str, Mapping[str, Mapping[str, float]]]) -> None:
    """Medians in mm by noise and pattern, ``bound`` above and ``product``, the product's touches,
    below.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    noises = list(data["bound"])
    patterns = list(data["bound"][noises[0]])
    titles = {"bound": "Cramer-Rao bound", "product": "the product's touches"}
    with drawing(path, 9.6, 5.6) as figure:
        panels = figure.subplots(2, 1, sharex=True)
        for axes, (name, title) in zip(panels, titles.items(), strict=True):
            for k, pattern in enumerate(patterns):
                shift = 0.8 * ((k + 0.5) / len(patterns) - 0.5)
                places = [n + shift for n in range(len(noises))]
                heights = [data[name][noise][pattern] for noise in noises]
                colour = COLOURS[k % len(COLOURS)]
                axes.vlines(places, 0, heights, color=colour, linewidth=1.2)
                axes.plot(places, heights, MARKERS[k], color=colour, markersize=5.5, label=pattern)
            axes.set_title(title)
            axes.set_ylabel("place, median (mm)")
            axes.set_ylim(bottom=0)
            plain_axes(axes, "y")
        labels = [noise.replace(", ", ",\n").replace("end as", "end\nas") for noise in noises]
        panels[1].set_xticks(range(len(noises)), labels)
        legend_below(figure, panels[0], len(patterns))
