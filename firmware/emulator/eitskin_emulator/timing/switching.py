"""The time from a burst's last sample until the multiplexers join the next row."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from eitskin.arrays import IntArray
from eitskin_emulator.analog.adg1206 import Switching
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_US


@dataclass
class SwitchTimes:
    """``after_us``: from the last sample of a burst to each switch. ``allowed_us``: in the
    firmware's usual slot of 100 us. The last of 80 samples is taken at 79.5 us, and a row counts as
    settled if the clock, read after the switch and rounded down, is more than 16 us before the
    next slot: 83.99 us are in time."""

    allowed_us: float = 4.5
    after_us: list[float] = field(default_factory=list)


@contextmanager
def watch_switching(board: EmulatedBoard) -> Iterator[SwitchTimes]:
    """Note each switch of ``board`` that follows a burst."""
    found = SwitchTimes()
    sample, switched = board.adc.sample, board.multiplexers.switched
    last = [0]

    def sampled(times: IntArray, channel: int) -> npt.NDArray[np.uint16]:
        last[0] = int(times[-1])
        return sample(times, channel)

    def joined(switching: Switching) -> None:
        switched(switching)  # takes the samples up to now
        if None not in switching.joined and last[0]:
            found.after_us.append((switching.at - last[0]) / TICKS_PER_US)
            last[0] = 0

    board.adc.sample, board.multiplexers.switched = sampled, joined
    try:
        yield found
    finally:
        board.adc.sample, board.multiplexers.switched = sample, switched
