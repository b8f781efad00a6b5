"""A layout describes in a TOML file how the lines of an instrument form frames
(docs/reference/layout.md). It is used for files and for live lines."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray
from eitskin.config import (
    check_keys,
    choice,
    flag,
    integer,
    load_toml,
    number,
    plain_number,
    subtable,
)
from eitskin.errors import ConfigError, EitskinError, UsageError
from eitskin.fileio import write_bytes
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.lines import LineFormat, Row, parse_cell
from eitskin.frames.orders import GROUND, ORDERS
from eitskin.frames.pairs import PAIRS, Paired, shifted, to_complex
from eitskin.frames.placement import table_rows
from eitskin.frames.repair import SIGNS
from eitskin.frames.source import COMPLEX_PARTS, RawFrames, SourceOptions
from eitskin.frames.tables import chosen
from eitskin.skin.electrodes import MAX_COUNT, MIN_COUNT
from eitskin.skin.protocol import Protocol, protocol_from_table, protocol_to_table

# the type of each key: text, texts, flag, number, whole, wholes, or the words to choose from
LINES: dict[str, Any] = {
    "delimiter": "text", "label": "text", "comment": "texts", "cells": "whole",
    "columns": "text", "header_rows": "whole",
    "skip_bad_lines": "flag", "time": "text", "time_scale": "number",
    "complex_part": COMPLEX_PARTS, "pairs": PAIRS, "scale": "number", "offset": "number",
    "reference_frames": "text", "reference_file": "text",
}  # fmt: skip
CHANNELS: dict[str, Any] = {
    "order": (*ORDERS, "table"), "potentials": "flag", "differences": "flag",
    "relative_differences": "flag", "sign": SIGNS, "rotate": "whole", "mirror": "flag",
    "clockwise": "flag", "flip_channels": "wholes", "impute_channels": "wholes",
    "drop_channels": "wholes", "drop_electrodes": "wholes", "equalise": "flag",
    "current_a": "number",
}  # fmt: skip
MAX_CELLS, MAX_BAUD, MAX_RATE_HZ = 1_000_000, 20_000_000, 10_000.0
MOST_BAD = 0.5  # a line with a larger part of bad cells is not a frame
TOO_LARGE = 1e12


@dataclass(frozen=True)
class Layout:
    """The format in which lines form frames.

    ``options`` are those that ``import`` needs. ``protocol`` is that of the frames if it is not the
    model's. ``baud``, ``send`` (a text sent once, when the port is opened) and ``rate_hz`` (frames
    per second) describe a live instrument.
    """

    options: ImportOptions = field(default_factory=ImportOptions)
    protocol: Protocol | None = None
    baud: int | None = None
    send: str | None = None
    rate_hz: float | None = None

    @property
    def form(self) -> LineFormat:
        """The format by which a line is divided into cells."""
        source = self.options.source
        return LineFormat(source.delimiter or "comma", source.label, source.comment)


def load_layout(path: str | Path) -> Layout:
    """Read a layout.

    Raises:
        FileError, ConfigError, ProtocolError: the file cannot be read, or a key is unknown or
            wrong.
    """
    content, where = load_toml(path, "layout"), str(path)
    check_keys(content, ("lines", "channels", "protocol", "port"), where)
    lines, channels, protocol, port = (
        subtable(content, name, where) for name in ("lines", "channels", "protocol", "port")
    )
    check_keys(lines, LINES, f"{where}: [lines]")
    check_keys(channels, (*CHANNELS, "table", "swaps"), f"{where}: [channels]")
    check_keys(port, ("baud", "send", "rate_hz"), f"{where}: [port]")
    source = SourceOptions(**_values(lines, LINES, f"{where}: [lines]"))
    options = ImportOptions(source=source, **_values(channels, CHANNELS, f"{where}: [channels]"))
    in_channels = f"{where}: [channels]"
    if "table" in channels:
        rows = _rows(channels["table"], 4, f"{in_channels}: table", GROUND)
        options = replace(options, order="table", table=rows)
    if "swaps" in channels:
        options = replace(options, swaps=_rows(channels["swaps"], 2, f"{in_channels}: swaps"))
    layout = Layout(
        options,
        _protocol(protocol, f"{where}: [protocol]"),
        _whole(port, "baud", f"{where}: [port]", MAX_BAUD),
        _text(port, "send", f"{where}: [port]") if "send" in port else None,
        _number(port, "rate_hz", f"{where}: [port]", MAX_RATE_HZ),
    )
    try:
        _ = layout.form
    except UsageError as error:
        raise ConfigError(f"{where}: [lines]: {error}") from None
    return layout


def save_layout(path: str | Path, layout: Layout) -> None:
    """Write ``layout`` to ``path``, without values that equal their defaults."""
    options, port = layout.options, {}
    lines = _changed(options.source, LINES)
    channels = _changed(options, CHANNELS)
    rows = table_rows(options)
    if rows is not None:
        channels |= {"order": "table", "table": rows.tolist()}
    if options.swaps:
        channels["swaps"] = [list(pair) for pair in options.swaps]
    for name in ("baud", "send", "rate_hz"):
        if getattr(layout, name) is not None:
            port[name] = getattr(layout, name)
    protocol: dict[str, Any] = {}
    if layout.protocol is not None:
        protocol = {
            "electrodes": layout.protocol.n_electrodes,
            **protocol_to_table(layout.protocol),
        }
    tables = {"lines": lines, "channels": channels, "protocol": protocol, "port": port}
    text = "# How an instrument's lines are frames; see docs/reference/layout.md of eitskin.\n"
    for name, values in tables.items():
        if values:
            text += f"\n[{name}]\n"
            text += "".join(f"{key} = {_toml(value)}\n" for key, value in values.items())
    write_bytes(path, text.encode())


def layout_of(
    raw: RawFrames, options: ImportOptions, protocol: Protocol | None, where: str
) -> Layout:
    """Return the layout of a file that ``options`` read as ``raw``, including everything that was
    detected in it.

    Raises:
        UsageError: the source is not a text with frames in rows.
    """
    read = raw.text
    if read is None:
        raise UsageError(
            f"{where}: a layout describes text with frames in rows; this source is not such a text,"
            " so there is nothing to save"
        )
    source = replace(
        options.source,
        delimiter=read.form.delimiter if read.one_delimiter else None,
        label=read.form.label,
        header_rows=None if read.form.label is not None else read.header_rows or None,
        cells=read.cells,
        columns=_spec(read.columns),
        pairs=read.pairs,
        time=None if read.time is None else str(read.time),
        reference_columns=None,
    )
    table = table_rows(options)
    if table is not None:
        rows = tuple(tuple(row) for row in table.tolist())
        options = replace(options, table=rows, table_file=None, order="table")
    return Layout(replace(options, source=source), protocol)


@dataclass(frozen=True, eq=False)
class LineFrame:
    """The channels (c,) of a line, real or complex, times the layout's scale, NaN for cells that
    are not numbers; and its time in s if the layout names a column for it."""

    values: AnyArray
    time_s: float | None


class BadLine(EitskinError):
    """Raised for a line that is not a frame; the text gives the reason."""


class LineParser:
    """Converts rows of cells to frames as ``layout`` says."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.cells = layout, layout.options.source.cells
        self._columns: list[int] = []
        self._time: int | None = None
        if self.cells is not None:
            self._choose(self.cells)

    def frame(self, row: Row) -> LineFrame:
        """Return the frame in ``row``.

        Raises:
            BadLine: the row is not a frame.
        """
        cells = row.cells
        if self.cells is None:
            if not has_number(row):
                raise BadLine(f"line {row.line} holds no number")
            self.choose(len(cells))
        if len(cells) != self.cells:
            raise BadLine(f"line {row.line} has {len(cells)} numbers where {self.cells} should be")
        values = _parsed([cells[k] for k in self._columns])
        if np.mean(~np.isfinite(values)) > MOST_BAD:
            raise BadLine(f"line {row.line}: hardly any of its cells is a number")
        time = None if self._time is None else parse_cell(cells[self._time])
        scale = self.layout.options.source.time_scale
        return LineFrame(self._complex(values), None if time is None else time.real * scale)

    def choose(self, cells: int) -> None:
        """Lines of ``cells`` cells are frames from now on.

        Raises:
            BadLine: they lack columns that the layout names.
        """
        try:
            self._choose(cells)
        except UsageError as error:
            raise BadLine(f"lines of {cells} numbers: {error}") from None

    @property
    def channels(self) -> int | None:
        """The number of channels of a frame; None if the layout does not state it and no line has
        come yet."""
        if self.cells is None:
            return None
        return len(self._columns) // (2 if self._paired else 1)

    @property
    def _paired(self) -> bool:
        return self.layout.options.source.pairs is not None

    def _choose(self, cells: int) -> None:
        source = self.layout.options.source
        time = chosen(source.time, cells, (), "time") if source.time is not None else ()
        columns = (
            tuple(k for k in range(cells) if k not in time)
            if source.columns is None
            else chosen(source.columns, cells, (), "columns")
        )
        if len(time) > 1 or (self._paired and len(columns) % 2):
            raise UsageError("time names one column, and pairs need an even number of them")
        self.cells, self._columns = cells, list(columns)
        self._time = time[0] if time else None

    def _complex(self, values: AnyArray) -> AnyArray:
        source = self.layout.options.source
        if source.pairs is not None:
            places = range(len(values))
            pairs = Paired(tuple(places[0::2]), tuple(places[1::2]), source.pairs)
            values = to_complex(shifted(values[None].real, pairs, source.offset), pairs)[0]
        elif not np.iscomplexobj(values):
            values = values + source.offset
        if source.complex_part == "abs":
            values = np.abs(values)
        elif source.complex_part in ("real", "imag"):
            values = np.asarray(getattr(values, source.complex_part))
        return np.asarray(values * (1.0 if source.scale is None else source.scale))


def has_number(row: Row) -> bool:
    """Return whether a cell of ``row`` is a number."""
    return any(parse_cell(cell) is not None for cell in row.cells)


def _parsed(cells: Sequence[str]) -> AnyArray:
    try:
        values: AnyArray = np.array([plain_number(cell) for cell in cells])
    except ValueError:
        parsed = (parse_cell(cell) for cell in cells)
        values = np.array([complex("nan") if z is None else z for z in parsed])
        if not np.iscomplex(values).any():
            values = values.real
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(np.abs(values) < TOO_LARGE, values, np.nan))


def _spec(columns: Sequence[int]) -> str:
    """Return a list of columns in short form, such as a:b or a:b:step."""
    if len(columns) > 2 and len(set(np.diff(columns).tolist())) == 1 and columns[1] > columns[0]:
        step = columns[1] - columns[0]
        last = columns[-1] + 1
        return f"{columns[0]}:{last}" + (f":{step}" if step > 1 else "")
    return ",".join(map(str, columns))


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml(one) for one in value)}]"
    return repr(value)


def _changed(group: Any, keys: dict[str, Any]) -> dict[str, Any]:
    default = type(group)()
    values = {key: getattr(group, key) for key in keys}
    return {key: value for key, value in values.items() if value != getattr(default, key)}


def _values(table: Mapping[str, Any], keys: dict[str, Any], where: str) -> dict[str, Any]:
    read: dict[str, Any] = {}
    for key in (key for key in keys if key in table):
        kind = keys[key]
        if isinstance(kind, tuple):
            read[key] = choice(table, key, None, kind, where)
        elif kind == "text":
            read[key] = _text(table, key, where)
        elif kind == "flag":
            read[key] = flag(table, key, None, where)
        elif kind == "number":
            read[key] = number(table, key, None, where)
        elif kind == "texts":
            read[key] = tuple(_texts(table[key], f"{where}: {key}"))
        elif kind == "whole":
            read[key] = integer(table, key, None, where, low=0, high=MAX_CELLS)
        else:
            read[key] = tuple(_wholes(table[key], f"{where}: {key}"))
    return read


def _text(table: Mapping[str, Any], key: str, where: str) -> str:
    value = table[key]
    if isinstance(value, int) and not isinstance(value, bool):
        value = str(value)  # a single column
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{where}: {key} must be text, not {value!r}")
    return value


def _texts(value: Any, where: str) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(one, str) and one for one in value):
        raise ConfigError(f"{where} must be a list of texts, not {value!r}")
    return value


def _wholes(value: Any, where: str, low: int = 0) -> list[int]:
    if not isinstance(value, list) or not all(type(one) is int and one >= low for one in value):
        raise ConfigError(f"{where} must be a list of whole numbers, not {value!r}")
    return value


def _rows(value: Any, width: int, where: str, low: int = 0) -> tuple[Any, ...]:
    if not isinstance(value, list) or not value:
        raise ConfigError(f"{where} must be a list of rows of {width} whole numbers")
    rows = tuple(tuple(_wholes(row, f"{where}: a row", low)) for row in value)
    if any(len(row) != width for row in rows):
        raise ConfigError(f"{where}: every row must be {width} whole numbers")
    return rows


def _whole(table: Mapping[str, Any], key: str, where: str, high: int) -> int | None:
    return integer(table, key, None, where, low=1, high=high) if key in table else None


def _number(table: Mapping[str, Any], key: str, where: str, high: float) -> float | None:
    if key not in table:
        return None
    return number(table, key, None, where, low=0, high=high, open_low=True)


def _protocol(table: Mapping[str, Any], where: str) -> Protocol | None:
    if not table:
        return None
    count = integer(table, "electrodes", None, where, low=MIN_COUNT, high=MAX_COUNT)
    rest = {key: value for key, value in table.items() if key != "electrodes"}
    return protocol_from_table(rest, count, where)
