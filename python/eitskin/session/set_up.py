"""The steps before a board's frames: scan, solver, reference, and the beginning of a scene."""

import time
from collections.abc import Callable
from contextlib import suppress

from eitskin.core.results import Options
from eitskin.device.client import Device
from eitskin.device.known_model import NAMES_IT, KnownModel
from eitskin.device.settings import ScanSettings, SolverSettings, apply_scan
from eitskin.device.streaming import LEAVE_S
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.link_table import Stream, StreamCommand
from eitskin.device.wire.packets import Fault
from eitskin.errors import DeviceError, EitskinError, SkinTouchedError

UNTOUCHED_S = 20.0  # that a tare waits for fingers to lift


def set_up(
    device: Device, scan: ScanSettings, solver: SolverSettings, known: KnownModel | None
) -> Options | None:
    """Set scan and solver. Returns the solver's present options, or None if the model is not known
    here and no option of the solver was requested: then the options do not change.

    Raises:
        UsageError: a number is out of its range.
        DeviceError: the board refuses (it keeps what it had), or its model is not known here.
    """
    apply_scan(device, scan)
    if known is None:
        if solver.named:
            raise DeviceError(
                f"{device.transport.name}: changing the solver needs the defaults of the board's"
                f" model, {device.board.model_crc:08x}, which is not the prebuilt one; {NAMES_IT}"
            )
        return None
    options = solver.applied(known.model, device.board)
    device.solver(options)
    return options


def wait_untouched(
    take: Callable[[], None], say: Callable[[str], None], wait_s: float = UNTOUCHED_S
) -> None:
    """Call ``take`` for the reference; while something touches the skin, report it and try again.

    Raises:
        SkinTouchedError: something still does after ``wait_s``.
    """
    end_s, said = time.monotonic() + wait_s, ""
    while True:
        try:
            return take()
        except SkinTouchedError as error:
            if time.monotonic() >= end_s:
                raise SkinTouchedError(
                    f"{error}; if nothing touches it, run  eitskin tare --anyway"
                ) from None
            if str(error) != said:
                say(f"the reference waits: {error}")
                said = str(error)


def take_reference(
    device: Device, frames: int, *, streamed: bool = False, anyway: bool = False
) -> None:
    """Tare. With ``streamed`` the untouched frames are also sent as raw frames, for recordings.
    ``anyway`` and errors are those of ``Device.tare``."""
    if not streamed:
        device.tare(frames, anyway=anyway)
        return
    if not anyway:
        device.check_untouched()

    def stop() -> None:
        device.send_command(StreamCommand(0), 1.0)

    device.send_command(StreamCommand(int(Stream.RAW)), 1.0)
    try:
        device.tare(frames, anyway=True)
    except BaseException:
        with suppress(EitskinError):
            device.bounded(LEAVE_S, stop)
        raise
    stop()


def begin_scene(device: Device) -> tuple[int | None, list[Fault | LinkEvent]]:
    """Begin the touches of the scene on a simulated board. If the scene begins within a scan, the
    end of that scan, which still shows the untouched skin, is waited for. Returns the board's clock
    at the scene's time 0 (None: it is when the next scan begins), and the notices in the meantime.
    """
    events: list[Fault | LinkEvent] = []
    began_us = device.start_scene()
    if began_us is None:
        return None, []
    info = device.board
    scan_s = 1.1e-6 * max(info.frame_us, info.n_rows * info.slot_us)
    while (item := device.next_item(scan_s)) is not None:
        if isinstance(item, Fault | LinkEvent):
            events.append(item)
    return began_us, events
