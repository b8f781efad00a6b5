"""Import a file of another instrument as frames in this project's order, sign and units. Every step
is recorded in ``meta``.

The steps are, in this order: read the file, number the electrodes as the skin does, put the rows in
the protocol's order, undo exchanged wires, set the sign, negate rows, fill rows from their
reciprocals, leave rows out, equalise gains.
"""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin import __version__
from eitskin.arrays import IntArray
from eitskin.errors import FrameError, ProtocolError, UsageError
from eitskin.frames.eidors import with_eidors_defaults
from eitskin.frames.frames import Frames, load_frames
from eitskin.frames.homogeneous import homogeneous
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.orders import match_rows, relabel, source_table, swap_map
from eitskin.frames.placement import source_rows
from eitskin.frames.repair import equalising_gains, flipped, imputed, kept_rows, signed
from eitskin.frames.source import (
    RawFrames,
    SourceOptions,
    is_frames_file,
    read_source,
    refuse_nonfinite,
)
from eitskin.frames.tables import read_table
from eitskin.frames.truth import TruthOptions, truth_fields
from eitskin.skin.protocol import Protocol, pattern_name, table
from eitskin.skin.skin import Skin

ASSUMED_UNTOUCHED = "no untouched frames were named; the first frame is used as one"


def import_frames(
    path: str | Path,
    options: ImportOptions,
    protocol: Protocol | None,
    skin: Skin | None,
    n_electrodes: int | None = None,
    *,
    lenient: bool = False,
) -> Frames:
    """Read ``path`` and repair it as ``options`` say.

    ``protocol`` is the order of the result; with None or ``keep_table`` the source's own table is
    kept, with ``n_electrodes``. ``skin``, if known, gives the direction of numbering and the
    prediction. An eitskin frames file can be repaired again. ``lenient`` is for examination: it
    accepts NaN and Inf, and uses the first frame if no untouched frames are named.

    Raises:
        FileError: the file cannot be read.
        UsageError: options are missing, or contradict each other or the source.
        FrameError, ProtocolError: the content does not fit the options.
    """
    if Path(path).suffix.lower() == ".mat":
        options, n_electrodes = with_eidors_defaults(path, options, protocol, n_electrodes)
    raw, base, protocol = _read(path, options, protocol, n_electrodes)
    if not (lenient or options.impute_channels or options.drop_channels or options.drop_electrodes):
        refuse_nonfinite(raw, str(path))
    untouched = raw.reference
    if untouched is None:
        if not lenient:
            raise UsageError(
                f"{path}: say which frames are untouched: --reference KEY, --reference-columns"
                " LIST, --reference-frames A:B"
            )
        untouched = raw.voltage[:1]
    rows, index, sign = _placed(raw, options, protocol, skin, n_electrodes, str(path))
    voltage, reference = raw.voltage[:, index] * sign, untouched[:, index] * sign
    n = _count(protocol, n_electrodes)
    rows = relabel(rows, swap_map(n, options.swaps))
    predicted = options.sign == "magnitude" or options.equalise
    prediction = homogeneous(skin, n).voltages(rows) if predicted else None
    keep = kept_rows(rows, n, options.drop_channels, options.drop_electrodes)
    for_all = (rows, n, options.impute_channels)
    signs = (signed(values, options.sign, prediction) for values in (voltage, reference))
    turned = (flipped(values, options.flip_channels) for values in signs)
    voltage, reference = (imputed(values, *for_all)[:, keep] for values in turned)
    if options.equalise and prediction is not None:
        gain = equalising_gains(reference.mean(axis=0), prediction[keep])
        voltage, reference = voltage * gain, reference * gain
    if base is None:
        names = raw.names or tuple(str(k) for k in range(len(voltage)))
        box = None if skin is None else skin.outline.bounding_box_mm
        carried = {
            "time_s": raw.time_s,
            **truth_fields(raw.arrays, options.truth, names, box, str(path)),
        }
    else:
        names, carried = base.frame_name, {}
    current_a = options.current_a or (protocol.current_a if protocol is not None else 1e-3)
    fields = {
        "protocol": table(n, rows[keep], current_a),
        "voltage_v": voltage,
        "reference_voltage_v": reference,
        "frame_name": names,
        "meta": (
            _meta(path, options, base, skin)
            | ({"notes": list(raw.notes)} if raw.notes else {})
            | ({} if raw.reference is not None else {"assumed": ASSUMED_UNTOUCHED})
        ),
        "allow_nonfinite": lenient,
        **carried,
    }
    try:
        return Frames(**fields) if base is None else replace(base, **fields)
    except (FrameError, ProtocolError) as error:
        raise type(error)(f"{path}: {error}") from None


def _read(
    path: str | Path, options: ImportOptions, protocol: Protocol | None, n_electrodes: int | None
) -> tuple[RawFrames, Frames | None, Protocol | None]:
    """Return the raw frames. If ``path`` is already a frames file, return also its frames and their
    protocol."""
    if is_frames_file(path):
        if (
            options.source != SourceOptions()
            or options.table_file is not None
            or options.truth != TruthOptions()
        ):
            raise UsageError(
                f"{path}: already a frames file; options that say where its arrays are do not go"
                " with it"
            )
        frames = load_frames(path, allow_nonfinite=True)
        _check_protocol(path, frames, protocol)
        return RawFrames(frames.voltage_v, frames.reference_voltage_v), frames, frames.protocol
    counts, asked = accepted_counts(options, protocol)
    return read_source(path, options.source, counts, asked), None, protocol


def _check_protocol(path: str | Path, frames: Frames, protocol: Protocol | None) -> None:
    if protocol is not None and protocol.hash != frames.protocol.hash:
        raise ProtocolError(
            f"{path}: was made with another protocol, {pattern_name(frames.protocol)} of"
            f" {frames.protocol.n_electrodes} electrodes, than the {pattern_name(protocol)} of"
            f" {protocol.n_electrodes} that was given; leave those options out"
        )


def accepted_counts(
    options: ImportOptions, protocol: Protocol | None
) -> tuple[tuple[int, ...], str]:
    """Return how many rows a frame of the source may have, and words for the reason.

    Raises:
        UsageError: the options name no protocol.
    """
    if options.source.protocol_table is not None:
        return (), "its table"
    if options.table is not None:
        return (len(options.table),), "the layout's table"
    if options.table_file is not None:
        rows = read_table(options.table_file).cells
        return (len(rows),), f"the table {options.table_file}"
    if protocol is None:
        raise UsageError(
            "say which protocol: --skin FILE, --protocol PATTERN --electrodes N, or a table"
        )
    if options.order == "table":
        raise UsageError(
            "--order table needs --table-file FILE, or --protocol-table KEY of the source's own"
            " table"
        )
    n, count = protocol.n_electrodes, len(source_table(options.order, protocol))
    hint = (
        ""
        if options.order.endswith("-all")
        else f"; with pairs at driving electrodes {n * n}, --order fixed-all"
    )
    named = f"; adjacent and skip-N have {n * (n - 3)}, opposite {n * (n - 4)}"
    return (count,), f"{n} electrodes, --order {options.order}{hint}{named}"


def _placed(
    raw: RawFrames,
    options: ImportOptions,
    protocol: Protocol | None,
    skin: Skin | None,
    n_electrodes: int | None,
    where: str,
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the rows of the result (m, 4), and the index and sign (m,) of each in the source."""
    n = _count(protocol, n_electrodes)
    ours = source_rows(options, raw.table, protocol, skin, n, where)
    if protocol is None or options.keep_table:
        return ours, np.arange(len(ours)), np.ones(len(ours), dtype=np.int64)
    wanted = np.asarray(protocol.drive_measure, dtype=np.int64)
    match = match_rows(ours, wanted)
    return wanted, match.index, match.sign


def _count(protocol: Protocol | None, n_electrodes: int | None) -> int:
    if protocol is not None:
        return protocol.n_electrodes
    if n_electrodes is None:
        raise UsageError("say how many electrodes there are: --electrodes N")
    return n_electrodes


def _meta(
    path: str | Path, options: ImportOptions, base: Frames | None, skin: Skin | None
) -> dict[str, Any]:
    changed: dict[str, Any] = {}
    for group in (options, options.source, options.truth):
        defaults = type(group)()
        for name, value in asdict(group).items():
            if name not in ("source", "truth") and value != getattr(defaults, name):
                changed[name] = Path(value).name if name == "table_file" else value
    unit = "V" if options.source.scale is not None else "unknown, taken as V"
    if base is not None:
        unit = str(base.meta.get("unit", "V"))
    meta: dict[str, Any] = {
        "made_by": f"eitskin {__version__} import",
        "source": Path(path).name,
        "options": changed,
        "unit": unit,
    }
    if skin is not None:
        meta["skin"] = skin.name
    if base is not None:
        meta["before"] = dict(base.meta)
    return meta
