"""A picture of each ablation's accuracy against its cost."""

from pathlib import Path
from typing import Any

from eitskin.view.pictures import INK
from eitskin_studies.pictures.style import BLUE, GREY, VERMILION, drawing, legend_below, plain_axes


def draw_search(path: Path, shares: dict[str, dict[str, float]]) -> None:
    """Share of exactly counted scenes in %, by search and set: a panel a set, a line a search.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    sets = list(next(iter(shares.values())))
    with drawing(path, 2.6 * len(sets) + 1.6, 0.3 * len(shares) + 1.2) as figure:
        panels = figure.subplots(1, len(sets), sharey=True)
        for axes, name in zip(panels, sets, strict=True):
            for place, (search, of) in enumerate(shares.items()):
                ours = "default" in search
                axes.barh(place, of[name], color=BLUE if ours else GREY, alpha=1 if ours else 0.6)
                axes.text(of[name] + 2, place, f"{of[name]:.0f}", va="center", fontsize=8)
            axes.set_xlim(0, 118)
            axes.set_xticks(range(0, 101, 25))
            axes.set_title(name)
            axes.set_xlabel("counted exactly, %")
            plain_axes(axes, "x")
        panels[0].set_yticks(range(len(shares)), list(shares))
        panels[0].invert_yaxis()


def draw_images(path: Path, images: dict[str, dict[str, Any]]) -> None:
    """MIoU over multiply-accumulates at 60 and 40 dB, a letter an image, and a line to each refined
    one. ``images`` has for each image, by SNR in dB, ``macs`` and ``miou``.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    from matplotlib.lines import Line2D

    plain = [name for name in images if not name.endswith(", refined")]
    letters = {name: chr(ord("A") + k) for k, name in enumerate(plain)}
    with drawing(path, 9.5, 4.4) as figure:
        both = figure.subplots(1, 2)
        for axes, snr_db in zip(both, ("60", "40"), strict=True):
            for name in plain:
                at = images[name][snr_db]
                here = at["macs"] / 1e6, at["miou"]
                refined = images.get(f"{name}, refined")
                if refined is not None:
                    there = refined[snr_db]["macs"] / 1e6, refined[snr_db]["miou"]
                    axes.plot(*zip(here, there, strict=True), color=VERMILION, linewidth=1.0)
                    axes.plot(*there, "s", color=VERMILION, markersize=5)
                axes.plot(*here, "o", color="white", mec=INK, markersize=11)
                axes.text(*here, letters[name], ha="center", va="center", fontsize=7, color=INK)
            axes.set_xscale("log")
            axes.set_xticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
            axes.minorticks_off()
            axes.margins(x=0.12, y=0.12)
            axes.set_xlabel("million MACs per frame, image and touches")
            axes.set_ylabel("image MIoU")
            axes.set_title(f"SNR {snr_db} dB (each panel has its own MIoU axis)")
            plain_axes(axes)
        marks = [(Line2D([], [], linestyle="none"), f"{one}: {name}")
                 for name, one in letters.items()]  # fmt: skip
        marks.append((Line2D([], [], color=VERMILION, marker="s", markersize=5), "its second pass"))
        legend_below(figure, marks, 7)
