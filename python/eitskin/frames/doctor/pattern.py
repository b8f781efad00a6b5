"""The pattern of the rows: whether another pattern with as many rows explains the untouched frame
where the stated one does not.

On 16 electrodes adjacent and every skip pattern have 208 rows, so the number of channels does not
tell them apart.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from eitskin.frames.doctor.case import Case
from eitskin.frames.doctor.numbering import best_likeness
from eitskin.frames.doctor.order import LIKELY, OrderChoice
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding
from eitskin.frames.orders import source_table
from eitskin.skin.protocol import Protocol, pattern_name, patterns_of_length

SHOWN = 3
CLOSER = 4.0
NEAR_ENOUGH = 0.99  # above this correlation no other pattern is tried


def check_pattern(case: Case, chosen: OrderChoice) -> CheckOutcome:
    """Report another pattern than the stated one.

    A pattern is reported if its correlation with the homogeneous frame is at least LIKELY, and 1
    minus it at most a CLOSER-th of that of the stated pattern in its best order. If the stated one
    explains the frame in no order, an exchange of wires or a dead electrode is allowed for it.
    """
    if chosen.likeness >= NEAR_ENOUGH:
        return CheckOutcome()
    own, reached = case.frames.protocol, {}
    for made, order in _candidates(own):
        rows = source_table(order, made)
        name = pattern_name(made) + ("" if order == "fixed" else f", {order}")
        reached[name] = (best_likeness(replace(case, rows=rows)), made, order)
    ranked = sorted(reached.items(), key=lambda item: -round(item[1][0], 6))[:SHOWN]
    if not ranked or ranked[0][1][0] < max(LIKELY, 1 - (1 - chosen.likeness) / CLOSER):
        return CheckOutcome()
    best, (_, made, order) = ranked[0]
    drive, _, measure = pattern_name(made).partition("/")
    remedy = f"--protocol {drive}" + (f" --measure {measure}" if measure else "")
    finding = Finding(
        "pattern",
        FAULT,
        f"by correlation with the homogeneous frame the channels are those of {best}, not of"
        f" {pattern_name(own)}",
        {"correlation": {name: round(value[0], 4) for name, value in ranked}},
        remedy + ("" if order == "fixed" else f" --order {order}"),
    )
    return CheckOutcome((finding,))


def _candidates(own: Protocol) -> Iterator[tuple[Protocol, str]]:
    """Yield the patterns with as many rows as ``own``, without itself, each in both orders."""
    for made in patterns_of_length(own.n_electrodes, own.n_rows):
        if made.hash == own.hash:
            continue
        yield made, "fixed"
        if not np.array_equal(source_table("rotating", made), made.drive_measure):
            yield made, "rotating"
