"""A picture of each ablation's accuracy against its cost."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eitskin.view.panels import DPI
from eitskin.view.pictures import FOUND, INK, load_matplotlib

Found = Mapping[str, Mapping[str, Any]]


def draw_search(path: Path, searches: Found) -> None:
    """Share of exactly counted scenes of each set, a bar a search.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    load_matplotlib()
    import matplotlib.pyplot as plt

    sets = [name for name in next(iter(searches.values())) if "radii" in name]
    size = (2.9 * len(sets), 0.34 * len(searches) + 1.1)
    figure, axes = plt.subplots(1, len(sets), figsize=size, sharey=True, layout="constrained")
    for axis, name in zip(axes, sets, strict=True):
        shares = [
            100 * sum(found[name]["exact"]) / len(found[name]["exact"])
            for found in searches.values()
        ]
        colours = [FOUND if "default" in search else "#9bb8b4" for search in searches]
        axis.barh(range(len(shares)), shares, color=colours)
        for place, share in enumerate(shares):
            axis.text(
                share - 2, place, f"{share:.0f}", ha="right", va="center", color="white", fontsize=8
            )
        axis.set_xlim(0, 100)
        axis.set_title(name)
        axis.set_xlabel("counted exactly, %")
    axes[0].set_yticks(range(len(searches)), list(searches))
    axes[0].invert_yaxis()
    figure.savefig(path, dpi=DPI)
    plt.close(figure)


def draw_images(path: Path, images: Found) -> None:
    """MIoU over multiply-accumulates at 60 and 40 dB, an arrow from each image to its refined one.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    load_matplotlib()
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    for axis, snr in zip(axes, ("60", "40"), strict=True):
        for name, found in images.items():
            here = found[snr]["macs"] / 1e6, found[snr]["image"]["mean"]
            refined = images.get(f"{name}, refined")
            axis.plot(*here, "o", color=FOUND if "refined" in name else INK, markersize=5)
            if "refined" not in name:
                axis.annotate(
                    name, here, xytext=(5, -11), textcoords="offset points", fontsize=8, color=INK
                )
            if refined is not None:
                there = refined[snr]["macs"] / 1e6, refined[snr]["image"]["mean"]
                axis.annotate(
                    "", there, xytext=here, arrowprops={"arrowstyle": "->", "color": FOUND}
                )
        axis.set_xscale("log")
        axis.margins(x=0.25, y=0.12)
        axis.set_xlabel("million MACs a frame, image and touches")
        axis.set_ylabel("image MIoU")
        axis.set_title(f"{snr} dB; arrows: refined")
    figure.savefig(path, dpi=DPI)
    plt.close(figure)
