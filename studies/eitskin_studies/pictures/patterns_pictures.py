"""The bound of a touch's place and the product's error, by pattern and by where the noise comes
from."""

from collections.abc import Mapping
from pathlib import Path

from eitskin.view.panels import save_picture
from eitskin.view.pictures import STYLE, load_matplotlib

SHADES = ("#212121", "#0d47a1", "#1e88e5", "#64b5f6", "#b3d7f5", "#8d6e63", "#ef6c00")


def draw_patterns(
    path: str | Path,
    bounds: Mapping[str, Mapping[str, float]],
    product: Mapping[str, Mapping[str, float]],
) -> None:
    """Medians in mm by noise and pattern, the bound above and the product's touches below; a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    noises = list(bounds)
    patterns = list(bounds[noises[0]])
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.6, 5.6), layout="constrained")
        axes = figure.subplots(2, 1, sharex=True)
        width = 0.8 / len(patterns)
        titles = ("Cramer-Rao bound", "the product's touches")
        for one, values, title in zip(axes, (bounds, product), titles, strict=True):
            for k, pattern in enumerate(patterns):
                places = [n + (k - (len(patterns) - 1) / 2) * width for n in range(len(noises))]
                heights = [values[noise][pattern] for noise in noises]
                one.bar(places, heights, 0.92 * width, color=SHADES[k], label=pattern)
            one.set_title(title)
            one.set_ylabel("place, median (mm)")
            one.spines[["top", "right"]].set_visible(False)
        labels = [noise.replace(", ", ",\n").replace("end as", "end\nas") for noise in noises]
        axes[1].set_xticks(range(len(noises)), labels)
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(
            handles, names, loc="outside lower center", ncols=len(patterns), frameon=False
        )
        save_picture(figure, path)
