"""Noise of each row, SNR and drift, from the untouched frames.

The noise of a row is the rms of the differences between successive untouched frames over sqrt(2),
which slow drift does not affect. SNR = 20 log10(rms(V0) / sigma), where V0 is the mean untouched
frame and sigma is the rms of the noise over all rows. Drift is the change of the common gain of the
frame, <V, V0> / <V0, V0>, along a straight line through all untouched frames.
"""

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.frames.doctor.case import Case, numbers, rms, short_list, strength_groups
from eitskin.frames.doctor.remedy import row_remedy
from eitskin.frames.doctor.report import FAULT, NOTE, CheckOutcome, Finding
from eitskin.frames.orders import touching

MIN_UNTOUCHED = 4
NOISY_TIMES = 4.0
SNR_NOTE_DB = 45.0
SNR_FAULT_DB = 30.0
MAX_OF_ELECTRODE = 0.4
DRIFT_NOTE = 0.005
DRIFT_FAULT = 0.02
DRIFT_SIGMAS = 6.0


def row_noise(untouched: FloatArray) -> FloatArray:
    """Return the noise (m,) of each row from untouched frames (k, m)."""
    return np.asarray(np.sqrt((np.diff(untouched, axis=0) ** 2).mean(axis=0) / 2))


def check_noise(case: Case) -> CheckOutcome:
    """Report noisy rows, a low SNR, and drift."""
    untouched = case.frames.reference_voltage_v
    untouched = untouched[np.isfinite(untouched[:, case.trusted]).all(axis=1)]
    if len(untouched) < MIN_UNTOUCHED:
        few = (
            f"noise, SNR and drift: {len(untouched)} untouched frame(s), they need at least"
            f" {MIN_UNTOUCHED}"
        )
        return CheckOutcome(inconclusive=(few,))
    trusted = np.flatnonzero(case.trusted)
    noise = row_noise(untouched[:, trusted])
    level, sigma = rms(case.reference[trusted]), rms(noise)
    if sigma == 0 or level == 0:
        return CheckOutcome(inconclusive=("noise and SNR: the untouched frames are all the same",))
    usual = np.maximum(_usual_noise(case, noise), np.median(noise) / NOISY_TIMES)
    noisy = (noise > NOISY_TIMES * usual) & (np.median(noise) > 0)
    healthy_sigma = rms(noise[~noisy]) or sigma
    snr, healthy_snr = (20 * np.log10(level / one) for one in (sigma, healthy_sigma))
    measured = {"snr_db": round(float(snr), 2), "noise_v": float(f"{sigma:.4g}")}
    measured["quiet_frames"] = len(untouched)
    findings: list[Finding] = []
    evidence: dict[str, object]
    if noisy.any():
        rows = trusted[noisy]
        shared = _common_electrode(case, rows)
        text = f"{len(rows)} row(s) are far noisier than the others: {short_list(rows)}"
        remedy = row_remedy(case, rows)
        if shared is not None:
            text += f", all of electrode {shared} (from 0)"
            remedy = f"--drop-electrodes {shared}"
        evidence = {
            "channels": numbers(rows),
            "times_usual": [round(float(v), 2) for v in noise[noisy] / usual[noisy]],
            "snr_db_without_them": round(float(healthy_snr), 2),
        }
        findings.append(Finding("noisy-channels", FAULT, text, evidence, remedy))
    if healthy_snr < SNR_NOTE_DB:
        fault = healthy_snr < SNR_FAULT_DB
        what = "too low to image" if fault else "weak touches will be lost"
        text = f"the SNR is {healthy_snr:.1f} dB: {what}"
        limits = {"note_below": SNR_NOTE_DB, "fault_below": SNR_FAULT_DB}
        evidence = {"snr_db": round(float(healthy_snr), 2), **limits}
        findings.append(Finding("snr", FAULT if fault else NOTE, text, evidence))
    drift, uncertainty = _drift(untouched[:, trusted], case.reference[trusted], healthy_sigma)
    measured["drift"] = float(f"{drift:.3g}")
    if abs(drift) > max(DRIFT_NOTE, DRIFT_SIGMAS * uncertainty):
        fault = abs(drift) > DRIFT_FAULT
        text = (
            f"the gain drifts by {100 * drift:.2f} % over the {len(untouched)} untouched frames:"
            " take untouched frames nearer in time, or project the reference out"
        )
        evidence = {"drift": round(drift, 5), "uncertainty": float(f"{uncertainty:.3g}")}
        evidence["fault_from"] = DRIFT_FAULT
        findings.append(Finding("drift", FAULT if fault else NOTE, text, evidence))
    return CheckOutcome(tuple(findings), measured=measured)


def _usual_noise(case: Case, noise: FloatArray) -> FloatArray:
    """Return the median noise of rows as strong as each trusted row: strong rows may have more
    noise."""
    strength, usual = np.abs(case.predicted[case.trusted]), noise.copy()
    for group in strength_groups(strength, np.ones(len(noise), dtype=bool)):
        usual[group] = np.median(noise[group])
    return usual


def _drift(untouched: FloatArray, reference: FloatArray, sigma: float) -> tuple[float, float]:
    """Return the change of the common gain along its fitted line over all untouched frames, and the
    standard deviation of this change by noise."""
    gain = untouched @ reference / (reference @ reference)
    when = np.linspace(-0.5, 0.5, len(untouched))
    slope = float(when @ gain / (when @ when))
    return slope, float(sigma / np.linalg.norm(reference) / np.sqrt(when @ when))


def _common_electrode(case: Case, rows: IntArray) -> int | None:
    """Return the electrode that is in all of ``rows``, if these are a large part of its
    rows."""
    for electrode in range(case.n_electrodes):
        using = touching(case.rows, [electrode]) & case.trusted
        if using[rows].all() and len(rows) >= MAX_OF_ELECTRODE * np.count_nonzero(using):
            return electrode
    return None
