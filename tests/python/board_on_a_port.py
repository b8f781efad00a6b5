"""A simulated board behind a pseudo-terminal, as behind a serial port."""

import os
import pty
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from eitskin.device.simulated import SimBoard, SimTransport


class Wire:
    """A simulated board at the far end of a pseudo-terminal, kept going by a thread. ``path`` is
    the near end."""

    def __init__(self, board: SimBoard | None, *, frame_s: float = 0.0) -> None:
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        tty.setraw(self.master)
        self.path = os.ttyname(slave)
        self._slave: int | None = slave
        self._board, self._frame_s = board, frame_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        if board is not None:
            self._thread.start()

    def _run(self) -> None:
        assert self._board is not None
        os.set_blocking(self.master, False)
        transport = SimTransport("wire", self._board)
        while not self._stop.is_set():
            try:
                transport.write(os.read(self.master, 4096))
            except BlockingIOError:
                pass
            except OSError:
                return
            # an answer, and a frame: a simulated board that answers does not scan meanwhile
            data = transport.read(0.0) + transport.read(0.0)
            while data and not self._stop.is_set():
                try:
                    data = data[os.write(self.master, data) :]
                except BlockingIOError:
                    time.sleep(0.001)
                except OSError:
                    return
            time.sleep(self._frame_s or 0.001)

    def unplug(self) -> None:
        """Unplug the board: open files get errors, and the path disappears."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(5)
        if self._slave is not None:
            os.close(self._slave)
            self._slave = None
            os.close(self.master)


@contextmanager
def behind_a_port(board: SimBoard) -> Iterator[str]:
    """The path of a port with ``board`` on its other side."""
    wire = Wire(board)
    try:
        yield wire.path
    finally:
        wire.unplug()
