"""The repairs of import: change signs, fill rows from reciprocals, leave rows out, equalise
gains."""

from collections.abc import Iterable, Sequence

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.errors import FrameError, UsageError
from eitskin.frames.orders import touching
from eitskin.skin.protocol import table

SIGNS = ("signed", "reversed", "magnitude")
MIN_GAIN = 0.05


def signed(values: FloatArray, sign: str, prediction: FloatArray | None) -> FloatArray:
    """Return ``values`` (n, m) unchanged, negated, or their magnitudes with the signs of
    ``prediction`` (m,)."""
    if sign not in SIGNS:
        raise UsageError(f"--sign {sign}: use one of {', '.join(SIGNS)}")
    if sign == "magnitude" and prediction is not None:
        return np.asarray(np.abs(values) * np.where(prediction < 0, -1.0, 1.0))
    return -values if sign == "reversed" else values


def flipped(values: FloatArray, flip: Sequence[int]) -> FloatArray:
    """Return ``values`` (n, m) with the sign of the rows ``flip`` changed."""
    check_range(flip, values.shape[1], "--flip-channels")
    sign = np.ones(values.shape[1])
    sign[list(flip)] = -1.0
    return values * sign


def partners(rows: IntArray, n_electrodes: int) -> dict[int, tuple[int, int]]:
    """Return for each row that has a reciprocal in ``rows`` (m, 4) that reciprocal and the sign
    between them."""
    pairs = table(n_electrodes, rows).reciprocal_pairs()
    partner: dict[int, tuple[int, int]] = {}
    for first, second, sign in zip(
        pairs.first.tolist(), pairs.second.tolist(), pairs.sign.tolist(), strict=True
    ):
        if second >= 0:
            partner |= {first: (second, sign), second: (first, sign)}
    return partner


def kept_rows(
    rows: IntArray, n_electrodes: int, drop_channels: Sequence[int], drop_electrodes: Sequence[int]
) -> BoolArray:
    """Return which rows (m,) remain when ``drop_channels`` and all rows that use
    ``drop_electrodes`` are left out."""
    check_range(drop_electrodes, n_electrodes, "--drop-electrodes")
    check_range(drop_channels, len(rows), "--drop-channels")
    keep = ~touching(rows, drop_electrodes)
    keep[list(drop_channels)] = False
    if not keep.any():
        raise UsageError("nothing is left after leaving out these rows and electrodes")
    return np.asarray(keep)


def imputed(
    values: FloatArray, rows: IntArray, n_electrodes: int, fill: Sequence[int]
) -> FloatArray:
    """Return ``values`` (n, m) with the rows ``fill`` replaced by their reciprocals among ``rows``
    (m, 4)."""
    check_range(fill, len(rows), "--impute-channels")
    filled = values.copy()
    for row, (other, sign) in good_reciprocals(fill, rows, n_electrodes).items():
        filled[:, row] = sign * values[:, other]
    return filled


def good_reciprocals(
    fill: Sequence[int], rows: IntArray, n_electrodes: int
) -> dict[int, tuple[int, int]]:
    """Return for each of the rows ``fill`` the reciprocal that fills it, which must not be one of
    them, and the sign."""
    partner = partners(rows, n_electrodes) if fill else {}
    for row in fill:
        if row not in partner or partner[row][0] in fill:
            raise UsageError(
                f"--impute-channels {row}: {rows[row].tolist()} has no good reciprocal; use"
                " --drop-channels"
            )
    return {row: partner[row] for row in fill}


def equalising_gains(reference: FloatArray, prediction: FloatArray) -> FloatArray:
    """Return gains (m,) with median 1 that make ``reference`` (m,) a multiple of ``prediction``
    (m,).

    Raises:
        FrameError: a row is so weak that its gain would only raise noise.
    """
    ratio = reference / prediction
    relative = ratio / np.median(ratio)
    weak = np.flatnonzero(~(relative > MIN_GAIN))
    if len(weak):
        raise FrameError(
            f"row {weak[0]} has {relative[weak[0]]:.3g} of its predicted reference ({len(weak)}"
            " such): equalising would only raise noise; leave such rows out first"
            " (--drop-channels, --drop-electrodes)"
        )
    return np.asarray(1 / relative)


def check_range(numbers: Iterable[int], count: int, option: str) -> None:
    """Raise a UsageError unless all ``numbers`` are 0 to ``count`` - 1."""
    for number in numbers:
        if not 0 <= number < count:
            raise UsageError(f"{option} {number}: out of range; there are 0 to {count - 1}")
