"""The firmware's own application, built for this host. It runs behind ``sim:`` boards, and behind
other instruments, whose frames it is given.

The parts around it are simulated (firmware/boards/simulated). No processor time passes, so that
every time that depends on one is 0. Deterministic; no thread.
"""

import threading
from typing import Any

import numpy as np

from eitskin.core.engine import aligned
from eitskin.errors import DeviceError, UsageError
from eitskin.model.eitm import decode_model
from eitskin.threads import one_at_a_time

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
    Each method holds ``lock``, since C allows one thread at a time.

    ``name`` and ``serial`` are those in INFO; ``period_us`` of its first frames; ``frames_given``:
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
        self.lock = threading.RLock()
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
        """Return the present contents of the flash banks."""
        return [bytes(cells) for cells in self._banks]

    @one_at_a_time
    def restart(self) -> None:
        """Switch it off and on again: time continues, and the banks stay."""
        self._lib.sim_start(self._sim)

    @one_at_a_time
    def receive(self, data: bytes) -> None:
        """Give the board bytes from the host; it carries out the commands in them."""
        self._lib.sim_write(self._sim, self._ffi.from_buffer(data), len(data))

    @one_at_a_time
    def take_output(self) -> bytes:
        """Return the bytes that the board has sent since the last call."""
        violation = self._lib.sim_violation(self._sim)
        if violation != self._ffi.NULL:
            what = self._ffi.string(violation).decode()
            raise DeviceError(f"the board's firmware did what it must never do: {what}; report it")
        pieces = []
        while size := self._lib.sim_read(self._sim, self._output, OUTPUT_BYTES):
            pieces.append(bytes(self._ffi.buffer(self._output, size)))
        return b"".join(pieces)

    @one_at_a_time
    def hold_button(self, held: bool) -> None:
        """The owner holds the blue button, or lets go of it."""
        self._lib.sim_press(self._sim, held)

    @property
    @one_at_a_time
    def wanted(self) -> bool:
        """Return whether a stream or a tare waits for frames."""
        return bool(self._lib.sim_wants_frame(self._sim))

    @one_at_a_time
    def new_model(self) -> Any | None:
        """The model in use, decoded, where it is another than at the last call; else None."""
        blob = self._lib.sim_model(self._sim, self._bytes, self._crc)
        if blob == self._ffi.NULL or self._crc[0] == self._model_crc:
            return None

        model = decode_model(bytes(self._ffi.buffer(blob, self._bytes[0])), "the board's model")
        self._model_crc = self._crc[0]
        return model


class GivenBoard(HostBoard):
    """A board that is given the frames of another instrument. Its INFO has only ``name``,
    ``serial`` and the frame period of that instrument."""

    def __init__(self, name: str, serial: str, banks: list[bytes], *, period_us: int) -> None:
        super().__init__(name, serial, banks, period_us=period_us, frames_given=True)

    @one_at_a_time
    def give(self, voltage_v: Any, passed_us: int, period_us: int) -> None:
        """One frame (m,), real or complex, in the rows of the model in use; NaN is a row that
        cannot be used. It began ``passed_us`` after the last one, and they come about every
        ``period_us``."""
        iq = np.ascontiguousarray(voltage_v, dtype=np.complex64).view(np.float32)
        self._lib.sim_give_frame(self._sim, self._pointer(iq, "float *"), passed_us, period_us)

    @property
    @one_at_a_time
    def tares(self) -> bool:
        """Return whether a tare waits for frames."""
        return bool(self._lib.sim_tares(self._sim))

    @one_at_a_time
    def mask_row(self, row: int, masked: bool) -> bool:
        """Leave ``row`` of the model in use out of every frame, or use it again, also while a tare
        waits for its first frame. Returns whether it was left out before."""
        return bool(self._lib.sim_mask_row(self._sim, row, masked))

    @one_at_a_time
    def let_pass(self, passed_us: int) -> None:
        """Let ``passed_us`` pass without a frame."""
        self._lib.sim_let_pass(self._sim, passed_us)
