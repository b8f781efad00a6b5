"""The possible numberings of the electrodes, and what an untouched frame shows about them on a skin
without symmetry.

On a round skin with evenly spaced electrodes and a protocol that looks the same from every
electrode, an untouched frame is the same for every rotation and both directions. This check then
reports so, and only a touch decides (orientation.py).
"""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.doctor.case import Case, correlation
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding
from eitskin.frames.homogeneous import voltages_of
from eitskin.frames.orders import electrode_map, relabel

SAME_FRAME = 0.9995
CLEARLY = 0.5
LIKELY = 0.9
SHOWN = 3
ALL_ALIKE = (
    "where electrode 0 is, and in which direction the numbers run. On this symmetric skin, with"
    " this protocol, an untouched frame is the same for all numberings"
)


@dataclass(frozen=True)
class Numbering:
    """A numbering: source electrode 0 is electrode ``rotate``, and with ``mirror`` the numbers run
    the other way. ``fit`` is at most 1."""

    rotate: int
    mirror: bool
    fit: float

    @property
    def given(self) -> bool:
        """Return whether this is the numbering as given."""
        return not self.rotate and not self.mirror

    @property
    def option(self) -> str:
        """The options of ``eitskin import`` that produce it."""
        return " ".join(
            [f"--rotate {self.rotate}"] * bool(self.rotate) + ["--mirror"] * self.mirror
        )

    def __str__(self) -> str:
        return self.option or "as given"


def ranked(fit: FloatArray) -> list[Numbering]:
    """Return the numberings with the best first, from their ``fit`` (2, n) by mirror and rotation.
    Among equals the given one comes first."""
    found = [Numbering(k, bool(m), float(fit[m, k])) for m in range(2) for k in range(fit.shape[1])]
    return sorted(
        found, key=lambda numbering: (-round(numbering.fit, 9), numbering.mirror, numbering.rotate)
    )


def renumbered_frames(case: Case, transfer_ohm: FloatArray) -> FloatArray:
    """Return the voltages (2, n, m) per ampere for each numbering, mirrored or not and rotated."""
    n = case.n_electrodes
    maps = np.array(
        [[electrode_map(n, rotate, bool(mirror)) for rotate in range(n)] for mirror in range(2)]
    )
    return voltages_of(transfer_ohm, maps[..., case.rows])


def best_likeness(case: Case) -> float:
    """Return the greatest correlation of |reference| with |prediction| over all numberings."""
    return float(_likeness(case, renumbered_frames(case, case.transfer_ohm)).max())


def check_numbering(case: Case) -> tuple[Case, CheckOutcome]:
    """Check whether another numbering fits the untouched frame clearly better; the case is returned
    with its rows renumbered.

    Signs are ignored. Numberings that predict the same frame (correlation SAME_FRAME) cannot be
    distinguished.
    """
    frames = renumbered_frames(case, case.transfer_ohm)
    alike = np.array(
        [[correlation(np.abs(case.predicted), np.abs(frame)) for frame in side] for side in frames]
    )
    if (alike >= SAME_FRAME).all():
        return case, CheckOutcome(inconclusive=(ALL_ALIKE,))
    order = ranked(_likeness(case, frames))
    given, best = next(numbering for numbering in order if numbering.given), order[0]
    measured = {
        "numbering_by_quiet_frame": {"as given": round(given.fit, 4), str(best): round(best.fit, 4)}
    }
    distinct = alike[int(best.mirror), best.rotate] < SAME_FRAME
    if not distinct or best.fit < LIKELY or 1 - best.fit > CLEARLY * (1 - given.fit):
        like_given = [
            other for other in ranked(alike) if other.fit >= SAME_FRAME and not other.given
        ]
        text = (
            f"whether {' or '.join(map(str, like_given[:SHOWN]))}: the untouched frame is the same"
        )
        return case, CheckOutcome(inconclusive=(text,) if like_given else (), measured=measured)
    text = (
        f"the untouched frame fits the skin's shape when the electrodes are renumbered ({best}),"
        " not as they are"
    )
    rows = relabel(case.rows, electrode_map(case.n_electrodes, best.rotate, best.mirror))
    finding = Finding("numbering", FAULT, text, measured["numbering_by_quiet_frame"], best.option)
    return replace(case, rows=rows), CheckOutcome((finding,), measured=measured)


def _likeness(case: Case, frames: FloatArray) -> FloatArray:
    measured = np.abs(case.reference[case.trusted])
    return np.array(
        [[correlation(measured, np.abs(frame[case.trusted])) for frame in side] for side in frames]
    )
