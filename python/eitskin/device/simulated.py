"""``sim:SCENE``: the firmware's own application, built for this host, before a scene's frames.

The parts around it are simulated (firmware/boards/simulated): a converter of 16 bits whose range is
that of the frames, no noise but the scene's, and no processor time, so that every time that would
tell of one is 0. The clock runs only while the board scans for someone. Deterministic; no thread.
"""

import zlib
from typing import Any

import numpy as np

from eitskin.core.engine import aligned
from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.errors import DeviceError, UsageError
from eitskin.model.eitm import decode_model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.library_scenes import find_scene

WORKSPACE_BYTES = 4 << 20  # enough for any model that fits a bank
OUTPUT_BYTES = 1 << 16


def _load() -> Any:
    try:
        from eitskin.device import _board  # type: ignore[attr-defined]
    except ImportError as error:
        raise UsageError(
            f"the simulated board is not built ({error}); install with  pip install .  in the"
            " project's root"
        ) from None
    return _board


class HostBoard:
    """The firmware's application on this host, switched on, with what its two ``banks`` hold.

    ``name`` and ``serial`` are what INFO says; ``period_us`` of its first frames; ``frames_given``:
    by another instrument.

    Raises:
        UsageError: the firmware is not built for this host.
    """

    def __init__(
        self,
        name: str,
        serial: str,
        banks: list[bytes],
        *,
        period_us: int,
        frames_given: bool = False,
    ) -> None:
        module = _load()
        self._ffi, self._lib = module.ffi, module.lib
        self._banks = [aligned(len(bank)) for bank in banks]
        for cells, bank in zip(self._banks, banks, strict=True):
            cells[:] = np.frombuffer(bank, dtype=np.uint8)
        self._workspace = aligned(WORKSPACE_BYTES)
        self._memory = aligned(self._lib.sim_board_bytes())
        self._name = self._ffi.new("char[]", name.encode())
        self._serial = self._ffi.new("char[]", serial.encode())
        self._sim = self._ffi.cast("sim_board *", self._ffi.from_buffer(self._memory))
        setup = self._ffi.new("sim_setup *")
        setup.name, setup.serial = self._name, self._serial
        setup.frames_given, setup.frame_period_us = frames_given, period_us
        setup.banks = [self._pointer(cells, "uint8_t *") for cells in self._banks]
        setup.bank_bytes = len(banks[0])
        setup.workspace = self._pointer(self._workspace, "void *")
        setup.workspace_bytes = WORKSPACE_BYTES
        self._lib.sim_init(self._sim, setup)
        self._output = self._ffi.new("uint8_t[]", OUTPUT_BYTES)
        self._bytes, self._crc = self._ffi.new("uint32_t *"), self._ffi.new("uint32_t *")
        self._model_crc = -1

    def _pointer(self, array: Any, kind: str) -> Any:
        return self._ffi.cast(kind, self._ffi.from_buffer(array))

    @property
    def banks(self) -> list[bytes]:
        """What the banks hold now."""
        return [bytes(cells) for cells in self._banks]

    def restart(self) -> None:
        """Switch it off and on again: time goes on, the banks stay."""
        self._lib.sim_start(self._sim)

    def receive(self, data: bytes) -> None:
        """What the host sent; commands in it are carried out."""
        self._lib.sim_write(self._sim, self._ffi.from_buffer(data), len(data))

    def take_output(self) -> bytes:
        """What the board has sent since the last call."""
        violation = self._lib.sim_violation(self._sim)
        if violation != self._ffi.NULL:
            what = self._ffi.string(violation).decode()
            raise DeviceError(f"the board's firmware did what it must never do: {what}; report it")
        pieces = []
        while size := self._lib.sim_read(self._sim, self._output, OUTPUT_BYTES):
            pieces.append(bytes(self._ffi.buffer(self._output, size)))
        return b"".join(pieces)

    def hold_button(self, held: bool) -> None:
        """The owner holds the blue button, or lets go of it."""
        self._lib.sim_press(self._sim, held)

    @property
    def wanted(self) -> bool:
        """Whether a stream or a tare waits for frames."""
        return bool(self._lib.sim_wants_frame(self._sim))

    def new_model(self) -> Any | None:
        """The model in use, decoded, where it is another than at the last call; else None."""
        blob = self._lib.sim_model(self._sim, self._bytes, self._crc)
        if blob == self._ffi.NULL or self._crc[0] == self._model_crc:
            return None

        model = decode_model(bytes(self._ffi.buffer(blob, self._bytes[0])), "the board's model")
        self._model_crc = self._crc[0]
        return model


class GivenBoard(HostBoard):
    """A board that is given the frames of another instrument, of which INFO says no more than
    ``name``, ``serial`` and how often they come."""

    def __init__(self, name: str, serial: str, banks: list[bytes], *, period_us: int) -> None:
        super().__init__(name, serial, banks, period_us=period_us, frames_given=True)

    def give(self, voltage_v: Any, passed_us: int, period_us: int) -> None:
        """One frame (m,), real or complex, in the rows of the model in use; NaN is a row that
        cannot be used. It began ``passed_us`` after the last one, and they come about every
        ``period_us``."""
        iq = np.ascontiguousarray(voltage_v, dtype=np.complex64).view(np.float32)
        self._lib.sim_give_frame(self._sim, self._pointer(iq, "float *"), passed_us, period_us)

    @property
    def tares(self) -> bool:
        """Whether a tare waits for frames."""
        return bool(self._lib.sim_tares(self._sim))

    def let_pass(self, passed_us: int) -> None:
        """No frame has come for ``passed_us`` more."""
        self._lib.sim_let_pass(self._sim, passed_us)


class SimBoard(HostBoard):
    """One board before ``frames``, switched on, with what its two ``banks`` hold.

    Raises:
        UsageError: the firmware is not built for this host.
    """

    def __init__(self, frames: BoardFrames, banks: list[bytes]) -> None:
        scene = frames.scene
        serial = zlib.crc32((scene.text or repr(scene)).encode())  # the same for the same scene
        period_us = max(round(1e6 / scene.rate_hz), 1)
        super().__init__("simulated", f"{serial:08X}", banks, period_us=period_us)
        self.frames = frames

    @property
    def ended(self) -> bool:
        """Whether the scene is over when the next scan begins."""
        return bool(self._lib.sim_scene_over(self._sim))

    def begin_scene(self) -> None:
        """Let the scene begin with the next scan."""
        self._lib.sim_begin_scene(self._sim)

    def scan_one(self) -> bool:
        """Scan one frame; False where nobody wants one.

        Raises:
            EitskinError: the scene cannot be simulated.
        """
        if not self.wanted:
            return False
        self._show_skin()
        while not self._lib.sim_scan_frame(self._sim):
            self._put(self._lib.sim_frame_wanted(self._sim))
        return True

    def _show_skin(self) -> None:
        """Put the scene for the model in use before the board, where it is another than before."""
        model = self.new_model()
        if model is None:
            return
        scene = self.frames.scene
        try:
            self._rows = self.frames.rows(model.protocol)
            largest_v = self._rows.largest_v
        except BaseException:
            self._model_crc = -1  # asked again, it says so again
            raise
        self._lib.sim_show(self._sim, largest_v, scene.quiet_frames, scene.frames, scene.rate_hz)

    def _put(self, frame: int) -> None:
        """The frames around number ``frame`` of all, as far as they are known; where touches move,
        that one with its rows as they will be when this scan comes to them."""
        scene = self.frames.scene
        if self._rows.moves and frame >= scene.quiet_frames:
            delays_us = np.zeros(self._rows.scene.protocol.n_rows, np.uint32)
            self._lib.sim_row_delays(self._sim, self._pointer(delays_us, "uint32_t *"))
            times_s = self._lib.sim_wanted_s(self._sim) + 1e-6 * delays_us
            self._volts = np.ascontiguousarray(self._rows.scan(frame, times_s), np.float32)
            self._lib.sim_put_once(self._sim, self._pointer(self._volts, "float *"), frame)
            return
        first, volts = self._rows.around(frame)
        self._volts = np.ascontiguousarray(volts, np.float32)
        self._lib.sim_put(self._sim, self._pointer(self._volts, "float *"), first, len(volts))


class SimTransport:
    """The bytes of a ``SimBoard``. It scans a frame each time that it is read and has nothing else
    to say. ``loop``: the scene begins again at its end."""

    synchronous = True
    replays = False

    def __init__(self, name: str, board: SimBoard, *, loop: bool = False) -> None:
        self.url = self.name = f"sim:{name}"
        self.board, self._loop = board, loop

    @property
    def ended(self) -> bool:
        return self.board.ended and not self._loop

    def read(self, timeout_s: float) -> bytes:
        """What the board sends; empty where it has nothing to do, or the scene is over."""
        output = self.board.take_output()
        if self._loop and self.board.ended:
            self.board.begin_scene()
        while not output and not self.ended and self.board.scan_one():
            output = self.board.take_output()
        return output

    def write(self, data: bytes) -> None:
        self.board.receive(data)

    def reopen(self) -> bool:
        return True

    def begin_scene(self) -> None:
        self.board.begin_scene()

    def close(self) -> None:
        """Nothing is held."""


def open_simulated(scene: str, *, model: bytes | None = None, loop: bool = False) -> SimTransport:
    """A simulated board before ``scene`` (a file or a library scene), with ``model`` in its first
    bank (or the prebuilt one).

    Raises:
        FileError, ConfigError, GeometryError, ProtocolError: the scene cannot be read.
        DeviceError: the model does not fit a bank.
    """
    frames = BoardFrames(find_scene(scene))
    blob = load_prebuilt()[1] if model is None else model
    empty = bytes([ERASED]) * BANK_BYTES
    return SimTransport(scene, SimBoard(frames, [bank_bytes(blob, 1), empty]), loop=loop)
