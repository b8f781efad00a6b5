"""Check from untouched frames alone whether a taught model still fits its skin.

The untouched skin now is compared with the one when it was taught, by two numbers: the correlation
of the rows, and the distance in the metric of the noise of presses, as a multiple of the change by
a mean press. For a hydrogel skin (DSHardman/HydrogelEIT), the correlation is .9999 at once in the
same session, and .996 after 400 presses of drying, when the error has grown from 1.2 to 2.1 mm. For
two other sessions it is .97 and .93, with an error of 9.5 mm that an update repairs. For another
skin of the same make it is 0. Turned or shifted places do not change an untouched frame, so they
are not detected.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.errors import FrameError, ProtocolError
from eitskin.model.model import Model
from eitskin.skin.protocol import Protocol, pattern_name
from eitskin.teaching.fit import whitening_of
from eitskin.teaching.known import known_of

FITS, UPDATE, TEACH_AGAIN = "fits", "update", "teach again"
FITS_ABOVE, UPDATE_ABOVE = 0.99, 0.85
FITS_BELOW = 0.5  # of a press; a smaller distance is noise or drift, whatever the correlation
UPDATE_FROM = 10.0  # presses; one row or electrode may be wrong although the correlation is high


@dataclass(frozen=True)
class StillFits:
    """The ``verdict``, the ``correlation`` of the rows, the ``distance`` of the whole frame in
    presses, and the ``rule`` that decided."""

    verdict: str
    correlation: float
    distance: float
    rule: str


def still_fits(
    model: Model, untouched: npt.ArrayLike, protocol: Protocol, *, where: str = "model"
) -> StillFits:
    """Compare untouched frames (n, m) in V with those that ``model`` was taught on. The median of
    several frames is used, so that a touch in a few of them does no harm.

    Raises:
        ModelError: the model was not taught.
        ProtocolError: it has another protocol.
        FrameError: no frame is complete.
    """
    known = known_of(model, where)
    if model.protocol.hash != protocol.hash:
        raise ProtocolError(
            f"{where}: taught with {pattern_name(model.protocol)}, but the frames are of"
            f" {pattern_name(protocol)}; give the model of this skin"
        )
    frames = np.atleast_2d(np.asarray(untouched, dtype=np.float64))
    frames = frames[np.isfinite(frames).all(axis=1)]
    if not len(frames):
        raise FrameError(
            f"{where}: no frame has a number in every row; check the electrodes with  eitskin"
            " doctor"
        )
    now, then = np.median(frames, axis=0), model.v_ref_v.astype(np.float64)
    a, b = now - now.mean(), then - then.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    correlation = float(a @ b) / size if size > 0 else 0.0
    white = whitening_of(known.noise)
    press = np.linalg.norm(known.answer @ white.T, axis=1).mean()
    distance = float(np.linalg.norm(white @ (now - then)) / press)
    verdict, rule = _verdict(correlation, distance)
    return StillFits(verdict, correlation, distance, rule)


def _verdict(correlation: float, distance: float) -> tuple[str, str]:
    if distance < FITS_BELOW:
        return FITS, f"distance below {FITS_BELOW:g} presses"
    if correlation < UPDATE_ABOVE:
        return TEACH_AGAIN, f"correlation below {UPDATE_ABOVE:g}"
    if correlation < FITS_ABOVE:
        return UPDATE, f"correlation below {FITS_ABOVE:g}"
    if distance > UPDATE_FROM:
        return UPDATE, f"distance above {UPDATE_FROM:g} presses"
    return FITS, f"correlation at least {FITS_ABOVE:g}, distance at most {UPDATE_FROM:g} presses"
