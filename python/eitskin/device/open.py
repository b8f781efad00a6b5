"""Devices are URLs: auto, serial:PORT, sim:SCENE, emu:SCENE, file:RUN.eits, text:PORT?layout=FILE,
and what packages bring (``source``). The same frames, commands and errors behind each. After sim:,
emu: and file: ``?speed=1&loop=1`` (``timing``)."""

import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from eitskin.config import nearest
from eitskin.device.check import check_fits, check_model
from eitskin.device.client import Device
from eitskin.device.link import Reconnect
from eitskin.device.pacing import Pacer
from eitskin.device.ports import BAUD, Port, SerialTransport, only_board, ports
from eitskin.device.source import open_source, source_schemes
from eitskin.device.timing import split_name, split_timing
from eitskin.device.transport import Transport
from eitskin.device.wire.packets import BoardInfo
from eitskin.errors import DeviceError, EitskinError, UsageError, missing_checkout

AS_IN = {
    "serial": "serial:/dev/ttyACM0",
    "sim": "sim:two_touch",
    "emu": "emu:two_touch",
    "file": "file:RUN.eits",
    "text": "text:/dev/ttyACM0?layout=FILE",
    "robot": "robot:FILE.toml",
}
SCHEMES = ("auto", *AS_IN)
MAX_BAUD = 20_000_000
HAVE_THEIR_OWN = ("auto", "serial", "file")  # other boards get the model that is named
RATE_SLACK = 1.001  # frame periods are whole microseconds


def open_device(
    url: str,
    *,
    model: bytes | None = None,
    image: Path | None = None,
    room: int = 1024,
    reconnect: Reconnect | None = None,
) -> Device:
    """Open the device behind ``url``, and ask it what it is.

    ``model`` is put into the bank of a simulated or emulated board (without it, the prebuilt
    model); a real board's and a recording's must be the same. ``image`` is the firmware of an
    emulated board (without it, the one that ships with eitskin). ``room``: packets that are queued
    for a slow reader. ``reconnect``: how long an unplugged board is waited for.

    Raises:
        DeviceError: it cannot be opened, does not answer, is of another version, or has another
            model.
        UsageError: the URL cannot be read.
        FileError, ConfigError, ModelError, MissingExtraError: of the scene, recording, model or
            emulator that it names.
    """
    device = Device(open_transport(url, model=model, image=image), room=room, reconnect=reconnect)
    try:
        _check_rate(device)
    except UsageError:
        device.close()
        raise
    device.pacer = Pacer(split_timing(url)[1].speed or 0.0)
    if model is not None:
        try:
            _check_given(device, url, model)
        except BaseException:
            device.close()
            raise
    return device


def _check_given(device: Device, url: str, blob: bytes) -> None:
    """Reject a model that is not the board's, or that the board cannot use."""
    from eitskin.model.eitm import decode_model

    model, name = decode_model(blob, "the model"), device.transport.name
    if device.board.has_model:
        check_model(device.board, model, blob, name)
        return
    check_fits(device.board, model, blob, name)
    if split_timing(split_name(url)[0])[0].partition(":")[0] not in HAVE_THEIR_OWN:
        raise DeviceError(
            f"{name}: the model ({model.grid.n_pixels} pixels, {model.protocol.n_rows} rows, rank"
            f" {model.rank}) does not fit the board's memory or its packets; build it with fewer"
            " pixels or a lower rank (eitskin model build --help)"
        )


def _check_rate(device: Device) -> None:
    """Reject a scene whose frames come faster than the board can scan them."""
    scene = device.transport.capabilities.scene
    frame_us = device.board.frame_us
    if scene is None or scene.rate_hz is None or not frame_us:
        return
    most_hz = 1e6 / frame_us
    if scene.rate_hz > most_hz * RATE_SLACK:
        raise UsageError(
            f"{device.transport.name}: rate_hz = {scene.rate_hz:g} in the scene, but a scan takes"
            f" {frame_us / 1e3:g} ms: use at most {most_hz:.4g}, or make the frames without a"
            " board:  eitskin scene run"
        )


def open_with_files(
    url: str, model: Path | None, firmware: Path | None, *, reconnect: Reconnect | None = None
) -> Device:
    """``open_device`` with the files of ``--model`` and ``--firmware``.

    Raises:
        EitskinError: as ``open_device`` and ``load_model``.
    """
    from eitskin.model.eitm import load_model

    blob = None if model is None else load_model(model)[1]
    return open_device(url, model=blob, image=firmware, reconnect=reconnect)


def open_transport(url: str, *, model: bytes | None = None, image: Path | None = None) -> Transport:
    """The bare bytes behind ``url``; raises as ``open_device``."""
    url, _ = split_name(url)
    bare, timing = split_timing(url)
    scheme, colon, rest = bare.partition(":")
    if scheme == "robot" or (not colon and scheme.endswith((".toml", ".urdf"))):
        raise UsageError(
            f"device {url!r}: a robot has several boards; it can be streamed, recorded and viewed;"
            " for all else name one board of its file"
        )
    brought = scheme not in SCHEMES and scheme in source_schemes()
    if (scheme not in SCHEMES and not brought) or (scheme == "auto") == bool(colon):
        if scheme.startswith("/") or scheme.upper().startswith("COM"):
            raise UsageError(f"device {url!r}: write  serial:{url}")
        if scheme in SCHEMES:
            raise UsageError(
                f"device {url!r}: "
                + ("nothing follows  auto" if colon else f"write  {AS_IN[scheme]}")
            )
        meant = None if colon else _meant(bare)
        if meant is not None:
            raise UsageError(f"device {url!r}: write  {meant}")
        remedy = nearest(scheme, (*SCHEMES, *source_schemes()))
        raise UsageError(
            f"device {url!r}: {remedy}{' As' if remedy.endswith('?') else ', as'} in auto,"
            f" {', '.join(AS_IN.values())}"
        )
    if image is not None and scheme != "emu":
        raise UsageError(
            f"--firmware {image}: only emu: runs an image; a board is given one with  eitskin"
            " flash --image"
        )
    if scheme == "auto":
        return SerialTransport(only_board().path)
    if not rest:
        raise UsageError(
            f"device {url!r}: something must follow the colon, as in serial:/dev/ttyACM0 or"
            " sim:two_touch"
        )
    if scheme == "text":
        from eitskin.device.text_source import open_text

        return open_text(url, model=model)
    if brought:
        return open_source(url, model=model)
    if scheme == "serial":
        return SerialTransport(*_path_and_baud(url, rest))
    if scheme == "sim":
        from eitskin.device.simulated import open_simulated

        return open_simulated(rest, model=model, loop=timing.loop)
    if scheme == "emu":
        return _emulated(rest, model, image, timing.loop)
    from eitskin.device.recordings.recording import FileTransport

    return FileTransport(rest)


def _meant(name: str) -> str | None:
    """Return what to write for a device that is named without a scheme: a recording or a scene of
    the library."""
    from eitskin.scene.library_scenes import library

    if Path(name).suffix == ".eits":
        return f"file:{name}"
    return f"sim:{name}" if name in library() else None


def _emulated(scene: str, model: bytes | None, image: Path | None, loop: bool) -> Transport:
    """The board of a package that the wheel does not have."""
    try:
        from eitskin_emulator.transport import open_emulated
    except ImportError:
        raise missing_checkout(f"emu:{scene}: the emulated board", "firmware/emulator") from None
    transport: Transport = open_emulated(scene, model=model, image=image, loop=loop)
    return transport


def list_devices() -> list[Port]:
    """Every serial port, boards first."""
    return sorted(ports(), key=lambda port: (not port.is_board, port.path))


@dataclass(frozen=True)
class FoundPort:
    """A port; the ``board`` that answered on it, or ``why`` none did; neither where it was not
    asked."""

    port: Port
    board: BoardInfo | None = None
    why: str | None = None

    def as_dict(self) -> dict[str, Any]:
        board = None if self.board is None else self.board.as_dict()
        port = {"url": f"serial:{self.port.path}", **asdict(self.port)}
        return port | {"is_board": self.port.is_board, "board": board, "why": self.why}


def discover(*, ask: bool = True) -> list[FoundPort]:
    """Return all serial ports, boards first. With ``ask``, ports that look like a board's are asked
    what they are."""
    return [_asked(port) if ask and port.is_board else FoundPort(port) for port in list_devices()]


def _asked(port: Port) -> FoundPort:
    try:
        with open_device(f"serial:{port.path}") as device:
            return FoundPort(port, device.board)
    except EitskinError as error:
        return FoundPort(port, why=str(error))


def _path_and_baud(url: str, rest: str) -> tuple[str, int]:
    path, _, query = rest.partition("?")
    if not query:
        return path, BAUD
    match = re.fullmatch(r"baud=(\d{1,9})", query)
    if not match or not 0 < int(match.group(1)) <= MAX_BAUD or not path:
        raise UsageError(f"device {url!r}: what follows '?' must be baud=N, N up to {MAX_BAUD}")
    return path, int(match.group(1))
