"""Read a measured source (text, NPY, NPZ, MAT or a device's own file; one or several) as frames
whose channels are still in the source's own order."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from eitskin.arrays import AnyArray, FloatArray, IntArray
from eitskin.errors import EitskinError, FrameError, UsageError
from eitskin.frames.arrays import listing, pick, read_arrays, read_npz
from eitskin.frames.frames import FORMAT
from eitskin.frames.instrument_files import InstrumentFile, read_instrument_file
from eitskin.frames.lines import COMMENT, LineFormat
from eitskin.frames.pairs import (
    PAIRS,
    Paired,
    all_magnitudes,
    paired,
    refuse_parts,
    shifted,
    to_complex,
)
from eitskin.frames.several_files import source_files
from eitskin.frames.tables import TextTable, chosen, counting_column, read_table

TEXT_SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".log")
ARRAY_SUFFIXES = (".npz", ".npy", ".mat")
INSTRUMENT_SUFFIXES = (".eit", ".get")
SUFFIXES = (*TEXT_SUFFIXES, *ARRAY_SUFFIXES, *INSTRUMENT_SUFFIXES)
SPREADSHEETS = (".xlsx", ".xls", ".ods", ".numbers")
MIN_LINES, MIN_LINE = 4, 4  # of a frame over several lines without a label
FRAMES_IN = ("auto", "rows", "columns")
COMPLEX_PARTS = ("real", "imag", "abs", "in-phase")


@dataclass(frozen=True)
class SourceOptions:
    """The places of frames in a source.

    For NPZ and MAT, ``voltage``, ``reference``, ``names``, ``time`` and ``protocol_table`` name
    arrays. For text, ``columns`` and ``reference_columns`` choose columns ("2", "0,2", "1:209",
    "0:416:2", header names), and ``time`` one column, whose numbers times ``time_scale`` are
    seconds.

    ``reference_frames`` chooses the untouched frames among the frames; ``reference_file`` names
    another source, all of whose frames are untouched. ``offset`` is added to the source's numbers,
    and then ``scale`` converts them to V (None: unknown, taken as 1). ``frames_in`` tells whether
    the frames of a table are rows or columns. ``complex_part`` is what to keep of complex numbers;
    in text, columns then come in ``pairs``, one of PAIRS (None: as the header says).
    ``delimiter``, ``label`` and ``comment`` are as in ``lines.LineFormat``; ``cells`` is the number
    of cells in each line, if known.
    """

    voltage: str | None = None
    reference: str | None = None
    columns: str | None = None
    reference_columns: str | None = None
    reference_frames: str | None = None
    reference_file: str | None = None
    names: str | None = None
    time: str | None = None
    protocol_table: str | None = None
    table_base: int = 0
    frames_in: str = "auto"
    complex_part: str | None = None
    scale: float | None = None
    offset: float = 0.0
    delimiter: str | None = None
    header_rows: int | None = None
    label: str | None = None
    skip_bad_lines: bool = False
    pairs: str | None = None
    time_scale: float = 1.0
    comment: tuple[str, ...] = COMMENT
    cells: int | None = None


@dataclass(frozen=True, eq=False)
class ReadText:
    """The way in which a text with frames in rows was read: the form of its lines, the number of
    cells in each, the columns of the channels (in pairs the first and the second by turns), and the
    column of the time."""

    form: LineFormat
    header_rows: int
    cells: int
    columns: tuple[int, ...]
    pairs: str | None
    time: int | None
    one_delimiter: bool = True  # the same for all files: that of ``form``


@dataclass(frozen=True, eq=False)
class RawFrames:
    """Frames in the order of the source: ``voltage`` (n, rows), and ``reference`` (k, rows) or None
    if none was named.

    ``table`` (rows, 4) is the source's own protocol, if it has one. ``arrays`` is everything that
    an NPZ or MAT file holds. ``notes`` are for the user. ``text`` describes how text was read.
    ``current_a`` is the drive current and ``in_volts`` the unit, if the source states them.
    """

    voltage: AnyArray
    reference: AnyArray | None
    names: tuple[str, ...] = ()
    time_s: FloatArray | None = None
    table: IntArray | None = None
    arrays: Mapping[str, AnyArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    text: ReadText | None = None
    current_a: float | None = None
    in_volts: bool = False


def is_frames_file(path: str | Path) -> bool:
    """Return whether ``path`` is an .npz in this project's frames format, of any version."""
    if Path(path).suffix.lower() != ".npz":
        return False
    return str(read_npz(path, "file of arrays", ("format",)).get("format")) == FORMAT


def read_source(
    path: str | Path | Sequence[str | Path],
    options: SourceOptions,
    row_counts: Iterable[int],
    asked: str,
) -> RawFrames:
    """Read ``path``: a file, a folder, a pattern, or several of them, whose frames are put one
    after another (``several_files.source_files``). A frame may have any of ``row_counts`` channels;
    ``asked`` gives the reason in errors.

    Raises:
        FileError: the file cannot be read.
        UsageError: options contradict each other or the kind of file.
        FrameError: an array or column is missing, has another shape, or holds no numbers.
        MissingExtraError: a .mat file needs scipy.
    """
    _check_words(options)
    counts = tuple(row_counts)
    own = options.reference_file
    untouched = () if own is None else source_files(own, SUFFIXES)
    files = source_files(path, SUFFIXES, left_out=untouched)
    raw = _joined([_read_one(file, options, counts, asked) for file in files], files)
    if own is not None:
        if raw.reference is not None or options.reference_frames is not None:
            raise UsageError("--reference-file does not go with another reference; name one")
        raw = replace(raw, reference=_reference_from(untouched, options, raw.voltage.shape[1]))
    return _finish(raw, options)


def _read_one(
    path: Path, options: SourceOptions, row_counts: tuple[int, ...], asked: str
) -> RawFrames:
    suffix = path.suffix.lower()
    if suffix in TEXT_SUFFIXES:
        return _from_text(path, options, row_counts, asked)
    if suffix in ARRAY_SUFFIXES:
        return _from_arrays(path, options, row_counts, asked)
    if suffix in INSTRUMENT_SUFFIXES:
        return _from_instrument(path, options)
    hint = "; save the sheet as CSV" if suffix in SPREADSHEETS else ""
    raise UsageError(f"{path}: the suffix {suffix!r} is not known; use {', '.join(SUFFIXES)}{hint}")


def _from_instrument(path: Path, options: SourceOptions) -> RawFrames:
    of_others = ("voltage", "reference", "names", "protocol_table", "columns", "reference_columns")
    _refuse(
        options, (*of_others, "time", "delimiter", "header_rows", "label", "pairs"), path.suffix
    )
    read: InstrumentFile = read_instrument_file(path)
    if options.offset and np.iscomplexobj(read.voltage):
        raise UsageError(f"--offset {options.offset:g} goes with real numbers; {path} has complex")
    return RawFrames(
        voltage=read.voltage + options.offset,
        reference=None,
        time_s=read.time_s,
        table=read.table,
        notes=read.notes,
        current_a=read.current_a,
        in_volts=read.in_volts,
    )


def _reference_from(files: Sequence[Path], options: SourceOptions, count: int) -> AnyArray:
    """Return all frames of files that hold the untouched frames alone. Text may lack the columns
    that ``options`` leave out, and have another delimiter and header unless these are given."""
    kept = replace(
        options,
        reference=None,
        reference_file=None,
        reference_columns=None,
        reference_frames=None,
        names=None,
        time=None,
        protocol_table=None,
    )
    read = []
    for file in files:
        of_text = file.suffix.lower() in TEXT_SUFFIXES
        own = replace(kept, voltage=None)
        if not of_text:
            own = replace(own, columns=None, delimiter=None, header_rows=None, label=None)
            own = replace(own, pairs=None, cells=None)
        if file.suffix.lower() in ARRAY_SUFFIXES:
            arrays = read_arrays(file)
            wanted = (options.reference, "vh", options.voltage)
            own = replace(own, voltage=next((name for name in wanted if name in arrays), None))
        read.append(_read_untouched(file, own, count))
    return _joined(read, files).voltage


def _read_untouched(file: Path, options: SourceOptions, count: int) -> RawFrames:
    """Read a file of untouched frames as the other frames are read; if it cannot be read so, then
    with all of its columns, or with a delimiter of its own."""
    guessed = replace(options, delimiter=None, header_rows=None, cells=None, label=None)
    tries = (options, replace(options, columns=None), guessed, replace(guessed, columns=None))
    refused: EitskinError | None = None
    for tried in tries:
        try:
            return _read_one(file, tried, (count,), "as the other frames have")
        except (UsageError, FrameError) as error:
            refused = refused or error
    assert refused is not None
    raise refused


def _joined(parts: Sequence[RawFrames], files: Sequence[Path]) -> RawFrames:
    """Return the frames of several files, one after another."""
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    names: list[str] = []
    for part, file in zip(parts, files, strict=True):
        if part.voltage.shape[1] != first.voltage.shape[1]:
            raise FrameError(
                f"{file}: its frames have {part.voltage.shape[1]} channels, those of {files[0]}"
                f" {first.voltage.shape[1]}; leave it out"
            )
        if not _same_table(part.table, first.table):
            raise FrameError(f"{file}: has another table of rows than {files[0]}; leave it out")
        own = part.names or tuple(map(str, range(len(part.voltage))))
        names += [file.stem] if len(own) == 1 else [f"{file.stem}:{name}" for name in own]
    references = [part.reference for part in parts if part.reference is not None]
    times = [part.time_s for part in parts if part.time_s is not None]
    texts = [part.text for part in parts if part.text is not None]
    text = texts[0] if len(texts) == len(parts) else None
    if text is not None and len({read.form.delimiter for read in texts}) > 1:
        text = replace(text, one_delimiter=False)
    return replace(
        first,
        voltage=np.vstack([part.voltage for part in parts]),
        reference=np.vstack(references) if references else None,
        names=tuple(names),
        time_s=np.concatenate(times) if len(times) == len(parts) else None,
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        text=text,
    )


def _same_table(one: IntArray | None, other: IntArray | None) -> bool:
    return np.array_equal(one, other) if one is not None and other is not None else one is other


def electrode_table(rows: AnyArray, base: int, where: str) -> IntArray:
    """Return a source's protocol table as (rows, 4) electrodes from 0; ``base`` is the source's
    number of its first electrode."""
    table = np.asarray(rows)
    if (
        table.ndim != 2
        or table.shape[1] != 4
        or table.dtype.kind not in "fiu"
        or not np.isfinite(table).all()
        or (table != np.round(table)).any()
    ):
        raise FrameError(
            f"{where}: a protocol table is (rows, 4) whole numbers [I+, I-, V+, V-], not"
            f" {table.shape}"
        )
    return table.astype(np.int64) - base


def refuse_nonfinite(raw: RawFrames, used: IntArray, where: str) -> None:
    """Raise a FrameError if a voltage in one of the rows ``used`` is not finite."""
    for what, values in (("frames", raw.voltage), ("reference", raw.reference)):
        if values is None:
            continue
        bad = np.argwhere(~np.isfinite(values[:, used]))
        if len(bad):
            frame, row = int(bad[0, 0]), int(used[bad[0, 1]])
            raise FrameError(
                f"{where}: {what}: frame {frame}, row {row} (from 0) is {values[frame, row]}"
                f" ({len(bad)} such values); repair the source, or leave those frames out"
            )


def _check_words(options: SourceOptions) -> None:
    for name, value, known in (
        ("frames-in", options.frames_in, FRAMES_IN),
        ("complex-part", options.complex_part, (None, *COMPLEX_PARTS)),
        ("pairs", options.pairs, (None, *PAIRS)),
    ):
        if value not in known:
            raise UsageError(
                f"--{name} {value}: use one of {', '.join(word for word in known if word)}"
            )
    if options.scale is not None and not (np.isfinite(options.scale) and options.scale != 0):
        raise UsageError(f"--scale {options.scale:g}: must be finite and not 0")
    if not np.isfinite(options.offset):
        raise UsageError(f"--offset {options.offset:g}: must be finite")
    if not (np.isfinite(options.time_scale) and options.time_scale > 0):
        raise UsageError(f"--time-scale {options.time_scale:g}: must be finite and above 0")
    if options.pairs is not None and options.complex_part is None:
        raise UsageError(
            f"--pairs {options.pairs} goes with --complex-part, which says what to keep of them"
        )


def _refuse(options: SourceOptions, names: Iterable[str], kind: str) -> None:
    for name in names:
        if getattr(options, name) is not None:
            raise UsageError(f"--{name.replace('_', '-')} does not go with a {kind} file")


def _from_text(
    path: Path, options: SourceOptions, row_counts: tuple[int, ...], asked: str
) -> RawFrames:
    _refuse(options, ("voltage", "reference", "names", "protocol_table"), "text")
    pairs_wanted = options.complex_part is not None
    table = read_table(
        path,
        options.delimiter,
        options.header_rows,
        options.label,
        skip_bad_lines=options.skip_bad_lines,
        comment=options.comment,
        cells=options.cells,
        fits=(*row_counts, *(2 * n for n in row_counts if pairs_wanted)),
    )
    untouched = _columns(table, options.reference_columns, "--reference-columns")
    time = _columns(table, options.time, "--time")
    columns = _columns(table, options.columns, "--columns")
    notes = list(table.notes)
    if columns is None:
        named = {*(untouched or ()), *(time or ())}
        columns = tuple(k for k in range(table.n_columns) if k not in named)
        fitting = len(columns) in row_counts or len(columns) in (2 * n for n in row_counts)
        if 0 in columns and not fitting and counting_column(table):
            notes.append("the first column counts the rows and is left out")
            columns = columns[1:]
    where = f"{path}: {len(table.cells)} rows, {len(columns)} chosen columns"
    values, pairs = _numbers(table, columns, options, "--columns", notes)
    asked = f"{asked}; {table.found}"
    reference = None
    if untouched is not None:
        reference, _ = _numbers(table, untouched, options, "--reference-columns", notes)
    lines = _lines_of_a_frame(values.shape, row_counts, options.frames_in)
    if lines > 1:
        notes.append(f"{lines} lines of {values.shape[1]} numbers are taken for one frame")
        values = values.reshape(len(values) // lines, -1)
        if time is not None:
            raise UsageError(f"{path}: --time names one column, and needs a frame in each row")
    in_rows = lines > 1 or _frames_in_rows(
        values.shape, row_counts, options.frames_in, where, asked
    )
    if in_rows and untouched is not None:
        raise UsageError(
            "--reference-columns needs channels in rows; where frames are rows use"
            " --reference-frames"
        )
    if not in_rows:
        values, reference = values.T, None if reference is None else reference.T
    if time is not None and (not in_rows or len(time) != 1):
        raise UsageError("--time names one column, and needs frames in rows")
    names: tuple[str, ...] = ()
    if not in_rows and table.header and options.complex_part is None:
        names = tuple(table.header[k] for k in columns)
    read = None
    if in_rows and lines == 1:
        order = columns if pairs is None else _interleaved(columns, pairs)
        how = None if pairs is None else pairs.how
        at = None if time is None else time[0]
        read = ReadText(table.form, table.header_rows, table.n_columns, order, how, at)
    times = None if time is None else table.numbers(time)[:, 0] * options.time_scale
    if times is not None and np.iscomplexobj(times):
        raise FrameError(f"{path}: --time {options.time}: the times are complex numbers")
    return RawFrames(values, reference, names, times, notes=tuple(dict.fromkeys(notes)), text=read)


def _lines_of_a_frame(shape: tuple[int, ...], row_counts: tuple[int, ...], frames_in: str) -> int:
    """Return how many lines make a frame: more than one where neither side fits, but a line for
    each drive does."""
    rows, columns = shape
    if frames_in != "auto" or rows in row_counts or columns in row_counts or columns < MIN_LINE:
        return 1
    for count in row_counts:
        lines = count // columns
        if lines >= MIN_LINES and lines * columns == count and rows % lines == 0:
            return lines
    return 1


def _numbers(
    table: TextTable,
    columns: tuple[int, ...],
    options: SourceOptions,
    option: str,
    notes: list[str],
) -> tuple[AnyArray, Paired | None]:
    """Return the chosen columns as numbers (complex for pairs), and how they formed pairs."""
    values = table.numbers(columns)
    _refuse_complex_offset(values, options)
    names = tuple(table.header[k] for k in columns) if table.header else ()
    if options.complex_part is None:
        refuse_parts(names, option)
        if all_magnitudes(names):
            notes.append(
                "the header calls the columns magnitudes; --sign magnitude gives them signs"
            )
        return values + options.offset, None
    if np.iscomplexobj(values):
        return values, None
    pairs = paired(names, values, options.pairs, option)
    return to_complex(shifted(values, pairs, options.offset), pairs), pairs


def _refuse_complex_offset(values: AnyArray, options: SourceOptions) -> None:
    if options.offset and np.iscomplexobj(values):
        raise UsageError(f"--offset {options.offset:g} goes with real numbers; these are complex")


def _interleaved(columns: tuple[int, ...], pairs: Paired) -> tuple[int, ...]:
    """Return the columns of ``pairs``, first and second by turns."""
    both = zip(pairs.first, pairs.second, strict=True)
    return tuple(columns[k] for pair in both for k in pair)


def _from_arrays(
    path: Path, options: SourceOptions, row_counts: tuple[int, ...], asked: str
) -> RawFrames:
    kind = Path(path).suffix[1:].upper()
    of_text = ("columns", "reference_columns", "delimiter", "header_rows", "label", "pairs")
    _refuse(options, of_text, kind)
    arrays, where = read_arrays(path), str(path)
    if options.voltage is None and len(arrays) == 1:
        options = replace(options, voltage=next(iter(arrays)))
    if options.voltage is None:
        raise UsageError(
            f"{where}: say with --voltage KEY which array holds the frames; it holds"
            f" {listing(arrays)}"
        )
    table = None
    if options.protocol_table is not None:
        given = pick(arrays, options.protocol_table, "--protocol-table", where)
        table = electrode_table(given, options.table_base, f"{where}: {options.protocol_table}")
        row_counts, asked = (len(table),), f"its table {options.protocol_table}"
    voltage, in_rows = _frames_of(
        arrays, options.voltage, "--voltage", row_counts, options.frames_in, where, asked
    )
    reference = None
    if options.reference is not None:
        frames_in = options.frames_in
        if in_rows is not None:
            frames_in = "rows" if in_rows else "columns"
        counts = (voltage.shape[1],)
        reference, _ = _frames_of(
            arrays, options.reference, "--reference", counts, frames_in, where, "the frames"
        )
    names: tuple[str, ...] = ()
    if options.names is not None:
        given = pick(arrays, options.names, "--names", where)
        names = tuple(map(str, np.atleast_1d(given).ravel()))
    times = None
    if options.time is not None:
        times = _times(pick(arrays, options.time, "--time", where), f"{where}: {options.time}")
    _refuse_complex_offset(voltage, options)
    shift = options.offset
    return RawFrames(
        voltage + shift if shift else voltage,
        reference + shift if shift and reference is not None else reference,
        names,
        times,
        table,
        arrays,
    )


def _times(values: AnyArray, where: str) -> FloatArray:
    if values.dtype.kind not in "fiu":
        raise FrameError(f"{where}: holds {values.dtype}, not times")
    return np.atleast_1d(values).ravel().astype(np.float64)


def _finish(raw: RawFrames, options: SourceOptions) -> RawFrames:
    """Separate the untouched frames from the others, convert complex numbers to real ones, and
    scale everything."""
    voltage, reference, names, times = raw.voltage, raw.reference, raw.names, raw.time_s
    if options.reference_frames is not None:
        if reference is not None:
            raise UsageError("--reference-frames does not go with another reference; name one")
        untouched = chosen(options.reference_frames, len(voltage), (), "--reference-frames")
        rest = [k for k in range(len(voltage)) if k not in set(untouched)]
        reference, voltage = voltage[list(untouched)], voltage[rest]
        names = tuple(names[k] for k in rest) if names else ()
        times = None if times is None else times[rest]
    if np.iscomplexobj(voltage) or (reference is not None and np.iscomplexobj(reference)):
        part = options.complex_part or ("in-phase" if raw.in_volts else None)
        if part is None:
            raise UsageError(
                "the numbers are complex; say with --complex-part which part:"
                f" {', '.join(COMPLEX_PARTS)}"
            )
        phase = _common_phase(voltage[:1] if reference is None else reference)
        voltage = _part(voltage, part, phase)
        reference = None if reference is None else _part(reference, part, phase)
    elif options.complex_part is not None:
        raise UsageError(
            f"--complex-part {options.complex_part}: the numbers are real; leave it out, and where"
            " they are magnitudes say --sign magnitude"
        )
    factor = 1.0 if options.scale is None else options.scale
    return replace(
        raw,
        voltage=np.asarray(voltage, dtype=np.float64) * factor,
        reference=None if reference is None else np.asarray(reference, dtype=np.float64) * factor,
        names=names,
        time_s=times,
    )


def _common_phase(values: AnyArray) -> float:
    """Return the phase (radians, within +-pi/2) that brings ``values`` closest to the real axis:
    half the angle of sum z^2."""
    finite = np.asarray(values)[np.isfinite(values)]
    return float(np.angle((finite.astype(np.complex128) ** 2).sum()) / 2)


def _part(values: AnyArray, part: str, phase: float) -> FloatArray:
    if part == "abs":
        return np.asarray(np.abs(values))
    if part == "imag":
        return np.asarray(np.imag(values), dtype=np.float64)
    return np.asarray(
        (values * np.exp(-1j * phase) if part == "in-phase" else values).real, dtype=np.float64
    )


def _frames_of(
    arrays: Mapping[str, AnyArray],
    key: str,
    option: str,
    row_counts: tuple[int, ...],
    frames_in: str,
    where: str,
    asked: str,
) -> tuple[AnyArray, bool | None]:
    """Return the array ``key`` as (frames, channels), and whether its frames were rows (None: it is
    one frame)."""
    values = pick(arrays, key, option, where)
    where = f"{where}: {key} {values.shape}"
    if values.dtype.kind not in "fiuc":
        raise FrameError(f"{where}: holds {values.dtype}, not numbers")
    if values.ndim == 1 and len(values) in row_counts:
        return values[None, :], None
    if values.ndim != 2:
        raise FrameError(
            f"{where}: must be (frames, channels) or (channels,); {_wanted(row_counts, asked)}"
        )
    in_rows = _frames_in_rows(values.shape, row_counts, frames_in, where, asked)
    return values if in_rows else values.T, in_rows


def _frames_in_rows(
    shape: tuple[int, ...], row_counts: tuple[int, ...], frames_in: str, where: str, asked: str
) -> bool:
    rows, columns = (side in row_counts for side in shape)
    if frames_in == "auto":
        if rows and columns:
            raise UsageError(f"{where}: both sides fit; say --frames-in rows or columns")
        if rows or columns:
            return columns
        raise FrameError(f"{where}: {_wanted(row_counts, asked)}")
    in_rows = frames_in == "rows"
    if not (columns if in_rows else rows):
        raise FrameError(f"{where}: with --frames-in {frames_in} {_wanted(row_counts, asked)}")
    return in_rows


def _wanted(row_counts: tuple[int, ...], asked: str) -> str:
    return (
        f"a frame should have {' or '.join(map(str, sorted(set(row_counts))))} channels ({asked})"
    )


def _columns(table: TextTable, spec: str | None, option: str) -> tuple[int, ...] | None:
    return None if spec is None else chosen(spec, table.n_columns, table.header, option)
