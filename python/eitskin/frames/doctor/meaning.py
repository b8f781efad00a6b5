"""Numbers that are not voltages: all of them have a constant in them (converter counts with 0 V at
mid-scale), or the reference was subtracted from them already."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.doctor.case import Case, correlation, cosine, rms
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding
from eitskin.frames.doctor.subject import Subject

LIKELY = 0.9  # correlation from which a constant explains a reference that nothing else explains
SURE = 0.995  # and from which it is reported beside another explanation
LARGE = 0.5  # constant per rms of the rest, from which it is reported
SURELY_LARGE = 2.0
MID_SCALES = tuple(2.0**bits for bits in range(7, 32))
NEAR = 0.03  # a constant so near to a mid-scale is taken for it
HALF_SUPPLIES = tuple(volts * unit for volts in (0.9, 1.25, 1.5, 1.65, 2.5) for unit in (1.0, 1e3))
NEAR_SUPPLY = 0.01
TRIM = 0.1
RECIPROCAL = 0.6  # correlation of reciprocal rows from which numbers without a reference are EIT's
ALIKE = 0.5  # median cosine of frames with their mean below which they have no common reference
MIN_PAIRS = 8
MIN_FRAMES = 3


@dataclass(frozen=True)
class Constant:
    """The ``value`` of a constant in a reference, what it is per rms of the rest, and the
    ``correlation`` of the rest with the prediction. ``sign`` (m,) is that of the source in each
    row."""

    value: float
    per_rest: float
    correlation: float
    sign: FloatArray

    @property
    def convincing(self) -> bool:
        """Return whether the constant explains a reference that is otherwise unlike a skin."""
        return self.correlation >= LIKELY and abs(self.per_rest) >= LARGE

    @property
    def surely(self) -> bool:
        """Return whether the constant is there, even if the rows look right without it."""
        return self.correlation >= SURE and abs(self.per_rest) >= SURELY_LARGE


def constant_in(case: Case, sign: FloatArray | None) -> Constant:
    """Return the constant that explains the reference best, beside the prediction or its
    magnitudes; a second fit leaves out the worst TRIM of the rows."""
    use = case.trusted & np.isfinite(case.reference)
    signs = np.ones(len(use)) if sign is None else np.asarray(sign, dtype=np.float64)
    none = Constant(0.0, 0.0, 0.0, signs)
    if use.sum() < MIN_PAIRS or not signs[use].any():
        return none
    predictions = [case.predicted]
    mixed = (case.predicted[use] < 0).any() and (case.predicted[use] > 0).any()
    predictions += [np.abs(case.predicted)] if mixed else []
    found = [_fitted(case.reference[use], p[use], signs[use], signs) for p in predictions]
    return max(found, key=lambda one: one.correlation)


def _fitted(
    measured: FloatArray, predicted: FloatArray, sign: FloatArray, signs: FloatArray
) -> Constant:
    design = np.column_stack([predicted, sign])
    keep = np.ones(len(measured), dtype=bool)
    for _ in range(2):
        solution, *_ = np.linalg.lstsq(design[keep], measured[keep], rcond=None)
        residual = np.abs(measured - design @ solution)
        keep = residual <= np.quantile(residual, 1 - TRIM)
    value = float(solution[1])
    rest = measured - value * sign
    level = rms(rest)
    reached = abs(correlation(rest * np.sign(predicted), np.abs(predicted)))
    return Constant(value, value / level if level > 0 else 0.0, reached, signs)


def without_constant(case: Case, constant: Constant) -> Case:
    """Return the case with the constant taken out of all frames."""
    shift = constant.value * constant.sign
    frames = replace(
        case.frames,
        voltage_v=case.frames.voltage_v - shift,
        reference_voltage_v=case.frames.reference_voltage_v - shift,
    )
    return replace(case, frames=frames)


def offset_outcome(constant: Constant, subject: Subject) -> CheckOutcome:
    """Return the finding of a constant in all numbers."""
    in_source = subject.offset - constant.value / subject.scale
    offset = _rounded(in_source)
    middle = abs(offset) in MID_SCALES
    known = f", the middle of a converter of {int(np.log2(abs(offset))) + 1} bits" if middle else ""
    text = (
        f"all numbers have a constant of {-in_source:.6g} in them{known}: take it out with --offset"
        f" {offset:.10g} (in a layout: offset = {offset:.10g})"
    )
    evidence = {
        "constant": float(f"{-in_source:.6g}"),
        "per_rms_of_the_rest": round(constant.per_rest, 2),
        "correlation_without_it": round(constant.correlation, 4),
    }
    finding = Finding("offset", FAULT, text, evidence, f"--offset {offset:.10g}")
    return CheckOutcome((finding,))


def _rounded(offset: float) -> float:
    size = abs(offset)
    near = [scale for scale in MID_SCALES if abs(size - scale) <= NEAR * scale]
    near += [volts for volts in HALF_SUPPLIES if abs(size - volts) <= NEAR_SUPPLY * volts]
    return float(np.copysign(near[0], offset)) if near else float(f"{offset:.5g}")


def differences_outcome(
    cases: Sequence[Case], names: Sequence[str]
) -> tuple[int, CheckOutcome] | None:
    """Return which case holds frames from which the reference was subtracted already, and the
    finding; None if none does.

    Such frames have no large common part, and in the frame with the greatest change reciprocal rows
    agree. This holds for whatever touches the skin, and for no other quantity.
    """
    scores = [_reciprocal_change(case) for case in cases]
    best = int(np.argmax(scores))
    common = _common_part(cases[best])
    if scores[best] < RECIPROCAL or common >= ALIKE:
        return None
    text = (
        "the frames have no common reference, but reciprocal rows agree: the reference was"
        " subtracted from them already; say --differences (or --relative-differences if they were"
        " divided by it, too), and --skin FILE, which predicts the missing reference"
    )
    evidence = {
        "correlation_of_reciprocal_rows": round(scores[best], 4),
        "common_part": round(common, 4),
        "order": names[best],
    }
    return best, CheckOutcome((Finding("differences", FAULT, text, evidence, "--differences"),))


def _all_frames(case: Case) -> FloatArray:
    frames = np.vstack([case.frames.reference_voltage_v, case.frames.voltage_v])
    return np.where(np.isfinite(frames), frames, 0.0)


def _common_part(case: Case) -> float:
    """Return the median cosine of the frames with their mean."""
    frames = _all_frames(case)
    if len(frames) < MIN_FRAMES:
        return 0.0
    return float(np.median([cosine(frame, frames.mean(axis=0)) for frame in frames]))


def _reciprocal_change(case: Case) -> float:
    """Return the correlation of reciprocal rows in the frame with the greatest change."""
    pairs = case.frames.protocol.reciprocal_pairs()
    both = pairs.second >= 0
    if both.sum() < MIN_PAIRS:
        return 0.0
    frames = _all_frames(case)
    frame = frames[int(np.argmax(np.linalg.norm(frames, axis=1)))]
    first = frame[pairs.first[both]]
    return correlation(first, pairs.sign[both] * frame[pairs.second[both]])
