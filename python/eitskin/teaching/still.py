"""Whether a taught model still fits its skin, from untouched frames alone.

What is compared is the untouched skin now and when it was taught. Two numbers: the correlation of
the rows, and the distance in the metric of the noise of presses, as a multiple of the change that a
mean press makes. On a hydrogel skin (DSHardman/HydrogelEIT): own session .9999 at once and .996
after 400 presses of drying, where the error has grown from 1.2 to 2.1 mm; two other sessions .97
and .93, 9.5 mm, which an update mends; another skin of the same make 0. Places that were turned or
shifted do not change an untouched frame, and remain unseen.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.errors import FrameError, ProtocolError
from eitskin.model.model import Model
from eitskin.skin.protocol import Protocol
from eitskin.teaching.fit import whitening_of
from eitskin.teaching.known import known_of

FITS, UPDATE, TEACH_AGAIN = "fits", "update", "teach again"
FITS_ABOVE, UPDATE_ABOVE = 0.99, 0.85
FITS_BELOW = 0.5  # of a press: so little is noise and drift, whatever the correlation
UPDATE_FROM = 10.0  # presses: one row or electrode may be far off while the correlation is high


@dataclass(frozen=True)
class StillFits:
    """``verdict``; ``correlation`` of the rows; ``distance`` of the whole frame, in presses;
    ``rule`` says what decided."""

    verdict: str
    correlation: float
    distance: float
    rule: str


def still_fits(
    model: Model, untouched: npt.ArrayLike, protocol: Protocol, *, where: str = "model"
) -> StillFits:
    """Compare untouched frames (n, m) V with those that ``model`` was taught on; of several their
    median, so that a touch in a few does no harm.

    Raises:
        ModelError: the model was not taught.
        ProtocolError: it is of another protocol.
        FrameError: no frame is whole.
    """
    known = known_of(model, where)
    if model.protocol.hash != protocol.hash:
        raise ProtocolError(
            f"{where}: taught with another protocol than that of the frames; give the model of"
            " this skin"
        )
    frames = np.atleast_2d(np.asarray(untouched, dtype=np.float64))
    frames = frames[np.isfinite(frames).all(axis=1)]
    if not len(frames):
        raise FrameError(
            f"{where}: no frame has a number in every row; look at the electrodes with  eitskin"
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
        return FITS, f"nearer than {FITS_BELOW:g} of a press"
    if correlation < UPDATE_ABOVE:
        return TEACH_AGAIN, f"correlation below {UPDATE_ABOVE:g}"
    if correlation < FITS_ABOVE:
        return UPDATE, f"correlation below {FITS_ABOVE:g}"
    if distance > UPDATE_FROM:
        return UPDATE, f"further than {UPDATE_FROM:g} presses"
    return FITS, f"correlation from {FITS_ABOVE:g}, nearer than {UPDATE_FROM:g} presses"
