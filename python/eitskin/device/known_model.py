"""The board's model on the host, where the host has it: what turns pixels into places and rows into
electrodes."""

import zlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from eitskin.core.drawing import TouchDrawing
from eitskin.core.results import Options
from eitskin.device.check import model_of, scanned
from eitskin.device.wire.packets import BoardInfo
from eitskin.errors import DeviceError
from eitskin.model.model import Model
from eitskin.model.options import default_options, tracking
from eitskin.model.prebuilt import load_prebuilt
from eitskin.skin.protocol import Protocol

NAMES_IT = "name its file with  --model FILE"


@dataclass(frozen=True, eq=False)
class KnownModel:
    """A model with the bytes that the board has of it."""

    model: Model
    blob: bytes

    @cached_property
    def drawing(self) -> TouchDrawing:
        """Draws the touches of packets."""
        return TouchDrawing(self.blob)


def find_model(info: BoardInfo, path: Path | None, name: str) -> KnownModel | None:
    """Return the board's model: the file ``path``, or the prebuilt model if the board has that one;
    None if it has another."""
    if path is not None:
        return KnownModel(*model_of(info, path, name))
    model, blob = load_prebuilt()
    theirs = info.has_model and zlib.crc32(blob) == info.model_crc
    return KnownModel(model, blob) if theirs else None


def need_model(info: BoardInfo, path: Path | None, name: str, what: str) -> KnownModel:
    """As ``find_model``, but for ``what``, which needs a model: raise an error if it is not known.

    Raises:
        FileError, ModelError: the file cannot be read.
        DeviceError: the board has no model, or another one.
    """
    if not info.has_model:
        raise DeviceError(
            f"{name}: the board has no model; upload one with  eitskin model upload MODEL.eitm"
        )
    known = find_model(info, path, name)
    if known is None:
        raise DeviceError(
            f"{name}: {what} needs the board's model, {info.model_crc:08x}, which is not the"
            f" prebuilt one; {NAMES_IT}"
        )
    return known


def scanned_protocol(info: BoardInfo, known: KnownModel | None, name: str) -> Protocol:
    """Return the protocol that a board scans: its model's, or the pattern with the same hash."""
    if known is not None:
        return known.model.protocol
    protocol = scanned(info)
    if protocol is not None:
        return protocol
    raise DeviceError(
        f"{name}: only the board's model shows which rows it scans (protocol"
        f" {info.protocol_hash:016x}); {NAMES_IT}"
    )


def board_options(model: Model, board: BoardInfo | None = None) -> Options:
    """The options that a board starts with: the model's own for frames that follow each other, with
    the noise floor of ``board``'s converter."""
    options = tracking(default_options(model))
    return options if board is None else replace(options, noise_floor_v=board.noise_floor_v)
