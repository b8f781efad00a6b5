"""A ring of equal resistors between neighbouring electrodes: what each multiplexer sees of it.

With the drive between electrodes 15 and 0, the electrodes have 16 different voltages against
electrode 0. So a sweep of one multiplexer shows which electrode it really joins at each address. By
reciprocity the same holds for the multiplexers of the current. Exchanged address lines leave 15 and
0 if they are."""

from collections.abc import Sequence

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.bringup.measuring import Row

ELECTRODES = 16
MULTIPLEXERS = ("I+", "I-", "V+", "V-")
SHARE = 0.35  # of the step from one electrode to the next that a level may be off


def levels_ohm(resistor_ohm: float) -> FloatArray:
    """Voltage per ampere of each electrode against electrode 0, driven from 15 to 0."""
    return resistor_ohm * np.arange(ELECTRODES) / ELECTRODES


def sweep_rows(multiplexer: int) -> list[Row | None]:
    """The row of each address of a multiplexer; None if both of its pair would be the same."""
    rows: list[Row | None] = []
    for k in range(ELECTRODES):
        row = [15, 0, 15, 0]
        partner = multiplexer ^ 1
        row[multiplexer], row[partner] = k, 0
        rows.append(None if row[multiplexer] == row[partner] else (row[0], row[1], row[2], row[3]))
    return rows


def decode(levels: Sequence[float | None], step: float, expected: FloatArray) -> list[int | None]:
    """The electrode whose level each address shows; None: no level fits, or there is none (open,
    or both of the pair on one electrode)."""
    found: list[int | None] = []
    for level in levels:
        if level is None:
            found.append(0)
            continue
        k = int(np.abs(expected - level).argmin())
        found.append(k if k and abs(expected[k] - level) <= SHARE * step else None)
    return found


def explain(name: str, seen: Sequence[int | None]) -> str:
    """Return the mistake in the address lines of multiplexer ``name`` that gives this map; empty:
    none."""
    right = list(range(ELECTRODES))
    if list(seen) == right:
        return ""
    for low in range(4):
        for high in range(low + 1, 4):
            if _same(seen, [_exchanged(k, low, high) for k in right]):
                return f"A{low} and A{high} of {name} are exchanged"
        for level in (0, 1):
            if _same(seen, [k & ~(1 << low) | level << low for k in right]):
                state = "high" if level else "low"
                return f"A{low} of {name} is always {state}: its wire is open or shorted"
    if _same(seen, [ELECTRODES - 1 - k for k in right]):
        return f"{name} has its electrodes in reverse order"
    wrong = [k for k in right if seen[k] != k]
    if len(wrong) <= 4:
        listed = ", ".join(f"{k} shows {'nothing' if seen[k] is None else seen[k]}" for k in wrong)
        return f"electrodes of {name}: {listed}; look at their wires"
    if all(one is None for k, one in enumerate(seen) if k != 0):
        return f"{name} joins nothing: look at its EN and its supply"
    return f"{name} joins other electrodes than the selected ones: check its address lines"


def _exchanged(k: int, low: int, high: int) -> int:
    bits = k >> low & 1, k >> high & 1
    return k & ~(1 << low) & ~(1 << high) | bits[1] << low | bits[0] << high


def _same(seen: Sequence[int | None], wanted: Sequence[int]) -> bool:
    """Alike where something was seen: a pair that meets on one electrode shows nothing."""
    pairs = [(one, two) for k, (one, two) in enumerate(zip(seen, wanted, strict=True)) if k != 0]
    known = [(one, two) for one, two in pairs if one is not None]
    return len(known) >= len(pairs) // 2 and all(one == two for one, two in known)
