"""Which ports there are, and which boards answer on them."""

from dataclasses import asdict, dataclass
from typing import Any

from eitskin.device.open import list_devices, open_device
from eitskin.device.ports import Port
from eitskin.device.wire.packets import BoardInfo
from eitskin.errors import EitskinError


@dataclass(frozen=True)
class FoundPort:
    """A port; the ``board`` that answered on it, or ``why`` none did; neither where it was not
    asked."""

    port: Port
    board: BoardInfo | None = None
    why: str | None = None

    def as_dict(self) -> dict[str, Any]:
        board = None if self.board is None else self.board.as_dict()
        port = {
            "url": f"serial:{self.port.path}",
            **asdict(self.port),
            "is_board": self.port.is_board,
        }
        return port | {"board": board, "why": self.why}


def discover(*, ask: bool = True) -> list[FoundPort]:
    """All serial ports, boards first; where ``ask``, those that look like a board's are asked what
    they are."""
    return [_asked(port) if ask and port.is_board else FoundPort(port) for port in list_devices()]


def _asked(port: Port) -> FoundPort:
    try:
        with open_device(f"serial:{port.path}") as device:
            return FoundPort(port, device.board)
    except EitskinError as error:
        return FoundPort(port, why=str(error))
