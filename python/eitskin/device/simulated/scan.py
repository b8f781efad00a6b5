"""How a simulated board scans: one frame of the skin, as RAW tells it."""

from __future__ import annotations

import numpy as np

from eitskin.device.simulated.checks import slot_us
from eitskin.device.simulated.skin import SceneSkin
from eitskin.device.simulated.solve import SimSolver
from eitskin.device.wire.commands import Scan
from eitskin.device.wire.packets import Quality, RawFlags, RawFrame


def rows_us(solver: SimSolver, scan: Scan, *, full: bool) -> int:
    """How long all rows take, or one of each reciprocal pair."""
    rows = solver.model.protocol.n_rows if full else len(solver.model.fold.first)
    return rows * slot_us(scan)


def scan_frame(
    skin: SceneSkin, solver: SimSolver, scan: Scan, frame: int, time_us: int
) -> tuple[RawFrame, int]:
    """Frame number ``frame``, whose scan begins at ``time_us``, and how long until the next one's.

    Raises:
        EitskinError: the scene cannot be simulated.
    """
    every, model = scan.check_every, solver.model
    full = every != 0 and frame % every == 0
    flags = RawFlags(0) if every == 1 else RawFlags.CHECK if full else RawFlags.RECIPROCAL
    volts, quality = (
        skin.frame(model.protocol, time_us),
        np.zeros(model.protocol.n_rows, dtype=np.uint8),
    )
    if every != 1:
        pairs = model.fold.second >= 0
        first, second = model.fold.first[pairs], model.fold.second[pairs]
        volts[second] = model.fold.sign[pairs].astype(np.float32) * volts[first]
        quality[second] |= np.uint8(Quality.COPIED)
    quality[solver.masked] |= np.uint8(Quality.MASKED)
    volts[solver.masked] = np.nan
    burst_us = -(-scan.samples * 1_000_000 // scan.sample_rate_hz)
    spent_us = rows_us(solver, scan, full=full)
    raw = RawFrame(
        frame, time_us % 2**32, spent_us - slot_us(scan) + burst_us, int(flags), volts, quality
    )
    return raw, max(scan.frame_period_us, spent_us)
