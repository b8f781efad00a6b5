"""Correct the places of touches for misplaced electrodes, which the reference shows:
docs/reference/eitm-format.md, "MOVE" and "ROWE"."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.constants_table import ERRORS_FROM, MAX_SHIFT, ROW_SPREAD
from eitskin.model.model import Model


def corrected(model: Model, log_gain: FloatArray, place_mm: FloatArray) -> FloatArray:
    """Return the corrected place (2,), mm, of a touch that is found at ``place_mm`` (2,).
    ``log_gain`` (k,) is the logarithm of v_ref over the scaled reference, NaN without one."""
    assert model.model_errors is not None
    told, grid = model.model_errors.places, model.grid
    if told is None:
        return place_mm
    y = -np.nan_to_num(log_gain)
    # no skin of this kind has a part of y in the rows of B; an instrument's own gains do
    rest = told.rest.astype(float) @ y
    scale = max(1, len(rest)) * ROW_SPREAD**2
    trust = 1 / (1 + float(rest @ rest) / scale) ** 2
    half = np.array([grid.nx, grid.ny]) * grid.pixel_mm / 2
    u, v = (place_mm - np.asarray(grid.origin_mm) - half) / half.max()
    seen, moves = told.seen, told.moves
    rows = model.model_errors.rows
    if rows is not None:  # touches are fitted jointly, in one of two metrics
        distance = np.sqrt(np.nanmean(log_gain**2))
        seen, moves = rows.seen, rows.moves[int(distance > ERRORS_FROM * rows.distance)]
    count = moves.shape[1]
    terms = [u ** (n - j) * v**j for n in range(count) for j in range(n + 1)][:count]
    off = moves.astype(float) @ (seen.astype(float) @ y) @ np.array(terms)
    reach = MAX_SHIFT * grid.pixel_mm
    return np.asarray(place_mm - np.clip(trust * off, -reach, reach))
