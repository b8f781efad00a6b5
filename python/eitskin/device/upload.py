"""A model over the wire into a board's other bank: announced, sent in pieces, committed. Cut at any
byte, the old model stays."""

import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from eitskin.device.check import check_fits
from eitskin.device.exchange import CommandExchange
from eitskin.device.wire.explain import reply_text
from eitskin.device.wire.link_table import (
    LINK_MAX_PAYLOAD,
    ModelBegin,
    ModelCommit,
    ModelData,
    ReplyStatus,
)
from eitskin.device.wire.packets import Reply
from eitskin.errors import DeviceError
from eitskin.model.eitm import decode_model, load_model

ERASE_S = 15.0
PIECE_S = 1.0
VERIFY_S = 20.0
GOING_BACK = 10


def upload(
    device: CommandExchange, model: str | Path | bytes, progress: Callable[[int, int], None] | None
) -> None:
    blob = _checked(device, model)
    name, crc = device.transport.name, zlib.crc32(blob)
    done = 0
    try:
        begun = device.send_command(ModelBegin(len(blob), crc), ERASE_S)
        _demand(device, begun)
        start = begun.detail[0]  # above 0 where an upload of the same model was cut
        for done in _send_pieces(device, blob, start):
            if progress is not None:
                progress(done, len(blob))
        _demand(device, device.send_command(ModelCommit(), VERIFY_S))
    except _Refused:
        raise
    except DeviceError as error:
        raise DeviceError(
            f"{error} -- the upload was cut after {done} of {len(blob)} bytes, the board keeps its"
            " old model; upload again"
        ) from None
    info = device.info()
    if info.model_crc != crc:
        raise DeviceError(
            f"{name}: the board says it has model {info.model_crc:08x} after {crc:08x} was"
            " uploaded; upload again"
        )


class _Refused(DeviceError):
    """The board refuses and says why."""


def _demand(device: CommandExchange, reply: Reply) -> None:
    if not reply.ok:
        raise _Refused(f"{device.transport.name}: {reply_text(reply)}")


def _checked(device: CommandExchange, model: str | Path | bytes) -> bytes:
    """The model's bytes, refused here rather than after minutes on the wire."""
    if isinstance(model, bytes):
        decoded, blob = decode_model(model, "the model"), model
    else:
        decoded, blob = load_model(model)
    check_fits(device.board, decoded, blob, device.transport.name)
    return blob


def _send_pieces(device: CommandExchange, blob: bytes, done: int) -> Iterator[int]:
    """Send from ``done`` on; yields how far the board has it."""
    size = max(min(device.board.data_bytes, LINK_MAX_PAYLOAD - ModelData.LAYOUT.size) // 4 * 4, 4)
    back = 0
    while done < len(blob):
        reply = device.send_command(ModelData(done, blob[done : done + size]), PIECE_S)
        if (
            reply.status == ReplyStatus.OFFSET
            and 0 <= reply.detail[0] <= len(blob)
            and back < GOING_BACK
        ):
            done, back = reply.detail[0], back + 1  # the board knows what it has
            continue
        _demand(device, reply)
        done += min(size, len(blob) - done)
        yield done
