"""Format a frame as one line of text: its touches, places in the image, and a summary of its raw
rows."""

from collections import Counter

import numpy as np

from eitskin.core.results import force_text, solve_text
from eitskin.device.wire.explain import quality_text
from eitskin.session.frame import Frame


def line(frame: Frame, *, solver: bool = True) -> str:
    """Return a line of text for a frame, with the solver's information if ``solver`` is set."""
    parts = [_touches_text(frame), _image_text(frame), _raw_text(frame)]
    if solver:
        parts.append(_solve_text(frame))
    if frame.refused:
        parts = [f"refused: {frame.refused}", _raw_text(frame)]
    text = "; ".join(part for part in (*parts, _found_text(frame)) if part)
    return f"{frame.number:7d} {frame.time_s:9.3f} s  {text}"


def _solve_text(frame: Frame) -> str:
    solved = frame.info
    if solved is None:
        return ""
    if solved.unsolved:
        return "not solved"
    macs, time_us = solved.macs + solved.touch_macs, solved.solve_us + solved.touch_us
    return solve_text(solved.iterations, solved.stop, solved.gap_rel, macs, time_us)


def _found_text(frame: Frame) -> str:
    return ", ".join(frame.found)


def _error(frame: Frame, number: int) -> str:
    if frame.errors_mm is None:
        return ""
    return f", off by {frame.errors_mm[number]:.2f} mm" if number in frame.errors_mm else ", false"


def _touches_text(frame: Frame) -> str:
    if not frame.has_touches:
        return ""
    found = [
        f"#{t.id} ({t.x_mm:.1f}, {t.y_mm:.1f}) mm, radius {t.radius_mm:.1f} mm,"
        f" {t.strength_s_per_m_mm2:.2f} S/m"
        f" mm2{', ' + force_text(t.force_n) if t.force_n else ''}{_error(frame, k)}"
        for k, t in enumerate(frame.touches)
    ]
    return " | ".join(found) or "no touch"


def _image_text(frame: Frame) -> str:
    if frame.solver_image is None:
        return ""
    peak, places_mm = frame.peak, None if frame.has_touches else frame.places_mm
    if peak is None:
        return f"image of {len(frame.solver_image)} pixels"
    if peak.value == 0:
        return "image: flat"
    x_mm, y_mm = peak.place_mm
    text = f"image: peak {peak.value:.4f} S/m at ({x_mm:.1f}, {y_mm:.1f}) mm"
    if places_mm is None:
        return text
    places = (f"({x:.1f}, {y:.1f}) mm{_error(frame, k)}" for k, (x, y) in enumerate(places_mm))
    return f"{text}; places " + " | ".join(places)


def _raw_text(frame: Frame) -> str:
    if frame.raw is None:
        return ""
    volts = frame.raw.voltage_v.astype(np.float64)
    usable = volts[np.isfinite(volts)]
    rms = 1e3 * float(np.sqrt(np.mean(usable**2))) if len(usable) else 0.0
    text = f"raw: {len(volts)} rows in {frame.raw.scan_us / 1e3:.2f} ms, rms {rms:.3f} mV"
    if len(usable) < len(volts):
        text += f", {len(volts) - len(usable)} not usable"
    counts = Counter(quality_text(int(quality)) for quality in frame.raw.quality if quality)
    return text + "".join(f", {count} {what}" for what, count in counts.items())
