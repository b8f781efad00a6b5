"""Pictures of the force study: readings over weight, errors over the skin, the smallest weight over
the SNR."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.view.pictures import INK, RIM
from eitskin_studies.pictures.style import (
    BLUE,
    GREEN,
    MARKERS,
    PURPLE,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
    plain_ticks,
)

COLOURS = (PURPLE, BLUE, GREEN, VERMILION)  # from the centre to the rim


def draw_curves(path: Path, data: Mapping[str, Any]) -> None:
    """Readings over weight at the four radii, side by side, with 90 % bands over the laws. ``data``
    has ``weights_g``, the names of ``places``, and ``readings``: name, unit, and by place mean, low
    and high at each weight.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    weights_g, readings = data["weights_g"], data["readings"]
    with drawing(path, 11.4, 4.4) as figure:
        panels = figure.subplots(1, len(readings))
        for axes, one in zip(panels, readings, strict=True):
            for k, where in enumerate(data["places"]):
                axes.fill_between(
                    weights_g, one["low"][k], one["high"][k], color=COLOURS[k], alpha=0.13,
                    linewidth=0,
                )  # fmt: skip
                axes.plot(
                    weights_g, one["mean"][k], marker=MARKERS[k], color=COLOURS[k], label=where,
                    markersize=4.5,
                )  # fmt: skip
            axes.set_title(one["name"])
            axes.set_xlabel("weight (g)")
            axes.set_ylabel(one["unit"])
            axes.set_ylim(bottom=0)
            plain_axes(axes)
        legend_below(figure, panels[0], len(data["places"]))
        figure.suptitle("The value over the weight, by distance from the centre (R: the radius)")


def draw_skin(path: Path, data: Mapping[str, Any]) -> None:
    """Each place's error, the mean over the weights, before and after calibration, for the paper's
    reading and for the touch. ``data`` has ``rim_mm``, ``places_mm``, and ``panels``: title, errors
    in % and the end of the colours, ``most``.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    rim, places, panels = np.array(data["rim_mm"]), np.array(data["places_mm"]), data["panels"]
    with drawing(path, 13.2, 3.9) as figure:
        row = figure.subplots(1, len(panels))
        for k, (axes, one) in enumerate(zip(row, panels, strict=True)):
            axes.plot(*rim.T, color=RIM, linewidth=1)
            shown = axes.scatter(
                *places.T, c=one["errors"], cmap="RdBu_r", vmin=-one["most"], vmax=one["most"],
                s=90, edgecolors=INK, linewidths=0.5,
            )  # fmt: skip
            axes.set_aspect("equal")
            axes.set_axis_off()
            axes.set_title(one["title"])
            if k % 2:
                figure.colorbar(
                    shown,
                    ax=list(row[k - 1 : k + 1]),
                    shrink=0.8,
                    label="off by (%)",
                    extend="both",
                )


def draw_detection(path: Path, data: Mapping[str, Any]) -> None:
    """The smallest weight over the SNR at the four radii, with 95 % intervals. ``data`` has the
    names of ``places``, and for each of them ``found``: SNR in dB, grams, low and high.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    with drawing(path, 6.8, 4.8) as figure:
        axes = figure.subplots()
        for k, (where, found) in enumerate(zip(data["places"], data["found"], strict=True)):
            snr_db, grams, low, high = (np.array(one) for one in zip(*found, strict=True))
            axes.errorbar(
                snr_db + 0.5 * (k - 1.5),  # side by side
                grams,
                np.maximum([grams - low, high - grams], 0),
                fmt=f"{MARKERS[k]}-",
                color=COLOURS[k],
                label=where,
                markersize=4.5,
                capsize=2,
            )
        axes.set_yscale("log")
        plain_ticks(axes.yaxis, (5, 10, 20, 50, 100))
        axes.set_xlabel("SNR (dB)")
        axes.set_ylabel("smallest weight detected with probability 0.9 (g)")
        plain_axes(axes)
        legend_below(figure, axes, len(data["places"]))
