"""The sources of lines: a serial port, a file, standard input, a FIFO, a TCP connection."""

import errno
import os
import queue
import socket
import stat
import sys
import threading
from contextlib import suppress
from pathlib import Path

from eitskin.device.ports import SerialTransport
from eitskin.errors import DeviceError, FileError, UsageError

CHUNK = 1 << 16
CONNECT_S = 5.0
TCP = "socket://"


class LinePort:
    """Bytes of an instrument. ``waits``: they come when the instrument sends, not when they are
    read. ``keeps``: what is not read yet waits. ``cut``: the first line may be the end of one.
    ``ended``: nothing will come again. DeviceError: the port is gone."""

    name: str
    waits, keeps, cut, ended = True, False, False, False

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that come within ``timeout_s``."""
        raise NotImplementedError

    def send(self, data: bytes) -> None:
        """Send ``data`` to the instrument; UsageError where it takes nothing."""
        raise UsageError(f"{self.name}: takes no bytes; leave  send  out of the layout")

    def reopen(self) -> bool:
        """Try once to open it again."""
        return False

    def close(self) -> None:
        """Close the port."""


class SerialLines(LinePort):
    """A serial port."""

    cut = True

    def __init__(self, path: str, baud: int) -> None:
        self._port = SerialTransport(path, baud)
        self.name = self._port.name

    def read(self, timeout_s: float) -> bytes:
        return self._port.read(timeout_s)

    def send(self, data: bytes) -> None:
        self._port.write(data)

    def reopen(self) -> bool:
        found = self._port.reopen()
        self.name = self._port.name  # it may have come back under another
        return found

    def close(self) -> None:
        self._port.close()


class FileLines(LinePort):
    """A file: its lines come as fast as they are read."""

    waits, keeps = False, True

    def __init__(self, path: str) -> None:
        self.name = path
        try:
            self._file = Path(path).open("rb")  # noqa: SIM115
        except OSError as error:
            raise FileError(f"{path}: cannot read it ({error.strerror}); check the path") from None

    def read(self, timeout_s: float) -> bytes:
        try:
            data = self._file.read(CHUNK)
        except OSError as error:
            raise FileError(f"{self.name}: cannot read it ({error.strerror})") from None
        self.ended = not data
        return data

    def send(self, data: bytes) -> None:
        """A file takes nothing."""

    def close(self) -> None:
        self._file.close()


class PipeLines(LinePort):
    """Standard input ("-") or a FIFO. A FIFO that nobody writes to yet is waited for. A thread
    reads, since only sockets can be waited for on every system."""

    keeps = True

    def __init__(self, path: str) -> None:
        self.name = "standard input" if path == "-" else path
        self._fd: int | None = None
        try:
            if path == "-":
                self._fd = os.dup(sys.stdin.fileno())
            elif not os.access(path, os.R_OK):
                raise PermissionError(errno.EACCES, "Permission denied")
        except (AttributeError, OSError, ValueError) as error:  # there may be no standard input
            raise DeviceError(f"{self.name}: cannot read it ({error})") from None
        self._read: queue.Queue[bytes | OSError] = queue.Queue(maxsize=1)
        self._closed = threading.Event()
        threading.Thread(target=self._forward, args=(path,), daemon=True).start()

    def _forward(self, path: str) -> None:
        """Read until the end, which is empty, or until it is closed."""
        try:
            fd = os.open(path, os.O_RDONLY) if self._fd is None else self._fd
            try:
                data = b" "
                while data and not self._closed.is_set():
                    data = os.read(fd, CHUNK)
                    self._put(data)
            finally:
                os.close(fd)
        except OSError as error:
            self._put(error)

    def _put(self, item: bytes | OSError) -> None:
        while not self._closed.is_set():
            with suppress(queue.Full):
                self._read.put(item, timeout=0.2)
                return

    def read(self, timeout_s: float) -> bytes:
        if self.ended:
            return b""
        try:
            item = self._read.get(timeout=max(timeout_s, 1e-3))
        except queue.Empty:
            return b""
        if isinstance(item, OSError):
            self.ended = True
            raise DeviceError(f"{self.name}: is gone ({item})")
        self.ended = not item
        return item

    def close(self) -> None:
        self._closed.set()


class SocketLines(LinePort):
    """A TCP connection, "socket://host:port"."""

    def __init__(self, url: str) -> None:
        host, colon, port = url.removeprefix(TCP).rpartition(":")
        if not colon or not host or not port.isdigit() or not 0 < int(port) < 65536:
            raise UsageError(f"{url}: write  {TCP}HOST:PORT")
        self.name, self._address = url, (host.strip("[]"), int(port))
        self._socket = self._connected()

    def _connected(self) -> socket.socket:
        try:
            return socket.create_connection(self._address, CONNECT_S)
        except OSError as error:
            raise DeviceError(
                f"{self.name}: no connection ({error.strerror or error}); check host, port and"
                " whether the instrument listens"
            ) from None

    def read(self, timeout_s: float) -> bytes:
        try:
            self._socket.settimeout(max(timeout_s, 1e-3))
            data = self._socket.recv(CHUNK)
        except TimeoutError:
            return b""
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EINTR):
                return b""
            raise DeviceError(f"{self.name}: the connection is gone ({error})") from None
        if not data:
            raise DeviceError(f"{self.name}: the other side closed the connection")
        return data

    def send(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise DeviceError(f"{self.name}: takes no bytes ({error})") from None

    def reopen(self) -> bool:
        with suppress(DeviceError):
            self.close()
            self._socket = self._connected()
            return True
        return False

    def close(self) -> None:
        self._socket.close()


def open_port(path: str, baud: int) -> LinePort:
    if path.startswith(TCP):
        return SocketLines(path)
    if path == "-":
        return PipeLines(path)
    with suppress(OSError):
        mode = Path(path).stat().st_mode
        if stat.S_ISFIFO(mode):
            return PipeLines(path)
        if stat.S_ISREG(mode):
            return FileLines(path)
    return SerialLines(path, baud)
