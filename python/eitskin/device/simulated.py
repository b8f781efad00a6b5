"""``sim:SCENE``: the firmware's own application, built for this host, before a scene's frames.

The parts around it are simulated (firmware/boards/simulated): a converter of 16 bits whose range is
that of the frames, no noise but the scene's, and no processor time, so that every time that depends
on it is 0. The clock runs only while the board scans for someone. Deterministic; no thread.
"""

import zlib
from collections.abc import Sequence
from math import isfinite

import numpy as np

from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.device.host_board import HostBoard
from eitskin.device.transport import Capabilities, SimulatedScene, Transport
from eitskin.errors import UsageError
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.description import Scene
from eitskin.scene.laws import ShortCircuit
from eitskin.scene.library_scenes import find_scene
from eitskin.scene.random_touches import TrueTouch
from eitskin.skin.skin import size_to_paper
from eitskin.threads import one_at_a_time

FINGER_MM = 8.0  # radius of a finger that a program presses, on a skin of the paper's size


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
        self.fingers: tuple[TrueTouch, ...] = ()
        """Fingers on the skin beside the scene's touches, from the next scan on."""
        self._shown: tuple[TrueTouch, ...] = ()  # the fingers of the last scan

    @property
    @one_at_a_time
    def ended(self) -> bool:
        """Return whether the scene is over when the next scan begins."""
        return bool(self._lib.sim_scene_over(self._sim))

    @one_at_a_time
    def begin_scene(self) -> None:
        """Let the scene begin with the next scan."""
        self._lib.sim_begin_scene(self._sim)

    @one_at_a_time
    def scan_one(self) -> bool:
        """Scan one frame; False if nobody wants one.

        Raises:
            EitskinError: the scene cannot be simulated.
        """
        if not self.wanted:
            return False
        self._show_skin()
        if self._shown != self.fingers:
            self._shown = self.fingers
            self._lib.sim_put(self._sim, self._ffi.NULL, 0, 0)  # each frame is asked for again
        while not self._lib.sim_scan_frame(self._sim):
            self._put(self._lib.sim_frame_wanted(self._sim))
        return True

    def _show_skin(self) -> None:
        """Put the scene for the model in use before the board, if the model has changed."""
        model = self.new_model()
        if model is None:
            return
        scene = self.frames.scene
        try:
            self._rows = self.frames.rows(model.protocol)
            largest_v = self._rows.largest_v
        except BaseException:
            self._model_crc = -1  # asked again, it fails again
            raise
        self._lib.sim_show(self._sim, largest_v, scene.quiet_frames, scene.frames, scene.rate_hz)

    def _put(self, frame: int) -> None:
        """Give the board the known frames around number ``frame``. If touches move, only that frame
        is given, with each row as it will be when the scan measures it. If fingers press, it is the
        frame with fingers and scene as they are in the middle of the scan."""
        scene = self.frames.scene
        if self._shown:
            pressed = self._rows.pressed(frame, self._shown)
            self._volts = np.ascontiguousarray(pressed, np.float32)
            self._lib.sim_put_once(self._sim, self._pointer(self._volts, "float *"), frame)
            return
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


class SimTransport(Transport):
    """The bytes of a ``SimBoard``. It scans a frame each time that it is read and has nothing else
    to send. ``loop``: the scene begins again at its end."""

    def __init__(self, name: str, board: SimBoard, *, loop: bool = False) -> None:
        self.url = self.name = f"sim:{name}"
        self.board, self._loop = board, loop
        scene = SimulatedScene(name, loop=loop, rate_hz=board.frames.scene.rate_hz)
        self._outline = board.frames.scene.skin.outline
        finger_mm = FINGER_MM * size_to_paper(self._outline)
        self._capabilities = Capabilities(own_clock=True, scene=scene, finger_mm=finger_mm)

    @property
    def capabilities(self) -> Capabilities:
        return self._capabilities

    @property
    def ended(self) -> bool:  # type: ignore[override]
        return self.board.ended and not self._loop

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that the board sends; none if it is idle or its scene has ended."""
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

    def begin_scene(self) -> None:  # with the next scan
        self.board.begin_scene()

    def press(self, places_mm: Sequence[tuple[float, float]]) -> None:
        finger_mm, contrast = self._capabilities.finger_mm or FINGER_MM, ShortCircuit().contrast
        on = [p for p in places_mm if isfinite(sum(p)) and self._outline.contains([p]).all()]
        self.board.fingers = tuple(TrueTouch(x, y, finger_mm, contrast) for x, y in on)

    def close(self) -> None:
        """Close it; there is nothing to release."""


def check_prebuilt_fits(scene: Scene) -> None:
    """Reject a scene on a surface if its board has the prebuilt model, which is of a flat skin.

    Raises:
        UsageError: the scene's skin covers a surface.
    """
    if scene.skin.surface is not None:
        raise UsageError(
            f"{scene.where}: its skin {scene.skin.name!r} covers a surface, and the prebuilt model"
            " is of a flat skin; build its model with  eitskin model build  and name it with"
            " --model (in a robot file: model)"
        )


def open_simulated(scene: str, *, model: bytes | None = None, loop: bool = False) -> SimTransport:
    """A simulated board before ``scene`` (a file or a library scene), with ``model`` in its first
    bank (or the prebuilt one).

    Raises:
        FileError, ConfigError, GeometryError, ProtocolError: the scene cannot be read.
        UsageError: its skin covers a surface, and there is no model of it.
        DeviceError: the model does not fit a bank.
    """
    described = find_scene(scene)
    if model is None:
        check_prebuilt_fits(described)
    frames = BoardFrames(described)
    blob = load_prebuilt()[1] if model is None else model
    empty = bytes([ERASED]) * BANK_BYTES
    return SimTransport(scene, SimBoard(frames, [bank_bytes(blob, 1), empty]), loop=loop)
