"""Pictures of the force study: readings over weight, errors over the skin, the smallest weight over
the SNR."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.skin.skin import Skin
from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, RIM, STYLE, load_matplotlib
from eitskin_studies.experiments.force.law import WEIGHTS_G
from eitskin_studies.experiments.force.readouts import INTEGRAL, PEAK, TOUCH
from eitskin_studies.experiments.force.scenes import RADIUS_SHARES
from eitskin_studies.pictures.style import BLUE, GREEN, PURPLE, VERMILION

if TYPE_CHECKING:
    from eitskin_studies.experiments.force.anywhere import Anywhere
    from eitskin_studies.experiments.force.curves import ForceCurves
    from eitskin_studies.experiments.force.detection import Detection


COLOURS = (PURPLE, BLUE, GREEN, VERMILION)  # from the centre to the rim
NAMES = ("centre", *(f"{share:g} R" for share in RADIUS_SHARES[1:]))
SHOWN = ((PEAK, "peak (S/m)"), (INTEGRAL, "integral (S/m mm²)"), (TOUCH, "strength (S/m mm²)"))


def draw_curves(path: Path, curves: dict[str, ForceCurves]) -> None:
    """Readings over weight at the four radii, three readouts side by side, with 90 % bands over the
    laws.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(11.4, 4.0), layout="constrained")
        for k, (name, unit) in enumerate(SHOWN):
            axes, one = figure.add_subplot(1, len(SHOWN), k + 1), curves[name]
            low, high = np.nanquantile(one.bands, [0.05, 0.95], axis=0)
            for radius, (colour, where) in enumerate(zip(COLOURS, NAMES, strict=True)):
                axes.fill_between(
                    WEIGHTS_G, low[radius], high[radius], color=colour, alpha=0.13, linewidth=0
                )
                axes.plot(
                    WEIGHTS_G, one.mean[radius], "o-", color=colour, label=where, markersize=4
                )
            axes.set_title(name)
            axes.set_xlabel("weight (g)")
            axes.set_ylabel(unit)
            axes.set_ylim(bottom=0)
            axes.grid(alpha=0.25)
        figure.axes[0].legend(frameon=False, title="place")
        save_picture(figure, path)


def draw_skin(
    path: Path,
    skin: Skin,
    places_mm: FloatArray,
    judged: dict[tuple[str, float], Anywhere],
    snr_db: float,
) -> None:
    """Each place's error, the mean over the weights, before and after calibration, for the paper's
    reading and for the touch.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    panels = [(name, kind) for name in (PEAK, TOUCH) for kind in ("raw", "calibrated")]
    limits = {PEAK: 100.0, TOUCH: 5.0}
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(13.2, 3.9), layout="constrained")
        rim = np.vstack([np.array(skin.outline.vertices_mm), skin.outline.vertices_mm[:1]])
        for k, (name, kind) in enumerate(panels):
            axes = figure.add_subplot(1, len(panels), k + 1)
            errors = 100 * np.nanmean(getattr(judged[name, snr_db], kind), axis=1)
            axes.plot(*rim.T, color=RIM, linewidth=1)
            most = limits[name]
            style = {
                "cmap": "RdBu_r",
                "vmin": -most,
                "vmax": most,
                "s": 90,
                "edgecolors": INK,
                "linewidths": 0.5,
            }
            shown = axes.scatter(*places_mm.T, c=errors, **style)
            axes.set_aspect("equal")
            axes.set_axis_off()
            axes.set_title(
                f"{name}\n{kind}, mean of {len(WEIGHTS_G)} weights:"
                f" {np.nanstd(errors, ddof=1):.1f} %"
            )
            if kind == "calibrated":
                figure.colorbar(
                    shown, ax=figure.axes[-2:] if k else axes, shrink=0.8, label="off by (%)"
                )
        save_picture(figure, path)


def draw_detection(path: Path, found: list[Detection]) -> None:
    """The smallest weight over the SNR at the four radii, with 95 % intervals.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(6.4, 4.4), layout="constrained")
        axes = figure.add_subplot()
        for radius, (colour, where) in enumerate(zip(COLOURS, NAMES, strict=True)):
            reported = np.array([(one.snr_db, *one.threshold(radius)) for one in found])
            reported = reported[np.isfinite(reported[:, 1])]
            top = np.where(np.isfinite(reported[:, 3]), reported[:, 3], found[0].loads_g[-1])
            bars = np.maximum([reported[:, 1] - reported[:, 2], top - reported[:, 1]], 0)
            snr_db = reported[:, 0] + 0.5 * (radius - 1.5)  # side by side
            axes.errorbar(
                snr_db,
                reported[:, 1],
                bars,
                fmt="o-",
                color=colour,
                label=where,
                markersize=4,
                capsize=2,
            )
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(matplotlib.ticker.StrMethodFormatter("{x:g}"))
        axes.set_xlabel("SNR (dB)")
        axes.set_ylabel("smallest weight detected with probability 0.9 (g)")
        axes.grid(alpha=0.25, which="both")
        axes.legend(frameon=False, title="place")
        save_picture(figure, path)
