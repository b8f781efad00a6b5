"""Exchanged wires: find the renaming of electrodes that makes the reference look like a homogeneous
frame.

Exchanges of two electrodes are tried by the misfit of magnitudes, and the best one is kept,
repeatedly. The result is accepted only if its misfit is small, at most half of the initial one, and
less than that of any short circuit. Three electrodes in a ring (each in the place of the next) may
be too far from the start for this search.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from eitskin.frames.doctor.case import Case
from eitskin.frames.doctor.misfit import best_joined, misfit, misfits
from eitskin.frames.doctor.numbering import best_likeness
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding
from eitskin.frames.homogeneous import voltages_of
from eitskin.frames.orders import relabel, swap_map, touching

WORTH_TRYING = 0.05
STEP = 0.97
GOOD = 0.2
BETTER_TIMES = 2.0
MAX_SWAPS = 6


@dataclass(frozen=True)
class ElectrodeSwap:
    """``pairs`` of electrodes exchanged one after the other, with the misfit ``before`` and
    ``after``."""

    pairs: tuple[tuple[int, int], ...]
    before: float
    after: float

    @property
    def convincing(self) -> bool:
        """Return whether the exchange explains the frame."""
        return bool(self.pairs) and self.after <= GOOD and self.after * BETTER_TIMES <= self.before


def best_exchange(case: Case) -> ElectrodeSwap:
    """Find the exchange for ``case`` by greedy search; signs are ignored."""

    n, use = case.n_electrodes, case.trusted
    tried = np.array(list(combinations(sorted(set(case.rows.ravel().tolist())), 2)))
    exchanged = np.array([swap_map(n, [pair]) for pair in tried])
    rows = case.rows
    pairs: list[tuple[int, int]] = []
    before = best = misfit(case, use, True)
    while best > WORTH_TRYING and len(pairs) < MAX_SWAPS:
        left = misfits(
            case.reference, voltages_of(case.transfer_ohm, exchanged[:, rows]), use, True
        )
        k = int(np.argmin(left))
        if left[k] > STEP * best:
            break
        best, rows = float(left[k]), exchanged[k][rows]
        pairs.append((int(tried[k, 0]), int(tried[k, 1])))
    return ElectrodeSwap(tuple(pairs), before, best)


def check_swaps(case: Case) -> tuple[Case, CheckOutcome]:
    """Report exchanged electrodes; the case is returned with its rows renamed."""
    exchange = best_exchange(case)
    if not exchange.convincing or best_joined(case, magnitude=True).misfit < exchange.after:
        return case, CheckOutcome()
    named = " and then ".join(f"{i} and {j}" for i, j in exchange.pairs)
    finding = Finding(
        "swapped-electrodes",
        FAULT,
        f"the wires of electrodes {named} (from 0) are exchanged",
        {
            "pairs": [list(pair) for pair in exchange.pairs],
            "misfit": round(exchange.after, 4),
            "misfit_without": round(exchange.before, 4),
        },
        " ".join(f"--swap {i},{j}" for i, j in exchange.pairs),
    )
    return renamed(case, exchange), CheckOutcome((finding,))


def renamed(case: Case, exchange: ElectrodeSwap) -> Case:
    """Return the case with its rows renamed by ``exchange``."""
    return replace(case, rows=relabel(case.rows, swap_map(case.n_electrodes, exchange.pairs)))


def likeness(case: Case, *, allow_fault: bool) -> float:
    """Return the correlation of |reference| with |prediction| in the best numbering.

    With ``allow_fault`` it is the best correlation after a convincing exchange is undone, or
    without any one electrode.
    """
    if not allow_fault:
        return best_likeness(case)
    exchange = best_exchange(case)
    if exchange.convincing:
        return best_likeness(renamed(case, exchange))
    used = set(case.rows.ravel().tolist())
    return max(
        best_likeness(replace(case, trusted=case.trusted & ~touching(case.rows, [e]))) for e in used
    )
