"""A source of your own: frames of any instrument that Python can read, behind every command.

A package names it in its pyproject.toml:

    [project.entry-points."eitskin.sources"]
    breathing = "own_source:open_source"

After  pip install .  the device  breathing:RATE_HZ  can be used wherever a device is named:

    eitskin stream --device breathing:25

This one makes its frames up: the whole skin conducts better and worse, as a chest that breathes.
"""

import math
import time

from eitskin.device.source import GivenFrame, Source
from eitskin.errors import UsageError
from eitskin.model.model import Model


class Breathing(Source):
    """Frames at ``rate_hz``."""

    def __init__(self, rate_hz: float) -> None:
        self.name, self.period_s = "breathing", 1 / rate_hz
        self._next_s = time.monotonic()

    def use_model(self, model: Model) -> None:
        self._untouched_v = model.golden.reference_v

    def read(self, timeout_s: float) -> list[GivenFrame]:
        wait_s = self._next_s - time.monotonic()
        time.sleep(min(max(wait_s, 0.0), timeout_s))
        if wait_s > timeout_s:
            return []
        self._next_s += self.period_s
        breath = 1 + 1e-3 * math.sin(2 * math.pi * 0.2 * self._next_s)
        return [GivenFrame(self._untouched_v / breath)]


def open_source(rest: str) -> Breathing:
    """The source behind ``breathing:rest``."""
    try:
        rate_hz = float(rest)
    except ValueError:
        rate_hz = 0.0
    if not 0 < rate_hz <= 1000:
        raise UsageError(f"breathing:{rest}: write frames a second after the colon, as 25")
    return Breathing(rate_hz)
