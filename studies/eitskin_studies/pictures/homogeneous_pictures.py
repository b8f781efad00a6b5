"""The experiment ``homogeneous`` as pictures: untouched skins' waveforms, and each value's distance
from the mean over drives."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from eitskin.view.pictures import COLOURS
from eitskin_studies.experiments.homogeneous.cases import IDEAL, MEASURED_TANK, SIMULATED_TANK
from eitskin_studies.experiments.homogeneous.tables import Row
from eitskin_studies.experiments.homogeneous.uniformity import deviations_percent
from eitskin_studies.pictures.style import BLUE, GREEN, GREY, VERMILION, drawing, plain_axes

EVEN, SHOWN, BROKEN, TANK = GREY, BLUE, VERMILION, GREEN
COLUMNS = 4


def draw_waveforms(path: Path, *, rows: Sequence[Row]) -> None:
    """Draw the first session of each case that differs visibly, over the even skin, drive by drive.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    by_name = {row.name: row for row in rows}
    ideal = by_name[IDEAL]
    usual = rows[1]
    pairs = [(ideal, usual, SHOWN), *((ideal, row, BROKEN) for row in rows if row.fault)]
    if MEASURED_TANK in by_name:
        pairs.append((by_name[SIMULATED_TANK], by_name[MEASURED_TANK], TANK))
    with drawing(path, 11.0, 1.75 * len(pairs) + 0.6) as figure:
        for axes, (even, row, colour) in zip(
            np.atleast_1d(figure.subplots(len(pairs), 1, sharex=True)), pairs, strict=True
        ):
            tank = row.name == MEASURED_TANK
            for one, style in (
                (even, {"color": EVEN, "linewidth": 2.4}),
                (row, {"color": colour, "linewidth": 1.0}),
            ):
                # turned so that an even skin is above 0; a tank's current and amplifier are not
                # known: parts of its own rms
                values = one.folded_v[0] * np.sign((one if tank else even).folded_v[0].mean())
                scale = 1 / math.sqrt(np.mean(values**2)) if tank else 1e3
                axes.plot(scale * values.ravel(), label=one.name, **style)
            drives, positions = row.folded_v.shape[1:]
            for d in range(1, drives):
                axes.axvline(d * positions - 0.5, color=GREY, linewidth=0.4, alpha=0.5)
            axes.set_ylabel("voltage / its rms" if tank else "voltage, mV")
            axes.set_xlim(-1, drives * positions)
            plain_axes(axes, "y")
            axes.legend(
                loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, fontsize=8, frameon=False
            )
        axes.set_xticks(
            [positions * d + (positions - 1) / 2 for d in range(drives)],
            [str(d) for d in range(drives)],
        )
        axes.set_xlabel(
            "drive: current into the electrode of this number, out of the next one;"
            " the 13 measuring pairs of each drive from left to right"
        )
        figure.suptitle("Voltages of an untouched skin: one U for each drive")


def draw_deviations(path: Path, *, rows: Sequence[Row]) -> None:
    """The first session of each case: each value's distance from the mean over drives, by drive and
    position; raises as above."""
    lines = math.ceil(len(rows) / COLUMNS)
    with drawing(path, 3.0 * COLUMNS, 2.55 * lines + 0.6) as figure:
        axes = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
        for here, row in zip(axes, rows, strict=False):
            shown = deviations_percent(row.folded_v[0])
            limit = float(np.abs(shown).max()) or 1.0
            # one value far off must not hide the pattern of the others
            limit = min(limit, 3 * float(np.percentile(np.abs(shown), 90)) or limit)
            image = here.imshow(
                shown, cmap=COLOURS, vmin=-limit, vmax=limit, interpolation="nearest", aspect="auto"
            )
            here.set_title(row.name, fontsize=8.5)
            here.set_xticks(
                range(0, shown.shape[1], 2), [str(p + 2) for p in range(0, shown.shape[1], 2)]
            )
            here.set_yticks(range(0, shown.shape[0], 3))
            bar = figure.colorbar(image, ax=here, shrink=0.9, aspect=18, pad=0.02)
            bar.set_label("%", rotation=0, labelpad=2)
        for here in axes[len(rows) :]:
            here.set_axis_off()
        figure.supxlabel("measuring pair, counted in electrodes from the drive")
        figure.supylabel("drive")
        figure.suptitle(
            "Distance of each of the 208 values from the mean over drives; each panel has its own"
            " scale"
        )
