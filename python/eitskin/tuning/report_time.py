"""From contact to report: what a user waits for a touch, on a board or with its rows on a host.

    report = period / 2 + scan + solve and touches + link

A touch that lands while a scan runs is in whole in the next frame only, which begins half a period
later on average; the period from frame to frame is the longer of scan and solve. The board sends
touches; a host is sent rows.
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

ROWS = 208  # of a RAW of 16 electrodes, whichever of them a scan measures
TWO_TOUCHES = TOUCHES_BYTES // 4


def report_us(scan_us: float, solve_us: float, board: str) -> float:
    """The mean time where a scan takes ``scan_us``, solve and touches ``solve_us``, both on
    average. ``board``: "f767", or "host"."""
    size = RAW_BYTES + ROW_BYTES * ROWS if board == "host" else SOLVED_BYTES + TWO_TOUCHES
    link_us = 1e6 * (size + PACKET_BYTES) * BITS_A_BYTE / BAUD
    return max(scan_us, solve_us) / 2 + scan_us + solve_us + link_us
