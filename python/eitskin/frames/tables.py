"""Read text tables of numbers from instruments. Delimiter, header, label and decimal comma are
detected, and bad cells are named."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eitskin.arrays import AnyArray
from eitskin.errors import FrameError, UsageError
from eitskin.fileio import read_bytes
from eitskin.frames.lines import (
    COMMENT,
    DELIMITERS,
    LineFormat,
    LineReader,
    Row,
    own_labels,
    parse_cell,
)

MAX_BYTES = 1_000_000_000
SNIFFED_LINES = 50
LONGEST = 200  # characters of a list in a message


@dataclass(frozen=True)
class TextTable:
    """A table as text: ``cells`` in rows of equal length, the ``line`` of each row (from 1),
    ``header`` names, the ``form`` of its lines, and ``notes`` on lines that were left out."""

    path: str
    cells: tuple[tuple[str, ...], ...]
    line: tuple[int, ...]
    header: tuple[str, ...]
    form: LineFormat
    header_rows: int = 0
    notes: tuple[str, ...] = ()

    @property
    def n_columns(self) -> int:
        return len(self.cells[0])

    def numbers(self, columns: Sequence[int]) -> AnyArray:
        """Return the chosen ``columns`` as numbers, (rows, len(columns)): complex if a cell is like
        1.5-2j, otherwise float.

        Raises:
            FrameError: a cell is not a number.
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
    path: str | Path,
    delimiter: str | None = None,
    header_rows: int | None = None,
    label: str | None = None,
    *,
    skip_bad_lines: bool = False,
    comment: tuple[str, ...] = COMMENT,
    cells: int | None = None,
) -> TextTable:
    """Read a text table. ``delimiter`` and ``label`` are as in ``LineFormat``; these and
    ``header_rows`` are detected if None. ``skip_bad_lines`` leaves out lines whose length differs
    from most.

    Empty lines and lines that begin with # or % are ignored.

    Raises:
        FileError: the file cannot be read.
        UsageError: the delimiter is not valid, or there are several labels.
        FrameError: it is not text, has no rows, or its rows differ in length.
    """
    content = read_bytes(path, "table", MAX_BYTES)
    if b"\0" in content[:4096]:
        raise FrameError(f"{path}: not a text table (it holds zero bytes); save it as CSV in UTF-8")
    lines = list(enumerate(decoded(content).splitlines(), 1))
    given = LineFormat("comma" if delimiter is None else delimiter, label, comment)
    form = _found_form([line for _, line in lines], delimiter is None, given, str(path))
    reader = LineReader(form)
    rows = [row for number, line in lines for row in reader.feed(number, line)] + reader.finish()
    if not rows:
        labelled = "" if form.label is None else f" that begin with {form.label!r}"
        raise FrameError(f"{path}: the table has no rows{labelled}")
    notes = []
    if reader.passed_over:
        notes.append(f"{reader.passed_over} lines without the label {form.label!r} passed over")
    skip = _header_length([row.cells for row in rows]) if header_rows is None else header_rows
    body = _without_ends(rows[skip:])
    if not body:
        raise FrameError(
            f"{path}: no rows of numbers after {skip} header row(s); check the delimiter"
        )
    if skip_bad_lines:
        body = _even(body, cells, notes)
    width = len(body[0].cells) if cells is None else cells
    for row in body:
        if len(row.cells) != width:
            raise FrameError(
                f"{path}: line {row.line} has {len(row.cells)} cells,"
                f" {f'line {body[0].line} has' if cells is None else 'the layout says'} {width};"
                " repair it, or leave such lines out with --skip-bad-lines"
            )
    names = rows[skip - 1].cells if skip else ()
    if len(names) == width + 1 and not names[-1]:
        names = names[:-1]
    return TextTable(
        str(path),
        tuple(row.cells for row in body),
        tuple(row.line for row in body),
        names if len(names) == width else (),
        form,
        skip,
        tuple(notes),
    )


def decoded(content: bytes) -> str:
    """Return text as instruments write it: UTF-8, otherwise Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _found_form(
    lines: Sequence[str], find_delimiter: bool, form: LineFormat, where: str
) -> LineFormat:
    """Return ``form``, completed by what can be detected in the lines."""
    lines = [line for line in lines if not form.passed_over(line)]
    if form.label is None and (found := own_labels(lines)):
        if len(found) > 1:
            counted = ", ".join(f"{name!r} ({count})" for name, count in found.items())
            raise UsageError(
                f"{where}: lines begin with {_cut(counted)}; say with --label which are the frames"
            )
        form = replace(form, label=next(iter(found)))
    if not find_delimiter:
        return form
    if form.label is not None:
        lines = [rest for line in lines if (rest := form.labelled(line))]
    return replace(form, delimiter=_sniffed(lines))


def _without_ends(rows: list[Row]) -> list[Row]:
    """Return the rows without their last cell if every line ends in a delimiter."""
    if rows and all(len(row.cells) > 1 and not row.cells[-1] for row in rows):
        return [Row(row.line, row.cells[:-1]) for row in rows]
    return rows


def _even(rows: list[Row], cells: int | None, notes: list[str]) -> list[Row]:
    """Return the rows with ``cells`` cells, or with the most frequent length; a note counts the
    rows left out."""
    width = cells or Counter(len(row.cells) for row in rows).most_common(1)[0][0]
    bad = [row for row in rows if len(row.cells) != width]
    if bad:
        notes.append(
            f"{len(bad)} lines left out that do not have {width} cells, first line {bad[0].line}"
            f" with {len(bad[0].cells)}"
        )
    left = [row for row in rows if len(row.cells) == width]
    if not left:
        raise FrameError(f"no line has {width} cells; line {bad[0].line} has {len(bad[0].cells)}")
    return left


def chosen(spec: str, count: int, names: Sequence[str], option: str) -> tuple[int, ...]:
    """Return the indices that ``spec`` names among ``count``: "2", "0,2", "1:209", "0:416:2", "3:"
    or names from a header, separated by commas.

    Raises:
        UsageError: a part is not valid or out of range.
    """
    indices: list[int] = []
    for part in (piece.strip() for piece in spec.split(",")):
        if part in names:
            indices.append(list(names).index(part))
            continue
        first, *others = part.split(":")
        last, step_text = [*others, "", ""][:2]
        try:
            if len(others) > 2:
                raise ValueError
            start = int(first) if first or not others else 0
            stop = (int(last) if last else count) if others else start + 1
            step = int(step_text) if step_text else 1
        except ValueError:
            known = f"; names are {_cut(', '.join(names))}" if names else ""
            raise UsageError(
                f"{option} {_cut(spec)}: {part!r} is not a number, range a:b or a:b:step, or header"
                f" name{known}"
            ) from None
        if not 0 <= start < stop <= count or step < 1:
            raise UsageError(
                f"{option} {_cut(spec)}: {part} is out of range; there are 0 to {count - 1}"
            )
        indices.extend(range(start, stop, step))
    return tuple(indices)


def _cut(text: str) -> str:
    """Return ``text`` for a message, not longer than a line or two."""
    return text if len(text) <= LONGEST else f"{text[:LONGEST].rstrip(', ')}, ..."


def _sniffed(lines: Sequence[str]) -> str:
    """Return the delimiter that makes the most cells numbers, and then the most cells."""
    sample = lines[-SNIFFED_LINES:]

    def score(delimiter: str) -> tuple[float, float]:
        rows = [LineFormat(delimiter).split(line) for line in sample]
        cells = [cell for row in rows for cell in row]
        even = sum(len(row) == len(rows[-1]) for row in rows) / len(rows)
        return round(
            even * sum(parse_cell(cell) is not None for cell in cells) / max(len(cells), 1), 6
        ), len(cells)

    return max(DELIMITERS, key=score) if sample else "comma"


def _header_length(rows: Sequence[Sequence[str]]) -> int:
    """Return how many rows at the start hold mostly words: less than half of their cells are
    numbers."""
    for k, cells in enumerate(rows):
        if 2 * sum(parse_cell(cell) is not None for cell in cells) >= max(len(cells), 1):
            return k
    return len(rows)
