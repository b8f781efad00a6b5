"""The subject of the examination: a frames file, or a source read in each way that its channels
could be meant."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import EitskinError, FrameError, UsageError
from eitskin.frames.frames import Frames, load_frames
from eitskin.frames.homogeneous import Homogeneous
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import Source, imported
from eitskin.frames.orders import ORDERS, match_rows, source_table
from eitskin.frames.several_files import source_files
from eitskin.frames.source import INSTRUMENT_SUFFIXES, SUFFIXES, is_frames_file
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

AS_GIVEN = "as given"
POTENTIALS = "potentials"
POTENTIALS_ORDERS = ("fixed-of-potentials", "rotating-of-potentials")


@dataclass(frozen=True, eq=False)
class Reading:
    """The ``frames`` as they are if the source's channels mean ``name``: "as given", an order, or
    "potentials". ``repair`` holds the options of import that say so. ``sign`` (m,) is the sign with
    which the source's numbers are in each row, 0 for a difference of two."""

    name: str
    frames: Frames
    repair: str = ""
    sign: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Subject:
    """The frames that the doctor examines, as each of ``readings``: the rows in the protocol's
    order, if the source's channels mean this.

    ``stand_in`` describes what was measured in place of the skin, such as a ring of resistors.
    ``given`` is the stated reading. ``remarks`` are the assumptions that were needed to read the
    source. ``unit_known`` tells whether the numbers are stated as volts. A number of the source is
    a voltage after ``offset`` is added to it and it is multiplied by ``scale``.
    """

    source: str
    given: str
    readings: tuple[Reading, ...]
    skin: Skin | None
    remarks: tuple[str, ...] = ()
    unit_known: bool = True
    stand_in: Homogeneous | None = None
    offset: float = 0.0
    scale: float = 1.0


def subject_from_frames(frames: Frames, skin: Skin | None, source: str = "frames") -> Subject:
    """Return the subject with ``frames`` as given, and as they would be if their rows were really
    in rotating order."""
    readings = [Reading(AS_GIVEN, frames)]
    wanted = np.asarray(frames.protocol.drive_measure, dtype=np.int64)
    rotating = source_table("rotating", frames.protocol)
    if not np.array_equal(rotating, wanted):
        index = match_rows(rotating, wanted).index
        moved = replace(
            frames,
            voltage_v=frames.voltage_v[:, index],
            reference_voltage_v=frames.reference_voltage_v[:, index],
        )
        readings.append(Reading("rotating", moved, "--order rotating"))
    unit_known = str(frames.meta.get("unit", "V")) == "V"
    return Subject(source, AS_GIVEN, tuple(readings), skin, (), unit_known)


def subject_from_source(
    path: Source,
    options: ImportOptions,
    protocol: Protocol | None,
    skin: Skin | None,
    n_electrodes: int | None = None,
) -> Subject:
    """Return the subject for anything that ``import`` reads, repaired as ``options`` say; a frames
    file without options is read by ``load_frames``.

    Unlike import, NaN and Inf are accepted, and if no untouched frames are named, the first frame
    is used as one.
    """
    files = source_files(path, SUFFIXES)
    named = str(files[0]) + (f" and {len(files) - 1} more" if len(files) > 1 else "")
    if len(files) == 1 and is_frames_file(files[0]) and options == ImportOptions():
        return subject_from_frames(load_frames(files[0], allow_nonfinite=True), skin, named)
    readings: list[Reading] = []
    refused: EitskinError | None = None
    own_table = (
        options.source.protocol_table is not None
        or options.table_file is not None
        or options.table is not None
        or files[0].suffix.lower() in INSTRUMENT_SUFFIXES
    )
    given = POTENTIALS if options.potentials else options.order
    for name in dict.fromkeys((given, *(() if own_table else (*ORDERS, *POTENTIALS_ORDERS)))):
        tried = replace(options, **_as_named(name, options))
        try:
            read = imported(files, tried, protocol, skin, n_electrodes, lenient=True)
        except (FrameError, UsageError) as error:
            if name == given and isinstance(error, UsageError):
                raise
            refused = refused or error
            continue
        readings.append(Reading(name, read.frames, _saying(name, given), read.sign))
    if not readings:
        raise refused if refused is not None else FrameError(f"{named}: no order fits")
    meta = readings[0].frames.meta
    unit_known = options.source.scale is not None or meta.get("unit") == "V"
    remarks = (str(meta["assumed"]),) if "assumed" in meta else ()
    return Subject(
        named,
        given,
        tuple(readings),
        skin,
        remarks,
        unit_known,
        offset=options.source.offset,
        scale=1.0 if options.source.scale is None else options.source.scale,
    )


def _as_named(name: str, options: ImportOptions) -> dict[str, Any]:
    """Return the changes of ``options`` for the reading ``name``."""
    if name == POTENTIALS:
        return {"potentials": True}
    if name in POTENTIALS_ORDERS:
        return {"potentials": True, "order": name.partition("-of-")[0], "sign": "signed"}
    if options.potentials:
        return {"potentials": False, "order": name}
    return {"order": name}


def _saying(name: str, given: str) -> str:
    if name == given:
        return ""
    if name in POTENTIALS_ORDERS:
        return f"--order {name.partition('-of-')[0]} --potentials"
    return f"--order {name}"
