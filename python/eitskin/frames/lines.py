"""Lines of an instrument to rows of cells: one parser, of files and of what comes over a line."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from eitskin.errors import UsageError

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "space": None}
COMMENT = ("#", "%")
# bounded, so that no line takes long
OWN_LABEL = re.compile(r"\s{0,40}([A-Za-z_][A-Za-z_ -]{0,39}?)\s{0,40}\d{0,12}\s{0,40}[:=]")
AFTER_LABEL = r"(?:\s{0,40}\d{0,12}\s{0,40}(?:[:=]|$))?\s*"
DECIMALS = re.compile(r"decimals:([1-9])")


@dataclass(frozen=True)
class Row:
    """The cells of one frame, or of one line, and the ``line`` (from 1) that they begin on."""

    line: int
    cells: tuple[str, ...]


@dataclass(frozen=True)
class LineFormat:
    """How cells stand in a line.

    ``delimiter``: a name of DELIMITERS, a character, or "decimals:N": nothing between the numbers,
    each has N digits after its point. ``label``: only lines that begin with it are frames; a
    number, a colon or an equals sign may follow it. A line that is the label alone begins a frame
    whose numbers stand in the lines after it. ``comment``: lines that begin so are passed over.
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
        """The cells of ``text``, a line without its label."""
        decimals = DECIMALS.fullmatch(self.delimiter)
        if decimals is not None:
            number = rf"\s*([-+]?\d*\.\d{{{decimals.group(1)}}})"
            whole = re.fullmatch(rf"(?:{number})+\s*", text)
            return tuple(re.findall(number, text)) if whole else (text.strip(),)
        separator = DELIMITERS.get(self.delimiter, self.delimiter)
        if separator is None or separator == " ":
            return tuple(text.split())
        return tuple(cell.strip().strip('"').strip() for cell in text.split(separator))

    def passed_over(self, line: str) -> bool:
        """Whether ``line`` is empty or a comment."""
        return not line.strip() or line.lstrip().startswith(self.comment)

    def labelled(self, line: str) -> str | None:
        """What follows the label; None where ``line`` does not begin with it."""
        assert self.label is not None
        match = re.match(rf"\s{{0,40}}{re.escape(self.label)}{AFTER_LABEL}", line)
        return None if match is None else line[match.end() :].rstrip()


class LineReader:
    """Puts rows together as lines come. ``wanted``: the cells of a row, where they are known: a
    frame over several lines is then told as soon as it is whole."""

    def __init__(self, form: LineFormat, wanted: int | None = None) -> None:
        self.form, self.wanted = form, wanted
        self.passed_over = 0  # lines without the label, and not of a frame
        self._open: Row | None = None  # begun by a label alone

    def feed(self, number: int, line: str) -> list[Row]:
        """The rows that ``line`` ends or is."""
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
        """The row that is open, where one is."""
        row, self._open = self._open, None
        return [] if row is None or not row.cells else [row]

    def _trimmed(self, cells: tuple[str, ...]) -> tuple[str, ...]:
        """Without the empty cell that a delimiter at the line's end makes."""
        known = self.wanted is not None and len(cells) == self.wanted + 1
        return _without_end(cells) if known else cells


def _without_end(cells: tuple[str, ...]) -> tuple[str, ...]:
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def parse_cell(cell: str) -> complex | None:
    """The number in ``cell`` (real, complex with i or j, decimal comma), or None."""
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
        try:
            return complex(text.replace(" ", "").replace("i", "j"))
        except ValueError:
            pass
    return None


def own_labels(lines: Sequence[str]) -> dict[str, int]:
    """The labels that lines themselves show, "magnitudes" of "magnitudes : 1.5, 2.5", and how many
    begin with each; empty where fewer than half of the lines with numbers begin with one."""
    found: dict[str, int] = {}
    numbers = 0
    for line in lines:
        numbers += any(letter.isdigit() for letter in line)
        match = OWN_LABEL.match(line)
        if match is not None and any(letter.isdigit() for letter in line[match.end() :]):
            found[match.group(1)] = found.get(match.group(1), 0) + 1
    return found if 2 * sum(found.values()) > numbers else {}
