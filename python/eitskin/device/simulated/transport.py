"""``sim:SCENE``: a simulated board that speaks the very bytes of the link, over the host core.
Deterministic; no thread."""

from __future__ import annotations

from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.device.simulated.board import SimBoard
from eitskin.device.simulated.skin import SceneSkin


class SimTransport:
    """The bytes of a ``SimBoard``. It scans a frame each time that it is read and has nothing else
    to say."""

    synchronous = True
    replays = False

    def __init__(self, name: str, board: SimBoard) -> None:
        self.url = self.name = f"sim:{name}"
        self.board = board

    @property
    def ended(self) -> bool:
        """The scene is over."""
        return self.board.skin.ended(self.board.time_us)

    def read(self, timeout_s: float) -> bytes:
        """What the board sends; empty where it has nothing to do, or the scene is over."""
        output = self.board.take_output()
        while not output and not self.ended and self.board.scan_one():
            output = self.board.take_output()
        return output

    def write(self, data: bytes) -> None:
        self.board.receive(data)

    def reopen(self) -> bool:
        return True

    def begin_scene(self) -> None:
        self.board.skin.begin(self.board.time_us)

    def close(self) -> None:
        """Nothing is held."""


def open_simulated(scene: str, *, model: bytes | None = None) -> SimTransport:
    """A simulated board before ``scene`` (a file or a library scene), with ``model`` in its first
    bank (or the prebuilt one).

    Raises:
        FileError, ConfigError, GeometryError, ProtocolError: the scene cannot be read.
        DeviceError: the model does not fit a bank.
    """
    from eitskin.device.open import find_device_scene
    from eitskin.model.prebuilt import load_prebuilt

    skin = SceneSkin(find_device_scene(scene))
    blob = load_prebuilt()[1] if model is None else model
    empty = bytes([ERASED]) * BANK_BYTES
    return SimTransport(scene, SimBoard(skin, [bank_bytes(blob, 1), empty]))
