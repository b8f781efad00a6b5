"""``emu:SCENE``: the bytes of the unmodified firmware on an emulated board. Deterministic; no
thread; time is the board's."""

import time
from collections.abc import Callable
from pathlib import Path

from eitskin.device.bank import bank_bytes
from eitskin.device.simulated import check_prebuilt_fits
from eitskin.device.transport import Capabilities, SimulatedScene, Transport
from eitskin.errors import DeviceError
from eitskin.model.eitm import decode_model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.library_scenes import find_scene
from eitskin_emulator.analog.fixture import Fixture, chain, ring
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_S, TICKS_PER_US
from eitskin_emulator.image import image_bytes
from eitskin_emulator.scene_skin import skin_of
from eitskin_emulator.serial_line import BAUD

CLOCK_TIMER, TIMER_COUNT = 5, 0x24  # the firmware's microsecond clock
GATHER_TICKS = 200 * TICKS_PER_US  # bytes that follow within this time are read together
START_TICKS = (
    TICKS_PER_S  # that a board may take until it speaks: a command that comes earlier is lost
)
# of one read: an emulated second takes some five, and an image that hangs must not hang its user
MAX_WALL_S = 120.0


class EmulatedTransport(Transport):
    """The host's end of the emulated board's serial line. ``board`` can be inspected and disturbed.
    With ``loop`` the scene begins again at its end; otherwise its last frame stays, and the board
    continues."""

    def __init__(self, name: str, board: EmulatedBoard, *, loop: bool = False) -> None:
        self.url = self.name = f"emu:{name}"
        self.board, self._loop = board, loop
        self._capabilities = Capabilities(
            own_clock=True, slow=True, baud=BAUD, scene=SimulatedScene(name, held=True, loop=loop)
        )
        self._progress: Callable[[float], None] | None = None
        self._reported = time.monotonic()
        self._closed = False

    @property
    def capabilities(self) -> Capabilities:
        return self._capabilities

    @property
    def board_s(self) -> float:
        """The board's time."""
        return self.board.now_s

    def read(self, timeout_s: float) -> bytes:
        """Let the board run until bytes have come, or ``timeout_s`` of its time has passed.

        Raises:
            DeviceError: it is closed, the processor has locked up, or the emulation takes minutes.
        """
        board, line = self.board, self.board.line
        self._check_open()
        until = board.clock.now + max(round(timeout_s * TICKS_PER_S), 1)
        give_up = time.monotonic() + MAX_WALL_S

        if self._loop and board.skin.over(board.clock.now):
            board.skin.begin_again()

        def enough() -> bool:
            now = time.monotonic()
            if self._progress is not None and now > self._reported + 1.0:
                self._reported = now
                self._progress(board.clock.now / TICKS_PER_S)
            if now > give_up:
                raise DeviceError(
                    f"{self.name}: the emulated board said nothing in {MAX_WALL_S:.0f} s; its"
                    " firmware hangs, or this computer is too slow for it"
                )
            return line.up_next_end() <= board.clock.now

        board.run_until(until, enough)
        if line.up_next_end() <= board.clock.now:
            board.run_until(min(board.clock.now + GATHER_TICKS, until))
        return board.receive()

    def write(self, data: bytes) -> None:
        """Send ``data``: it reaches the board at 1 Mbaud from now on.

        Raises:
            DeviceError: it is closed.
        """
        self._check_open()
        self.board.send(data)

    def reopen(self) -> bool:
        return not self._closed

    def connect(self, fixture: str) -> bool:
        """Put a fixture of the bring-up on the electrodes."""
        fixtures = {"nothing": Fixture({}), "chain": chain(), "ring": ring(), "skin": None}
        self.board.front_end.fixture = fixtures[fixture]
        return True

    def begin_scene(self) -> int:
        """Let the scene's time 0 be now, by the board's microsecond clock."""
        self.board.skin.begin(self.board.clock.now)
        return int(self.board.timers[CLOCK_TIMER].read(TIMER_COUNT, 4))

    def watch(self, progress: Callable[[float], None] | None) -> None:
        self._progress = progress

    def close(self) -> None:
        self._closed = True

    def _check_open(self) -> None:
        if self._closed:
            raise DeviceError(f"{self.name}: it has been closed; open it again")


def open_emulated(
    scene: str, *, model: bytes | None = None, image: Path | None = None, loop: bool = False
) -> EmulatedTransport:
    """An emulated board before ``scene`` (a file or a library scene), with ``model`` in its first
    bank (or the prebuilt one) and the firmware ``image`` (.bin; or the one that ships). Until
    ``begin_scene`` the skin is untouched (``analog.skin``).

    Raises:
        MissingExtraError: what simulates the scene is not installed.
        FileError, ConfigError, GeometryError, ProtocolError: scene or image cannot be read, or the
            model is for other electrodes.
        UsageError: the scene's skin covers a surface, and there is no model of it.
        ModelError, DeviceError: the model is none, or too long; the image is none.
    """
    program = image_bytes(image)
    described = find_scene(scene)
    if model is None:
        check_prebuilt_fits(described)
    prebuilt, blob = load_prebuilt() if model is None else (decode_model(model, "the model"), model)
    banks = (bank_bytes(blob, 1),)
    board = EmulatedBoard(program, skin_of(described, prebuilt.protocol), banks)
    board.run_until(START_TICKS, lambda: board.line.up_next_end() <= board.clock.now)
    return EmulatedTransport(scene, board, loop=loop)
