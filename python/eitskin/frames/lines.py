"""Divide the lines of an instrument into rows of cells. Files and live lines use the same
parser."""

import csv
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

from eitskin.errors import UsageError

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "space": None}
COMMENT = ("#", "%")
# repetitions are bounded, so that no line takes long to match
OWN_LABEL = re.compile(r"\s{0,40}([A-Za-z_][A-Za-z_ -]{0,39}?)\s{0,40}\d{0,12}\s{0,40}[:=]")
LONE_LABEL = re.compile(
    r"\s{0,40}([A-Za-z_][A-Za-z_ -]{0,39}?)\s{0,40}\d{0,12}\s{0,40}[:=]?\s{0,40}"
)
AFTER_LABEL = r"(?:\s{0,40}\d{0,12}\s{0,40}(?:[:=]|$))?\s*"
DECIMALS = re.compile(r"decimals:([1-9])")


@dataclass(frozen=True)
class Row:
    """The cells of one frame or one line, and the ``line`` (from 1) on which they begin."""

    line: int
    cells: tuple[str, ...]


@dataclass(frozen=True)
class LineFormat:
    """The format by which a line is divided into cells.

    ``delimiter`` is a name in DELIMITERS, a character, or "decimals:N" for numbers without anything
    between them, each with N digits after its point. If ``label`` is given, only lines that begin
    with it are frames; a number, a colon or an equals sign may follow the label. A line with the
    label alone begins a frame whose numbers are in the following lines. Lines that begin with one
    of ``comment`` are ignored.
    """

    delimiter: str
    label: str | None = None
    comment: tuple[str, ...] = COMMENT

    def __post_init__(self) -> None:
        named = self.delimiter in DELIMITERS or len(self.delimiter) == 1
        if not named and DECIMALS.fullmatch(self.delimiter) is None:
            raise UsageError(
                f"delimiter {self.delimiter!r}: use one character or one of"
                f" {', '.join(DELIMITERS)}, decimals:N"
            )

    def split(self, text: str) -> tuple[str, ...]:
        """Return the cells of ``text``, a line without its label."""
        decimals = DECIMALS.fullmatch(self.delimiter)
        if decimals is not None:
            number = rf"\s*([-+]?\d*\.\d{{{decimals.group(1)}}})"
            whole = re.fullmatch(rf"(?:{number})+\s*", text)
            return tuple(re.findall(number, text)) if whole else (text.strip(),)
        separator = DELIMITERS.get(self.delimiter, self.delimiter)
        if separator is None or separator == " ":
            return tuple(cell.strip('"') for cell in text.split())
        if '"' in text:  # a delimiter within quotes belongs to the cell
            with suppress(csv.Error):
                quoted = next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
                return tuple(cell.strip() for cell in quoted)
        return tuple(cell.strip() for cell in text.split(separator))

    def passed_over(self, line: str) -> bool:
        """Return whether ``line`` is empty or a comment."""
        return not line.strip() or line.lstrip().startswith(self.comment)

    def labelled(self, line: str) -> str | None:
        """Return the text after the label, or None if ``line`` does not begin with it."""
        assert self.label is not None
        match = re.match(rf"\s{{0,40}}{re.escape(self.label)}{AFTER_LABEL}", line)
        return None if match is None else line[match.end() :].rstrip()


class LineReader:
    """Assembles rows as lines come. ``wanted`` is the number of cells of a row, if known; then a
    frame over several lines is returned as soon as it is complete."""

    def __init__(self, form: LineFormat, wanted: int | None = None) -> None:
        self.form, self.wanted = form, wanted
        self.passed_over = 0  # number of lines without the label that are not part of a frame
        self._open: Row | None = None  # a row that was begun by a line with the label alone

    def feed(self, number: int, line: str) -> list[Row]:
        """Return the rows that ``line`` contains or completes."""
        form = self.form
        if form.passed_over(line):
            return self.finish()
        if form.label is None:
            return [Row(number, self._trimmed(form.split(line)))]
        rest = form.labelled(line)
        if rest is not None:
            ended = self.finish()
            if rest:
                return [*ended, Row(number, self._trimmed(form.split(rest)))]
            self._open = Row(number, ())
            return ended
        cells = form.split(line)
        if self._open is None or any(parse_cell(cell) is None for cell in cells if cell):
            self.passed_over += 1
            return self.finish()
        self._open = Row(self._open.line, (*self._open.cells, *_without_end(cells)))
        return self.finish() if len(self._open.cells) == self.wanted else []

    def finish(self) -> list[Row]:
        """Return the open row, if there is one."""
        row, self._open = self._open, None
        return [] if row is None or not row.cells else [row]

    def _trimmed(self, cells: tuple[str, ...]) -> tuple[str, ...]:
        """Return ``cells`` without the empty cell that a delimiter at the end of the line makes."""
        known = self.wanted is not None and len(cells) == self.wanted + 1
        return _without_end(cells) if known else cells


def _without_end(cells: tuple[str, ...]) -> tuple[str, ...]:
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def parse_cell(cell: str) -> complex | None:
    """Return the number in ``cell`` (real, complex with i or j, decimal comma), or None."""
    if "_" in cell:
        return None
    for text in (
        cell,
        cell.replace(",", ".") if cell.count(",") == 1 and "." not in cell else cell,
    ):
        try:
            return float(text)
        except ValueError:
            pass
        if text[-1:].lower() not in ("i", "j", ")"):
            continue
        try:
            return complex(re.sub(r"\s*([-+])\s*", r"\1", text).replace("i", "j"))
        except ValueError:
            pass
    return None


def own_labels(lines: Sequence[str]) -> dict[str, int]:
    """Return the labels that the lines themselves show, such as "magnitudes" in "magnitudes : 1.5,
    2.5", and how many lines begin with each. The result is empty unless more than half of the lines
    with numbers begin with a label."""
    found: dict[str, int] = {}
    numbers = 0
    for line in lines:
        numbers += any(letter.isdigit() for letter in line)
        match = OWN_LABEL.match(line)
        if match is not None and any(letter.isdigit() for letter in line[match.end() :]):
            found[match.group(1)] = found.get(match.group(1), 0) + 1
    return found if 2 * sum(found.values()) > numbers else {}


def lone_labels(lines: Sequence[str]) -> dict[str, int]:
    """Return the words that stand alone on a line above numbers, such as "k" or "frame 12:", and
    how many lines have each."""
    found: dict[str, int] = {}
    for line, below in pairwise(lines):
        match = LONE_LABEL.fullmatch(line)
        if match is not None and begins_with_number(below):
            found[match.group(1)] = found.get(match.group(1), 0) + 1
    return found


def begins_with_number(line: str) -> bool:
    """Return whether the first word of ``line`` is a number, whatever the delimiter is."""
    words = re.split(r'[\s,;|"]+', line.strip().strip('"'), maxsplit=1)
    return parse_cell(words[0]) is not None
