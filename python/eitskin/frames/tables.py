"""Read text tables of numbers from instruments. Delimiter, header, label and decimal comma are
detected, and bad cells are named."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
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
    lone_labels,
    own_labels,
    parse_cell,
)

MAX_BYTES = 1_000_000_000
SNIFFED_LINES = 1000
SNIFFED_ROWS = 50
CERTAIN_COUNT = 4  # cells that count up in a first line make it a header, whatever the shape
INDEX_NAMES = ("", "index", "unnamed: 0")
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

    @property
    def found(self) -> str:
        """Return what was found in the file, for messages."""
        label = "no label" if self.form.label is None else f"label {self.form.label!r}"
        heads = f"{self.header_rows or 'no'} header row{'s' * (self.header_rows > 1)}"
        return (
            f"found: delimiter {self.form.delimiter}, {label}, {heads},"
            f" {len(self.cells)} rows of {self.n_columns} cells"
        )

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
    fits: Sequence[int] = (),
) -> TextTable:
    """Read a text table. ``delimiter`` and ``label`` are as in ``LineFormat``; these and
    ``header_rows`` are detected if None. ``skip_bad_lines`` leaves out lines whose length differs
    from most. ``fits`` are the lengths that a frame may have, which decide between guesses.

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
    form = _found_form([line for _, line in lines], delimiter, label, comment, fits, str(path))
    reader = LineReader(form)
    rows = [row for number, line in lines for row in reader.feed(number, line)] + reader.finish()
    if not rows:
        raise FrameError(f"{path}: the table has no rows{_without_label(lines, form)}")
    notes = []
    if reader.passed_over:
        notes.append(f"{reader.passed_over} lines without the label {form.label!r} passed over")
    skip = header_rows
    if skip is None:
        skip = _words_length([row.cells for row in rows])
        if form.label is None and _counting_header([row.cells for row in rows[skip:]], fits):
            notes.append(f"line {rows[skip].line} counts the columns and is taken for a header")
            skip += 1
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
                f"{_labels_seen(lines, form)}"
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
    every: Sequence[str],
    delimiter: str | None,
    label: str | None,
    comment: tuple[str, ...],
    fits: Sequence[int],
    where: str,
) -> LineFormat:
    """Return the form in which the lines are most like a table of numbers: delimiter and label are
    guessed together, unless they are given."""
    given = LineFormat("comma" if delimiter is None else delimiter, label, comment)
    lines = [line for line in every if not given.passed_over(line)]
    labels: list[str | None] = [label]
    if label is None and (own := own_labels(lines)):
        labels = [_only(own, where)]
    elif label is None and (alone := lone_labels(lines)):
        labels = [None, *([next(iter(alone))] if len(alone) == 1 else [])]
        if len(alone) > 1 and min(alone.values()) > 1:
            labels = [_only(alone, where)]
    delimiters = list(DELIMITERS) if delimiter is None else [delimiter]
    forms = [replace(given, delimiter=d, label=word) for word in labels for d in delimiters]
    if len(forms) == 1:
        return forms[0]
    sample = lines if len(lines) <= SNIFFED_LINES else lines[-SNIFFED_LINES:]
    whole = len(sample) == len(lines)
    scores = [_score(form, sample, fits, whole) for form in forms]
    best = max(range(len(forms)), key=lambda k: scores[k])  # of equals the first
    return forms[best] if sample else given


def _only(labels: dict[str, int], where: str) -> str:
    if len(labels) > 1:
        counted = ", ".join(f"{name!r} ({count})" for name, count in labels.items())
        raise UsageError(
            f"{where}: lines begin with {_cut(counted)}; say with --label which are the frames"
        )
    return next(iter(labels))


def _score(
    form: LineFormat, lines: Sequence[str], fits: Sequence[int], whole: bool
) -> tuple[float, bool, bool, int]:
    """Return how much ``lines`` look like a table in ``form``: the share of cells that are numbers
    in rows of one length, where rows above them without a letter count against it; whether frames
    have a length that ``fits``; whether decimal commas stay whole; the number of cells."""
    reader = LineReader(form)
    rows = [row.cells for line in lines for row in reader.feed(0, line)] + [
        row.cells for row in reader.finish()
    ]
    skip = _words_length(rows)
    unread = sum(not any(map(str.isalpha, "".join(row))) for row in rows[:skip])
    rows = rows[skip:]
    if not rows:
        return 0.0, False, False, 0
    width, alike = Counter(map(len, rows)).most_common(1)[0]
    last = [cell for row in rows[-SNIFFED_ROWS:] for cell in row]
    numeric = sum(parse_cell(cell) is not None for cell in last) / max(len(last), 1)
    heads = _counting_header(rows, fits)
    fit = width in fits or (whole and len(rows) - heads in fits)
    cut = form.delimiter == "comma" and _cuts_decimals(rows[-SNIFFED_ROWS:])
    return round(alike / (len(rows) + unread) * numeric, 6), fit, not cut, len(last)


def _cuts_decimals(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether rows of two whole numbers are rather one number with a decimal comma: the
    second begins with 0, or always has the same three digits or more."""
    if any(len(row) != 2 or not row[1].isdigit() for row in rows):
        return False
    if any(not row[0].lstrip("+-").isdigit() for row in rows):
        return False
    lengths = {len(row[1]) for row in rows}
    leading = any(len(row[1]) > 1 and row[1].startswith("0") for row in rows)
    return (
        leading or any(row[0] == "-0" for row in rows) or (len(lengths) == 1 and min(lengths) > 2)
    )


def _without_label(lines: Sequence[tuple[int, str]], form: LineFormat) -> str:
    if form.label is None:
        return ""
    shown = [line for _, line in lines if not form.passed_over(line)]
    seen = own_labels(shown) | lone_labels(shown)
    words = ", ".join(f"{name!r} ({count})" for name, count in seen.items())
    found = f"lines begin with {_cut(words)}" if seen else "no line begins with a word"
    if form.label in seen:
        return f" of numbers after the label {form.label!r}; the delimiter is {form.delimiter}"
    return f" that begin with {form.label!r}; {found}"


def _labels_seen(lines: Sequence[tuple[int, str]], form: LineFormat) -> str:
    alone = lone_labels([line for _, line in lines if not form.passed_over(line)])
    if form.label is not None or not alone:
        return ""
    word, count = next(iter(alone.items()))
    return f"; {count} lines {word!r} stand between: try  --label {word!r}"


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


def _words_length(rows: Sequence[Sequence[str]]) -> int:
    """Return how many rows at the start hold mostly words: less than half of their cells are
    numbers."""
    for k, cells in enumerate(rows):
        if 2 * sum(parse_cell(cell) is not None for cell in cells) >= max(len(cells), 1):
            return k
    return len(rows)


def _counting_header(rows: Sequence[Sequence[str]], fits: Sequence[int]) -> bool:
    """Return whether the first row only counts the columns, as pandas and spreadsheets write it: 0,
    1, 2, ... or 1, 2, 3, ..., perhaps beside words.

    A few columns count by chance, so then it is one row too many for a frame that must show it.
    """
    if len(rows) < 2 or not _counts_up(rows[0]):
        return False
    numbers = sum(parse_cell(cell) is not None for cell in rows[0])
    if numbers >= CERTAIN_COUNT:
        return not _counts_up(rows[1])
    return len(rows) not in fits and len(rows) - 1 in fits


def _counts_up(cells: Sequence[str]) -> bool:
    """Return whether the numbers among ``cells`` are successive whole numbers; the first is 0 or 1
    if there are few."""
    values = [value for cell in cells if (value := parse_cell(cell)) is not None]
    if not values or any(value.imag or value.real % 1 for value in values):
        return False
    if len(values) < CERTAIN_COUNT and values[0] not in (0, 1):
        return False
    return all(b - a == 1 for a, b in pairwise(values))


def counting_column(table: TextTable) -> bool:
    """Return whether the first column only counts the rows, as the index that pandas and
    spreadsheets put before the numbers."""
    column = [row[0] for row in table.cells]
    unnamed = bool(table.header) and table.header[0].lower() in INDEX_NAMES
    return len(column) > 1 - unnamed and table.n_columns > 1 and _counts_up(column)
