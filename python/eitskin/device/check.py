"""Check that a board is the intended one (versions, model, identity), and find out why a board does
not answer."""

import zlib
from pathlib import Path

from eitskin import __version__
from eitskin.device.bank import too_large
from eitskin.device.link import Link
from eitskin.device.wire.link_table import LINK_VERSION
from eitskin.device.wire.packets import BoardInfo
from eitskin.device.wire.sequence import LinkCounters
from eitskin.errors import DeviceError
from eitskin.model.eitm import load_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.skin.protocol import Protocol, pattern_name, patterns_of_length

FLASH = "flash this version's firmware with  eitskin flash"


def host_major() -> int:
    """The first number of this package's version; a firmware must have the same."""
    return int(__version__.split(".")[0])


def check_board(info: BoardInfo, name: str) -> None:
    """Reject a board whose firmware is of another major version."""
    if info.firmware[0] != host_major():
        newer = info.firmware[0] > host_major()
        raise DeviceError(
            f"{name}: the board's firmware is {info.firmware_text} and this eitskin is"
            f" {__version__}; "
            + (f"install eitskin {info.firmware[0]}.x, or {FLASH}" if newer else FLASH)
        )


def no_answer(link: Link, before: LinkCounters, what: str, waited_s: float) -> str:
    """Return in one line why the board does not answer, by the counters since ``before``."""
    name, counters = link.transport.name, link.counters
    other = link.decoder.other_version
    packets = counters.packets - before.packets
    if other is not None and not packets:
        advice = FLASH if other < LINK_VERSION else f"upgrade eitskin, or {FLASH}"
        return (
            f"{name}: the board speaks version {other} of the link protocol and this eitskin"
            f" {LINK_VERSION}; {advice}"
        )
    if link.ended and what == "TARE":
        return f"{name}: the scene is over, and a tare waits for frames; open the device again"
    if link.transport.capabilities.instrument:
        return (
            f"{name}: {what} is not answered within {waited_s:g} s, as the instrument sends too few"
            " frames; see whether it still sends lines of its layout, and check its cable and power"
        )
    if packets:
        return (
            f"{name}: packets arrive, but {what} is not answered within {waited_s:g} s; reset the"
            f" board, or {FLASH}"
        )
    if counters.packets:
        return (
            f"{name}: the board has fallen silent: {what} is not answered within {waited_s:g} s;"
            " reset it, or plug it in again"
        )
    if counters.bytes:
        baud = link.transport.capabilities.baud
        at = f" at {baud} baud" if baud else ""
        return (
            f"{name}: {counters.bytes} bytes arrive but no packet decodes{at}: the baud rate is"
            " wrong, or this is not an eitskin board; give the rate with  serial:PORT?baud=N  or"
            f" {FLASH}"
        )
    return (
        f"{name}: no answer within {waited_s:g} s; is this the board's port, and its firmware"
        f" running? {FLASH}"
    )


def scanned(info: BoardInfo) -> Protocol | None:
    """Return the pattern's protocol that has the hash of the board's, or None."""
    made = patterns_of_length(info.n_electrodes, info.n_rows)
    return next((one for one in made if one.hash == info.protocol_hash), None)


def scanned_pattern(info: BoardInfo) -> str:
    """Return the name of the pattern that the board scans, or that it is a table."""
    made = scanned(info)
    return f"a table of {info.n_rows} rows" if made is None else pattern_name(made)


def check_fits(info: BoardInfo, model: Model, blob: bytes, name: str) -> None:
    """Reject a model that the board cannot hold, or whose electrodes it does not have."""
    if model.protocol.n_electrodes > info.electrodes:
        raise DeviceError(
            f"{name}: the model's protocol needs {model.protocol.n_electrodes} electrodes and the"
            f" board has {info.electrodes}; frames in files need no board:  eitskin reconstruct"
        )
    if len(blob) > info.bank_bytes:
        raise DeviceError(f"{name}: {too_large(len(blob), info.bank_bytes)}")


def check_model(info: BoardInfo, model: Model, blob: bytes, name: str) -> None:
    """Reject to read a board's frames with another model than it scans and solves with."""
    if not info.has_model:
        raise DeviceError(
            f"{name}: the board has no model; upload one with  eitskin model upload MODEL.eitm"
        )
    if info.protocol_hash != model.protocol.hash:
        raise DeviceError(
            f"{name}: the board scans {scanned_pattern(info)} (protocol"
            f" {info.protocol_hash:016x}, {info.n_electrodes} electrodes, {info.n_rows} rows) and"
            f" the model here {pattern_name(model.protocol)} ({model.protocol.hash:016x},"
            f" {model.protocol.n_electrodes} electrodes, {model.protocol.n_rows} rows); put yours"
            " on the board with  eitskin model upload FILE  or name the board's with  --model FILE"
        )
    if info.model_crc != zlib.crc32(blob):
        raise DeviceError(
            f"{name}: the board's model has checksum {info.model_crc:08x} and the model here"
            f" {zlib.crc32(blob):08x}; put yours on the board with  eitskin model upload FILE  or"
            " name the board's with  --model FILE"
        )


def model_of(info: BoardInfo, path: str | Path | None, name: str) -> tuple[Model, bytes]:
    """Return the board's own model on the host: the file ``path``, or the prebuilt model if the
    board has that one."""
    model, blob = load_prebuilt() if path is None else load_model(path)
    check_model(info, model, blob, name)
    return model, blob
