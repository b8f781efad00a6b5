"""Pictures of touches in time: what is reported a stream without and with tracking, and what
tracking is worth."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eitskin.core.diagnostics_table import Touch
from eitskin.view.panels import save_picture
from eitskin.view.pictures import STYLE, load_matplotlib

if TYPE_CHECKING:
    from eitskin_studies.experiments.tracking.counted import TrackCount
    from eitskin_studies.experiments.tracking.streams import TouchStream

COLOURS = ("#00796b", "#c2185b", "#3949ab", "#ef6c00", "#6d4c41", "#00838f", "#7b1fa2", "#558b2f")
TRUE = "#c8c8c8"


def draw_stream_told(
    path: Path, stream: "TouchStream", reported: Mapping[str, Sequence[Sequence[Touch]]], note: str
) -> None:
    """x and y of every touch by frame, a colour an id, over the true places; a row of panels for
    each way in ``reported``.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    matplotlib = load_matplotlib()
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.9 * len(reported)))
        axes = figure.subplots(len(reported), 2, sharex=True, sharey=True, squeeze=False)
        for row, (name, frames) in zip(axes, reported.items(), strict=True):
            for axis, coordinate in zip(row, ("x_mm", "y_mm"), strict=True):
                for one in stream.samples:
                    place = np.where(one.there, getattr(one, coordinate), np.nan)
                    axis.plot(place, color=TRUE, linewidth=6, solid_capstyle="butt", zorder=1)
                ids = sorted({touch.id for touches in frames for touch in touches})
                for number, own in enumerate(ids):
                    seen = [
                        (k, getattr(t, coordinate))
                        for k, touches in enumerate(frames)
                        for t in touches
                        if t.id == own
                    ]
                    colour = COLOURS[number % len(COLOURS)]
                    axis.plot(
                        *zip(*seen, strict=True),
                        ".-",
                        color=colour,
                        linewidth=0.8,
                        markersize=4,
                        zorder=2,
                    )
                axis.set_title(f"tracking {name}: {coordinate[0]}, {len(ids)} id(s)", loc="left")
                axis.set_ylabel("mm")
                axis.set_xlim(-1, len(frames))
        for axis in axes[-1]:
            axis.set_xlabel("frame")
        fingers = (
            f"Touches reported for {len(stream.samples)} fingers at {stream.speed_mm_s:g} mm/s"
        )
        figure.suptitle(f"{fingers}, {note}; grey: true, a colour an id", fontsize=9.5)
        figure.tight_layout()
        save_picture(figure, path)


def draw_worth(
    path: Path,
    counts: "Mapping[tuple[int, int, str], TrackCount]",
    snrs_db: Sequence[int],
    speeds: Sequence[int],
) -> None:
    """Exact counts, id switches and position errors by SNR, tracking off and all.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    matplotlib = load_matplotlib()
    from matplotlib.figure import Figure

    panels: tuple[tuple[str, Callable[[TrackCount], float]], ...] = (
        ("exact counts, % of frames", lambda count: 100 * count.exact / count.frames),
        ("id switches a finger", lambda count: count.switches / count.fingers),
        (
            "position error, 95th percentile, mm",
            lambda count: float(np.quantile(count.errors_mm or [np.nan], 0.95)),
        ),
    )
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.1))
        axes = figure.subplots(1, len(panels))
        for axis, (title, value) in zip(axes, panels, strict=True):
            for speed, colour in zip(speeds, COLOURS, strict=False):
                for name, style in (("off", "o:"), ("all", "s-")):
                    values = [value(counts[snr_db, speed, name]) for snr_db in snrs_db]
                    axis.plot(
                        snrs_db,
                        values,
                        style,
                        color=colour,
                        markersize=4,
                        label=f"{speed} mm/s, {name}",
                    )
            axis.set_title(title, loc="left", fontsize=9)
            axis.set_xticks(snrs_db, [f"{snr_db} dB" for snr_db in snrs_db])
        axes[1].legend(frameon=False, fontsize=7.5)
        figure.tight_layout()
        save_picture(figure, path)
