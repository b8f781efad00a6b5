"""Text tables of numbers as instruments write them: delimiter, header, decimal comma found, bad
cells named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitskin.errors import FrameError, UsageError
from eitskin.fileio import read_bytes

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "space": None}
COMMENT = ("#", "%")
SNIFFED_LINES = 50


@dataclass(frozen=True)
class TextTable:
    """A table still as text: ``cells`` in rows of equal length, each row's ``line`` (from 1),
    ``header`` names."""

    path: str
    cells: tuple[tuple[str, ...], ...]
    line: tuple[int, ...]
    header: tuple[str, ...]

    @property
    def n_columns(self) -> int:
        """The number of columns."""
        return len(self.cells[0])

    def numbers(self, columns: Sequence[int]) -> NDArray[Any]:
        """The chosen ``columns`` as numbers, (rows, len(columns)), complex where a cell is like
        1.5-2j, else float.

        Raises:
            FrameError: a cell is empty or no number, named by line and column.
        """
        values: list[list[complex]] = []
        for cells, line in zip(self.cells, self.line, strict=True):
            row = []
            for column in columns:
                value = parse_cell(cells[column])
                if value is None:
                    found = f"{cells[column]!r} is not a number" if cells[column] else "is empty"
                    raise FrameError(
                        f"{self.path}: line {line}, column {column} (from 0): {found}; repair the"
                        " cell"
                    )
                row.append(value)
            values.append(row)
        array = np.array(values, dtype=np.complex128).reshape(len(values), len(columns))
        return array if np.iscomplex(array).any() else np.ascontiguousarray(array.real)


def read_table(
    path: str | Path, delimiter: str | None = None, header_rows: int | None = None
) -> TextTable:
    """Read a text table. ``delimiter``: a name of DELIMITERS or a character; None finds it, as it
    does ``header_rows``.

    Empty lines and lines that begin with # or % are passed over.

    Raises:
        FileError: the file cannot be read.
        UsageError: the delimiter is not one.
        FrameError: it is no text, holds no rows, or its rows differ in length.
    """
    content = read_bytes(path, "table")
    if b"\0" in content[:4096]:
        raise FrameError(f"{path}: not a text table (it holds zero bytes); save it as CSV in UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1)]
    lines = [
        (number, line)
        for number, line in lines
        if line.strip() and not line.lstrip().startswith(COMMENT)
    ]
    if not lines:
        raise FrameError(f"{path}: the table has no rows")
    separator = (
        _sniffed([line for _, line in lines]) if delimiter is None else _separator(delimiter)
    )
    rows = [(number, _split(line, separator)) for number, line in lines]
    if all(len(cells) > 1 and not cells[-1] for _, cells in rows):
        rows = [(number, cells[:-1]) for number, cells in rows]  # every line ends in a delimiter
    skip = _header_length([cells for _, cells in rows]) if header_rows is None else header_rows
    body = rows[skip:]
    if not body:
        raise FrameError(
            f"{path}: no rows of numbers after {skip} header row(s); check the delimiter"
        )
    width = len(body[0][1])
    for number, cells in body:
        if len(cells) != width:
            raise FrameError(
                f"{path}: line {number} has {len(cells)} cells, line {body[0][0]} has {width};"
                " repair it"
            )
    header = rows[skip - 1][1] if skip and len(rows[skip - 1][1]) == width else ()
    return TextTable(
        str(path), tuple(cells for _, cells in body), tuple(number for number, _ in body), header
    )


def parse_cell(cell: str) -> complex | None:
    """The number in ``cell`` (real, complex with i or j, decimal comma), or None."""
    for text in (
        cell,
        cell.replace(",", ".") if cell.count(",") == 1 and "." not in cell else cell,
    ):
        try:
            return float(text)
        except ValueError:
            pass
        try:
            return complex(text.replace(" ", "").replace("i", "j"))
        except ValueError:
            pass
    return None


def chosen(spec: str, count: int, names: Sequence[str], option: str) -> tuple[int, ...]:
    """The indices that ``spec`` names among ``count``: "2", "0,2", "1:209", "3:" or names from a
    header, by commas.

    Raises:
        UsageError: a name is not there or an index is out of range; ``option`` is named.
    """
    indices: list[int] = []
    for part in (piece.strip() for piece in spec.split(",")):
        if part in names:
            indices.append(list(names).index(part))
            continue
        first, colon, last = part.partition(":")
        try:
            start = int(first) if first or not colon else 0
            stop = (int(last) if last else count) if colon else start + 1
        except ValueError:
            known = f"; names are {', '.join(names)}" if names else ""
            raise UsageError(
                f"{option} {spec}: {part!r} is no number, range a:b or header name{known}"
            ) from None
        if not 0 <= start < stop <= count:
            raise UsageError(f"{option} {spec}: {part} is out of range; there are 0 to {count - 1}")
        indices.extend(range(start, stop))
    return tuple(indices)


def _separator(delimiter: str) -> str | None:
    if delimiter in DELIMITERS:
        return DELIMITERS[delimiter]
    if len(delimiter) == 1:
        return None if delimiter == " " else delimiter
    raise UsageError(
        f"delimiter {delimiter!r}: use one character or one of {', '.join(DELIMITERS)}"
    )


def _split(line: str, separator: str | None) -> tuple[str, ...]:
    if separator is None:
        return tuple(line.split())
    return tuple(cell.strip().strip('"').strip() for cell in line.split(separator))


def _sniffed(lines: Sequence[str]) -> str | None:
    """The separator under which the most cells are numbers, then the most cells."""
    sample = lines[-SNIFFED_LINES:]

    def score(separator: str | None) -> tuple[float, float]:
        rows = [_split(line, separator) for line in sample]
        cells = [cell for row in rows for cell in row]
        even = sum(len(row) == len(rows[-1]) for row in rows) / len(rows)
        return round(
            even * sum(parse_cell(cell) is not None for cell in cells) / max(len(cells), 1), 6
        ), len(cells)

    return max(DELIMITERS.values(), key=score)


def _header_length(rows: Sequence[Sequence[str]]) -> int:
    """How many leading rows are less than half numbers."""
    for k, cells in enumerate(rows):
        if 2 * sum(parse_cell(cell) is not None for cell in cells) >= max(len(cells), 1):
            return k
    return len(rows)
