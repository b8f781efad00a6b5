"""The time from contact to report: how long a user waits for a touch, with the solver on a board or
on a host.

    report = period / 2 + scan + solve and touches + link

A touch that lands during a scan is complete only in the next frame, which begins half a period
later on average. The period from frame to frame is the longer of scan and solve. The board sends
touches; to a host it sends rows.
"""

from eitskin.device.bandwidth import (
    BITS_A_BYTE,
    PACKET_BYTES,
    RAW_BYTES,
    ROW_BYTES,
    SOLVED_BYTES,
    TOUCHES_BYTES,
)
from eitskin.device.ports import BAUD

ROWS = 208  # rows in a RAW packet of 16 electrodes, even if a scan measures fewer
TWO_TOUCHES = TOUCHES_BYTES // 4


def report_us(scan_us: float, solve_us: float, board: str) -> float:
    """Return the mean time if a scan takes ``scan_us``, and solve and touches take ``solve_us``,
    both on average. ``board`` is "f767" or "host"."""
    size = RAW_BYTES + ROW_BYTES * ROWS if board == "host" else SOLVED_BYTES + TWO_TOUCHES
    link_us = 1e6 * (size + PACKET_BYTES) * BITS_A_BYTE / BAUD
    return max(scan_us, solve_us) / 2 + scan_us + solve_us + link_us
