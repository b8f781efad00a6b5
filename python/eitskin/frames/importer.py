"""Import files of another instrument as frames in this project's order, sign and units. Every step
is recorded in ``meta``.

The steps are, in this order: read the files, number the electrodes as the skin does, put the rows
in the protocol's order, undo exchanged wires, set the sign, negate rows, fill rows from their
reciprocals, leave rows out, add the reference to differences, equalise gains.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin import __version__
from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import FrameError, ProtocolError, UsageError
from eitskin.frames.eidors import with_eidors_defaults
from eitskin.frames.frames import Frames, load_frames, refuse_recording
from eitskin.frames.homogeneous import homogeneous
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.orders import (
    GROUND,
    RowMatch,
    match_rows,
    relabel,
    source_table,
    swap_map,
)
from eitskin.frames.placement import refuse_contradictions, source_rows
from eitskin.frames.repair import equalising_gains, flipped, imputed, kept_rows, signed
from eitskin.frames.several_files import source_files
from eitskin.frames.source import (
    SUFFIXES,
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

USUAL_CHANGE = 0.05  # rms of the greatest change per rms of the reference, if that is unknown
ASSUMED_SCALE = (
    "the missing reference has the shape of a homogeneous skin and a size that makes the greatest"
    f" change {USUAL_CHANGE:.0%} of it: places are right, strengths mean nothing; with --skin FILE"
    " and --scale they do"
)
ASSUMED_UNTOUCHED = "no untouched frames were named; the first frame is used as one"


Source = str | Path | Sequence[str | Path]


@dataclass(frozen=True, eq=False)
class Imported:
    """The imported ``frames``, and the sign (m,) with which the source's numbers are in each
    row."""

    frames: Frames
    sign: FloatArray


def import_frames(
    path: Source,
    options: ImportOptions,
    protocol: Protocol | None,
    skin: Skin | None,
    n_electrodes: int | None = None,
    *,
    lenient: bool = False,
) -> Frames:
    """Read ``path`` (a file, a folder, a pattern, or several of them) and repair it as ``options``
    say.

    ``protocol`` is the order of the result; with None or ``keep_table`` the source's own table is
    kept, with ``n_electrodes``. ``skin``, if known, gives the direction of numbering and the
    prediction. An eitskin frames file can be repaired again. ``lenient`` is for examination: it
    accepts NaN and Inf, and uses the first frame if no untouched frames are named.

    Raises:
        FileError: the file cannot be read.
        UsageError: options are missing, or contradict each other or the source.
        FrameError, ProtocolError: the content does not fit the options.
    """
    return imported(path, options, protocol, skin, n_electrodes, lenient=lenient).frames


def imported(
    path: Source,
    options: ImportOptions,
    protocol: Protocol | None,
    skin: Skin | None,
    n_electrodes: int | None = None,
    *,
    lenient: bool = False,
) -> Imported:
    """As ``import_frames``, with the sign of each row."""
    files = source_files(path, SUFFIXES)
    if not files:
        raise UsageError("name a file to import")
    first, where = files[0], str(files[0])
    refuse_recording(first)
    refuse_contradictions(options, where)
    if Path(first).suffix.lower() == ".mat":
        options, n_electrodes = with_eidors_defaults(first, options, protocol, n_electrodes)
    raw, base, protocol = _read(files, options, protocol, n_electrodes)
    differences = options.differences or options.relative_differences
    untouched = raw.reference
    if untouched is None:
        if not (lenient or differences):
            raise UsageError(
                f"{where}: say which frames are untouched: --reference KEY, --reference-columns"
                " LIST, --reference-frames A:B, or --reference-file FILE; or say --differences if"
                " the reference was subtracted already"
            )
        untouched = np.zeros_like(raw.voltage[:1]) if differences else raw.voltage[:1]
    rows, match = _placed(raw, options, protocol, skin, n_electrodes, where)
    if not (lenient or options.impute_channels or options.drop_channels or options.drop_electrodes):
        refuse_nonfinite(raw, match.used, where)
    voltage, reference = match.taken_from(raw.voltage), match.taken_from(untouched)
    n = _count(protocol, n_electrodes)
    rows = relabel(rows, swap_map(n, options.swaps))
    predicted = options.sign == "magnitude" or options.equalise or differences
    prediction = homogeneous(skin, n).voltages(rows) if predicted else None
    keep = kept_rows(rows, n, options.drop_channels, options.drop_electrodes)
    for_all = (rows, n, options.impute_channels)
    signs = (signed(values, options.sign, prediction) for values in (voltage, reference))
    turned = (flipped(values, options.flip_channels) for values in signs)
    voltage, reference = (imputed(values, *for_all)[:, keep] for values in turned)
    own_current_a = raw.current_a or (protocol.current_a if protocol is not None else 1e-3)
    current_a = options.current_a or own_current_a
    notes = list(raw.notes)
    if differences and prediction is not None:
        missing = prediction[keep] * current_a
        relative, known = options.relative_differences, raw.in_volts or options.source.scale
        if not relative and (skin is None or not known):
            missing = missing * _scale_to_changes(missing, voltage)
            notes.append(ASSUMED_SCALE)
        voltage, reference = (
            missing * (1 + values) if relative else missing + values
            for values in (voltage, reference)
        )
    if options.equalise and prediction is not None:
        gain = equalising_gains(reference.mean(axis=0), prediction[keep])
        voltage, reference = voltage * gain, reference * gain
    if base is None:
        names = raw.names or tuple(str(k) for k in range(len(voltage)))
        box = None if skin is None else skin.outline.bounding_box_mm
        carried = {
            "time_s": raw.time_s,
            **truth_fields(raw.arrays, options.truth, names, box, where),
        }
    else:
        names, carried = base.frame_name, {}
    assumed = raw.reference is None and not differences
    fields = {
        "protocol": table(n, rows[keep], current_a),
        "voltage_v": voltage,
        "reference_voltage_v": reference,
        "frame_name": names,
        "meta": (
            _meta(first, options, base, skin, raw)
            | ({"files": len(files)} if len(files) > 1 else {})
            | ({"notes": notes} if notes else {})
            | ({"assumed": ASSUMED_UNTOUCHED} if assumed else {})
        ),
        "allow_nonfinite": lenient,
        **carried,
    }
    try:
        frames = Frames(**fields) if base is None else replace(base, **fields)
    except (FrameError, ProtocolError) as error:
        raise type(error)(f"{where}: {error}") from None
    sign = np.where(match.minus >= 0, 0.0, match.sign)
    return Imported(frames, (-sign if options.sign == "reversed" else sign)[keep])


def _read(
    files: list[Path],
    options: ImportOptions,
    protocol: Protocol | None,
    n_electrodes: int | None,
) -> tuple[RawFrames, Frames | None, Protocol | None]:
    """Return the raw frames. If the only file is already a frames file, return also its frames and
    their protocol."""
    done = [file for file in files if is_frames_file(file)]
    if done and len(files) > 1:
        raise UsageError(f"{done[0]}: already a frames file; it cannot be joined with others")
    if done:
        path, offset = files[0], options.source.offset
        if (
            options.source != SourceOptions(offset=offset)
            or options.table_file is not None
            or options.truth != TruthOptions()
            or options.potentials
        ):
            raise UsageError(
                f"{path}: already a frames file; options that say where its arrays are do not go"
                " with it"
            )
        frames = load_frames(path, allow_nonfinite=True)
        _check_protocol(path, frames, protocol)
        raw = RawFrames(frames.voltage_v + offset, frames.reference_voltage_v + offset)
        return raw, frames, frames.protocol
    counts, asked = accepted_counts(options, protocol)
    return read_source(files, options.source, counts, asked), None, protocol


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
    n = protocol.n_electrodes
    count = len(source_table(options.order, protocol, potentials=options.potentials))
    if options.potentials:
        return (count,), f"{n} electrodes, --potentials"
    hint = (
        ""
        if options.order.endswith("-all")
        else f"; with pairs at driving electrodes {n * n}, --order fixed-all; the potentials of all"
        f" electrodes {n * n}, --potentials"
    )
    named = f"; adjacent and skip-N have {n * (n - 3)}, opposite {n * (n - 4)}"
    return (count,), f"{n} electrodes, --order {options.order}{hint}{named}"


def _scale_to_changes(missing: FloatArray, changes: FloatArray) -> float:
    """Return the factor that makes the greatest of ``changes`` (n, m) USUAL_CHANGE of ``missing``
    (m,)."""
    finite = np.where(np.isfinite(changes), changes, 0.0)
    greatest = float(np.linalg.norm(finite, axis=1).max(initial=0.0))
    level = float(np.linalg.norm(missing))
    return greatest / (USUAL_CHANGE * level) if greatest > 0 and level > 0 else 1.0


def _placed(
    raw: RawFrames,
    options: ImportOptions,
    protocol: Protocol | None,
    skin: Skin | None,
    n_electrodes: int | None,
    where: str,
) -> tuple[IntArray, RowMatch]:
    """Return the rows of the result (m, 4), and where each is in the source."""
    n = _count(protocol, n_electrodes)
    ours = source_rows(options, raw.table, protocol, skin, n, where)
    if protocol is None or options.keep_table:
        if (ours[:, 3] == GROUND).any():
            raise UsageError(
                f"{where}: its rows are potentials; state the pairs whose differences are needed:"
                " --skin FILE, or --protocol KIND --electrodes N"
            )
        each = np.arange(len(ours))
        return ours, RowMatch(each, np.full_like(each, -1), np.ones_like(each))
    wanted = np.asarray(protocol.drive_measure, dtype=np.int64)
    return wanted, match_rows(ours, wanted)


def _count(protocol: Protocol | None, n_electrodes: int | None) -> int:
    if protocol is not None:
        return protocol.n_electrodes
    if n_electrodes is None:
        raise UsageError("say how many electrodes there are: --electrodes N")
    return n_electrodes


def _meta(
    path: str | Path,
    options: ImportOptions,
    base: Frames | None,
    skin: Skin | None,
    raw: RawFrames,
) -> dict[str, Any]:
    changed: dict[str, Any] = {}
    for group in (options, options.source, options.truth):
        defaults = type(group)()
        for name, value in asdict(group).items():
            if name not in ("source", "truth") and value != getattr(defaults, name):
                of_file = name in ("table_file", "reference_file")
                changed[name] = Path(value).name if of_file else value
    known = options.source.scale is not None or raw.in_volts or options.relative_differences
    unit = "V" if known else "unknown, taken as V"
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
