"""A run on disk (.eits): a recording that also says how the board was set to solve, so that the
host can solve it again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from eitskin.core.results import Options, check_options
from eitskin.device.client import Device
from eitskin.device.recordings.recording import CHUNK, Recorder, read_head
from eitskin.device.wire.codec import Decoder
from eitskin.device.wire.packets import PacketType
from eitskin.errors import EitskinError, FileError
from eitskin.fileio import parse_json

LOOKED_THROUGH = 64 * CHUNK  # the note is among the first packets


class RunRecorder(Recorder):
    """A ``Recorder`` whose file also holds the solver's ``options``, as a second packet of the
    recording's own type.

    Raises:
        FileError, DeviceError: as ``Recorder``.
    """

    def __init__(
        self, path: str | Path, device: Device, options: Options | None, *, overwrite: bool = False
    ) -> None:
        super().__init__(path, device, overwrite=overwrite)
        if options is not None:
            self._write(PacketType.RECORDING, 0, json.dumps({"solver": asdict(options)}).encode())


def recorded_options(path: str | Path) -> Options | None:
    """The solver's options that the recording notes; None where it notes none.

    Raises:
        FileError, DeviceError: as ``read_head``; or the note cannot be read.
    """
    read_head(path)
    for note in _notes(path):
        if "solver" in note:
            try:
                options = Options(**note["solver"])
                check_options(options)
            except (TypeError, EitskinError) as error:
                raise FileError(
                    f"{path}: what it notes of the solver cannot be ({error}); record again"
                ) from None
            return options
    return None


def _notes(path: str | Path) -> Iterator[dict[str, Any]]:
    decoder, read = Decoder(), 0
    with Path(path).open("rb") as stream:
        while read < LOOKED_THROUGH and (data := stream.read(CHUNK)):
            read += len(data)
            for packet in decoder.feed(data):
                if packet.type == PacketType.RECORDING:
                    try:
                        note = parse_json(packet.payload)
                    except ValueError:
                        continue
                    if isinstance(note, dict):
                        yield note
