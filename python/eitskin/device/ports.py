"""Serial ports: a list of them, the recognition of boards, and a transport over one."""

import contextlib
import errno
import threading
from dataclasses import dataclass
from typing import Any

from eitskin.device.transport import Capabilities, Transport
from eitskin.errors import DeviceError

BAUD = 1_000_000  # of the ST-LINK's virtual port, as the firmware sets its USART
ST_VENDOR = 0x0483
ST_LINKS = frozenset(
    (0x374A, 0x374B, 0x3752, 0x374D, 0x374E, 0x374F, 0x3753, 0x3754, 0x3755, 0x3757)
)  # with a virtual port
WRITE_S = 1.0
ALLOW = (
    """run  echo 'SUBSYSTEM=="tty", ATTRS{idVendor}=="0483", MODE="0660", TAG+="uaccess"'"""
    " | sudo tee "
    "/etc/udev/rules.d/70-eitskin.rules && sudo udevadm control --reload && sudo udevadm trigger  "
    "or  sudo usermod -aG dialout $USER  and log in again"
)


@dataclass(frozen=True)
class Port:
    """A serial port. ``vendor`` and ``product`` are its USB numbers, None if it is not on USB."""

    path: str
    description: str = ""
    vendor: int | None = None
    product: int | None = None
    serial_number: str | None = None

    @property
    def is_board(self) -> bool:
        """Return whether it is an ST-LINK's, as on every NUCLEO."""
        return self.vendor == ST_VENDOR and self.product in ST_LINKS


def ports() -> list[Port]:
    """All serial ports of this computer, by path."""
    from serial.tools import list_ports

    found = (
        Port(p.device, p.description or "", p.vid, p.pid, p.serial_number)
        for p in list_ports.comports()
    )
    return sorted(found, key=lambda port: port.path)


def listing(found: list[Port]) -> str:
    """The ports in one line."""
    shown = (
        f"{port.path} ({port.description})" if port.description else port.path for port in found
    )
    return ", ".join(shown) or "none"


def only_board() -> Port:
    """The one port that is a board's."""
    found = ports()
    boards = [port for port in found if port.is_board]
    if len(boards) == 1:
        return boards[0]
    if not boards:
        raise DeviceError(
            f"auto: no ST-LINK port is there (serial ports: {listing(found)}); plug the board in,"
            " name the port with  --device serial:PORT  or play with  --device sim:two_touch"
        )
    raise DeviceError(
        f"auto: several boards are there ({listing(boards)}); name one with  --device serial:PORT"
    )


class SerialTransport(Transport):
    """A serial port, open for this program alone. ``baud`` as the firmware's.

    Raises:
        DeviceError: it is not there, is busy, may not be opened, or is no serial port.
    """

    def __init__(self, path: str, baud: int = BAUD) -> None:
        self.url = f"serial:{path}" + (f"?baud={baud}" if baud != BAUD else "")
        self.name, self.baud = path, baud
        self._serial_number = next(
            (port.serial_number for port in ports() if port.path == path), None
        )
        self._capabilities = Capabilities(baud=baud)
        self._lock = threading.Lock()
        self._closed = False
        self._port = open_port(path, baud)

    @property
    def capabilities(self) -> Capabilities:
        return self._capabilities

    def read(self, timeout_s: float) -> bytes:
        port = self._port
        try:
            if port.timeout != timeout_s:
                port.timeout = timeout_s
            first = port.read(1)
            return bytes(first + port.read(port.in_waiting)) if first else b""
        except (OSError, TypeError, ValueError) as error:
            # pyserial's own is an OSError; a port just closed gives the others
            raise DeviceError(f"{self.name}: the port is gone ({_reason(error)})") from None

    def write(self, data: bytes) -> None:
        from serial import SerialTimeoutException

        try:
            self._port.write(data)
        except SerialTimeoutException:
            raise DeviceError(
                f"{self.name}: takes no bytes; reset the board or plug it in again"
            ) from None
        except (OSError, TypeError, ValueError) as error:
            raise DeviceError(f"{self.name}: the port is gone ({_reason(error)})") from None

    def reopen(self) -> bool:
        """The port with the same USB serial number, whatever its path now is; without a number, the
        same path.

        Raises:
            DeviceError: it is there, but may not be opened.
        """
        with self._lock:
            if self._closed:
                return False
            _close(self._port)
            path = self.name
            if self._serial_number is not None:
                path = next(
                    (port.path for port in ports() if port.serial_number == self._serial_number), ""
                )
            if not path:
                return False
            try:
                self._port = open_port(path, self.baud)
            except _NotNow:
                return False
            self.name = path
            return True

    def close(self) -> None:
        with self._lock:
            self._closed = True
            _close(self._port)


class _NotNow(DeviceError):
    """The port is not there, or not yet to be used; it may be a moment later."""


def open_port(path: str, baud: int) -> Any:
    import serial

    try:
        return serial.Serial(path, baud, timeout=0.1, write_timeout=WRITE_S, exclusive=True)
    except (OSError, ValueError, OverflowError) as error:
        code = getattr(error, "errno", None)
        if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
            raise _NotNow(f"{path}: no such port; there are: {listing(ports())}") from None
        if code in (errno.EACCES, errno.EPERM):
            raise DeviceError(f"{path}: no permission to open it; {ALLOW}") from None
        if code in (errno.EBUSY, errno.EAGAIN):
            raise _NotNow(
                f"{path}: another program uses it; close that (find it with  fuser {path} )"
            ) from None
        if code not in (errno.ENOTTY, errno.EINVAL, errno.EISDIR, None):
            raise _NotNow(f"{path}: cannot open it ({_reason(error)})") from None
        reason = _reason(error)
    except Exception as error:  # termios.error, which is not an OSError
        reason = _reason(error)
    raise DeviceError(
        f"{path}: no serial port that does {baud} baud ({reason}); see  eitskin devices"
    )


def _close(port: Any) -> None:
    with contextlib.suppress(OSError):
        port.close()


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
