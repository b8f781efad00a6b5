"""Draw the doctor's findings: reference and expectation, gains by pair, reciprocity, and noise.
Needs matplotlib."""

from pathlib import Path
from typing import Any

import numpy as np

from eitskin.frames.doctor.case import Case
from eitskin.frames.doctor.gain import row_gains
from eitskin.frames.doctor.noise import MIN_UNTOUCHED, row_noise
from eitskin.frames.doctor.report import FAULT, DoctorReport
from eitskin.view.panel_texts import wrapped
from eitskin.view.panels import check_picture, save_picture

MEASURED, EXPECTED, BAD = "#1f5f99", "#b0b7bd", "#c2410c"
GAIN_SPAN = 0.3


def draw_report(path: str | Path, report: DoctorReport, case: Case) -> None:
    """Write the picture of an examined ``case`` to ``path`` (.png, .pdf, .svg)."""
    check_picture(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    _reference(axes[0, 0], case)
    _gains(figure, axes[0, 1], case)
    _reciprocity(axes[1, 0], case)
    _noise_or_change(axes[1, 1], case)
    for panel in axes.ravel():
        panel.spines[["top", "right"]].set_visible(False)
    faults = [finding.name for finding in report.findings if finding.severity == FAULT]
    found = ", ".join(dict.fromkeys(faults))
    verdict = f"to repair: {found}" if faults else "nothing must be repaired"
    title = wrapped(f"{Path(report.source).name}: {verdict}", 10.6, 11)
    figure.suptitle("\n".join(title).replace("$", r"\$"), x=0.01, ha="left", fontsize=11)
    save_picture(figure, path)


def _reference(panel: Any, case: Case) -> None:
    expected_mv, measured_mv = 1e3 * case.expected(), 1e3 * case.reference
    label = "expected for a homogeneous skin"
    panel.plot(expected_mv, color=EXPECTED, linewidth=2.5, label=label)
    panel.plot(measured_mv, color=MEASURED, linewidth=0.9, label="measured")
    off = np.flatnonzero(~case.trusted)
    if len(off):
        panel.plot(off, measured_mv[off], ".", color=BAD, markersize=6, label="not trusted")
    panel.set(xlabel="row (order and sign repaired)", ylabel="mV", title="Mean untouched frame")
    low, high = panel.get_ylim()
    panel.set_ylim(low, high + 0.2 * (high - low))
    panel.legend(frameon=False, fontsize=8, loc="upper right", ncols=2)


def _gains(figure: Any, panel: Any, case: Case) -> None:
    gain, strong = row_gains(case)
    drives, drive = np.unique(case.rows[:, :2], axis=0, return_inverse=True)
    pairs, pair = np.unique(case.rows[:, 2:], axis=0, return_inverse=True)
    grid = np.full((len(drives), len(pairs)), np.nan)
    grid[drive.ravel(), pair.ravel()] = np.where(strong, gain - 1, np.nan)
    left_out = np.full(grid.shape, np.nan)
    left_out[drive.ravel(), pair.ravel()] = np.where(case.trusted, np.nan, 1.0)
    shown = panel.imshow(
        100 * grid, cmap="RdBu_r", vmin=-100 * GAIN_SPAN, vmax=100 * GAIN_SPAN, origin="lower"
    )
    panel.imshow(left_out, cmap="Greys", vmin=0, vmax=2, origin="lower")
    for set_ticks, named in ((panel.set_yticks, drives), (panel.set_xticks, pairs)):
        step = max(1, len(named) // 8)
        texts = [f"{a},{b}" for a, b in named[::step]]
        set_ticks(range(0, len(named), step), texts, fontsize=8)
    panel.set(xlabel="measuring pair", ylabel="drive pair")
    panel.set_title("Gain of each row (grey: not trusted)")
    figure.colorbar(shown, ax=panel, label="% from expected")


def _reciprocity(panel: Any, case: Case) -> None:
    pairs = case.frames.protocol.reciprocal_pairs()
    both = pairs.second >= 0
    first, second, sign = pairs.first[both], pairs.second[both], pairs.sign[both]
    panel.set(xlabel="voltage of a row, mV", ylabel="mV")
    panel.set_title("Reciprocity: difference within each pair")
    if not len(first):
        panel.text(0.5, 0.5, "no reciprocal rows", transform=panel.transAxes, ha="center")
        return
    reference = 1e3 * case.reference
    difference = reference[first] - sign * reference[second]
    good = case.trusted[first] & case.trusted[second]
    panel.axhline(0, color=EXPECTED, linewidth=1)
    panel.plot(reference[first][good], difference[good], ".", color=MEASURED, markersize=5)
    panel.plot(reference[first][~good], difference[~good], ".", color=BAD, markersize=6)


def _noise_or_change(panel: Any, case: Case) -> None:
    untouched = case.frames.reference_voltage_v
    if len(untouched) >= MIN_UNTOUCHED:
        noise = 1e6 * row_noise(np.nan_to_num(untouched))
        panel.semilogy(np.maximum(noise, 1e-6), ".", color=MEASURED, markersize=4)
        for axis_format in (panel.yaxis.set_major_formatter, panel.yaxis.set_minor_formatter):
            axis_format("{x:g}")
        median = float(np.median(noise[case.trusted])) if case.trusted.any() else 0.0
        panel.axhline(median, color=EXPECTED)
        panel.set(xlabel="row", ylabel="µV")
        panel.set_title(f"Noise of {len(untouched)} untouched frames (line: median)")
        return
    panel.set(xlabel="row", ylabel="mV", title="Change of each frame from the reference")
    for frame in case.frames.voltage_v[:20]:
        panel.plot(1e3 * (frame - case.reference), linewidth=0.7)
