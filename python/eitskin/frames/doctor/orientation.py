"""Find where electrode 0 is and in which direction the numbers run, from touches at known places.

A single touch leaves the mirror image about its own diameter open; two touches that are not mirror
images of each other decide.
"""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.doctor.case import Case, cosine, rms
from eitskin.frames.doctor.noise import MIN_UNTOUCHED, row_noise
from eitskin.frames.doctor.numbering import Numbering, ranked, renumbered_frames
from eitskin.frames.doctor.report import FAULT, NOTE, CheckOutcome, Finding
from eitskin.frames.homogeneous import touch_transfer

LIKELY = 0.7
CLOSE = 0.01
RIVAL_TIMES = 1.5
WEAK_PER_GREATEST = 0.02
AUDIBLE = 3.0
SHOWN = 3


def check_orientation(case: Case, inconclusive: tuple[str, ...]) -> CheckOutcome:
    """Compare the changes by known touches with those of every numbering. ``inconclusive`` are the
    questions that the untouched frame left open."""
    measured, transfers = _changes(case)
    if not measured:
        why = "The known touches have no sign or no change"
        if case.frames.touch_frame is None:
            why = "Say where a touch was (--touch X,Y)"
        elif case.skin is None:
            why = "Name the skin (--skin), so that the file's known touches can decide"
        return CheckOutcome(inconclusive=tuple(f"{text}. {why}" for text in inconclusive))
    size = np.abs(case.predicted)
    weight = 1 / np.maximum(size, WEAK_PER_GREATEST * size.max())
    order = ranked(_fits(case, measured, transfers, weight))
    given, best = next(numbering for numbering in order if numbering.given), order[0]
    evidence = {"frames": len(measured), "as given": round(given.fit, 4)}
    evidence |= {str(numbering): round(numbering.fit, 4) for numbering in order[:SHOWN]}
    summary = {"numbering_by_touch": evidence}
    if best.fit < LIKELY:
        if _drowned(case, measured, weight):
            text = "the known touches change the voltages by less than the noise"
            return CheckOutcome(inconclusive=(text,))
        text = (
            "the known touches do not explain the change in any numbering: wrong places, signs or"
            " frames"
        )
        return CheckOutcome((Finding("touch-unexplained", NOTE, text, evidence),), measured=summary)
    least = 1 - (1 - best.fit) * RIVAL_TIMES - CLOSE
    rivals = [numbering for numbering in order if numbering.fit >= least]
    if given in rivals:
        return CheckOutcome(inconclusive=_also(given, rivals), measured=summary)
    text = (
        f"known touches are seen where they were if the electrodes are renumbered ({best}), not as"
        " given"
    )
    if len(rivals) > 1:
        text += f"; {rivals[1]} fits nearly as well, and a second touch would decide"
    finding = Finding("numbering", FAULT, text, evidence, best.option)
    return CheckOutcome((finding,), measured=summary)


def _changes(case: Case) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return the measured change (m,) and the predicted change of the transfer matrix (n, n) for
    each frame with touches of known sign."""
    frames, skin = case.frames, case.skin
    at_mm, radius_mm, sign = frames.touch_xy_mm, frames.touch_radius_mm, frames.touch_sign
    if frames.touch_frame is None or skin is None:
        return [], []
    assert at_mm is not None  # Frames has all of these if it has touch_frame
    assert radius_mm is not None
    assert sign is not None
    measured, transfers = [], []
    for frame in np.unique(frames.touch_frame):
        own = frames.touches_in(int(frame))
        change = frames.voltage_v[frame] - case.reference
        if (sign[own] == 0).any() or not np.isfinite(change).all() or not change.any():
            continue
        measured.append(change)
        transfers.append(touch_transfer(skin, at_mm[own], radius_mm[own], sign[own]))
    return measured, transfers


def _fits(
    case: Case, measured: list[FloatArray], transfers: list[FloatArray], weight: FloatArray
) -> FloatArray:
    """Return the mean cosine (2, n) of the measured changes with those that each numbering
    predicts, rows multiplied by ``weight``."""
    use = case.trusted
    total = np.zeros((2, case.n_electrodes))
    for change, transfer in zip(measured, transfers, strict=True):
        seen, frames = (
            (change * weight)[use],
            (renumbered_frames(case, transfer) * weight)[..., use],
        )
        total += np.array([[cosine(seen, frame) for frame in side] for side in frames])
    return total / len(measured)


def _also(given: Numbering, rivals: list[Numbering]) -> tuple[str, ...]:
    others = [str(numbering) for numbering in rivals if numbering != given]
    if not others:
        return ()
    return (f"the numbering fits as given, but {' or '.join(others[:SHOWN])} too: touch elsewhere",)


def _drowned(case: Case, measured: list[FloatArray], weight: FloatArray) -> bool:
    """Return whether the weighted changes are below AUDIBLE times the weighted noise of one frame;
    False if the noise is unknown."""
    untouched = case.frames.reference_voltage_v
    if len(untouched) < MIN_UNTOUCHED:
        return False
    noise = rms((np.nan_to_num(row_noise(untouched)) * weight)[case.trusted])
    return rms(np.array([(change * weight)[case.trusted] for change in measured])) < AUDIBLE * noise
