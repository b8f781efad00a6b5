"""The subject of the examination: a frames file, or a source read in each order that its channels
could have."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eitskin.errors import EitskinError, FrameError, UsageError
from eitskin.frames.frames import Frames, load_frames
from eitskin.frames.homogeneous import Homogeneous
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.orders import ORDERS, match_rows, source_table
from eitskin.frames.source import is_frames_file
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

AS_GIVEN = "as given"


@dataclass(frozen=True, eq=False)
class Subject:
    """The frames that the doctor examines. ``readings`` are pairs (order, frames): the rows in the
    protocol's order, if the source has this order.

    ``stand_in`` describes what was measured in place of the skin, such as a ring of resistors.
    ``given`` is the stated order. ``remarks`` are the assumptions that were needed to read the
    source. ``unit_known`` tells whether the numbers are stated as volts.
    """

    source: str
    given: str
    readings: tuple[tuple[str, Frames], ...]
    skin: Skin | None
    remarks: tuple[str, ...] = ()
    unit_known: bool = True
    stand_in: Homogeneous | None = None


def subject_from_frames(frames: Frames, skin: Skin | None, source: str = "frames") -> Subject:
    """Return the subject with ``frames`` as given, and as they would be if their rows were really
    in rotating order."""
    readings = [(AS_GIVEN, frames)]
    wanted = np.asarray(frames.protocol.drive_measure, dtype=np.int64)
    rotating = source_table("rotating", frames.protocol)
    if not np.array_equal(rotating, wanted):
        index = match_rows(rotating, wanted).index
        moved = replace(
            frames,
            voltage_v=frames.voltage_v[:, index],
            reference_voltage_v=frames.reference_voltage_v[:, index],
        )
        readings.append(("rotating", moved))
    unit_known = str(frames.meta.get("unit", "V")) == "V"
    return Subject(source, AS_GIVEN, tuple(readings), skin, (), unit_known)


def subject_from_source(
    path: str | Path,
    options: ImportOptions,
    protocol: Protocol | None,
    skin: Skin | None,
    n_electrodes: int | None = None,
) -> Subject:
    """Return the subject for any file that ``import`` reads, repaired as ``options`` say; a frames
    file without options is read by ``load_frames``.

    Unlike import, NaN and Inf are accepted, and if no untouched frames are named, the first frame
    is used as one.
    """
    if is_frames_file(path) and options == ImportOptions():
        return subject_from_frames(load_frames(path, allow_nonfinite=True), skin, str(path))
    readings: list[tuple[str, Frames]] = []
    refused: EitskinError | None = None
    own_table = options.source.protocol_table is not None or options.table_file is not None
    for order in dict.fromkeys((options.order, *(() if own_table else ORDERS))):
        try:
            frames = import_frames(
                path, replace(options, order=order), protocol, skin, n_electrodes, lenient=True
            )
        except (FrameError, UsageError) as error:
            if order == options.order and isinstance(error, UsageError):
                raise
            refused = refused or error
            continue
        readings.append((order, frames))
    if not readings:
        raise refused if refused is not None else FrameError(f"{path}: no order fits")
    meta, unit_known = readings[0][1].meta, options.source.scale is not None
    remarks = (str(meta["assumed"]),) if "assumed" in meta else ()
    return Subject(str(path), options.order, tuple(readings), skin, remarks, unit_known)
