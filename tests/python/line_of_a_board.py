"""A simulated board behind a port that can fall silent, and be pulled out."""

import threading
import time
from functools import cache

from eitskin.device.bank import bank_bytes
from eitskin.device.simulated import SimBoard, SimTransport
from eitskin.device.transport import Transport
from eitskin.errors import DeviceError
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.description import Scene
from small_models import prebuilt


@cache
def untouched() -> BoardFrames:
    """Return the frames of an untouched skin."""
    return BoardFrames(Scene("untouched", frames=10, quiet_frames=8, elements=1500))


class Line(Transport):
    """A simulated board behind a port that can fall silent, and be pulled out."""

    url = name = "/dev/ttyFAKE"

    def __init__(self) -> None:
        self._inner = SimTransport(
            "behind a line", SimBoard(untouched(), [bank_bytes(prebuilt()[1], 1)] * 2)
        )
        self._one = threading.Lock()
        self.silent = self.gone = False

    def read(self, timeout_s: float) -> bytes:
        if self.gone:
            raise DeviceError(f"{self.name}: the port is gone (pulled out)")
        time.sleep(0.002)
        with self._one:
            # an answer, and a frame: a simulated board that answers does not scan meanwhile
            return b"" if self.silent else self._inner.read(0) + self._inner.read(0)

    def write(self, data: bytes) -> None:
        if self.gone:
            raise DeviceError(f"{self.name}: the port is gone (pulled out)")
        with self._one:
            if not self.silent:
                self._inner.write(data)

    def reopen(self) -> bool:
        return not self.gone

    def close(self) -> None:
        pass
