"""Pages whose tables commands write, between marks.

A mark is ``<!-- NAME -->``; its place ends at ``<!-- end NAME -->``. ``pages.toml`` says what part
of a table a page shows.
"""

import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from eitskin.config import check_keys, load_toml, nearest
from eitskin.errors import ConfigError
from eitskin.fileio import read_bytes, write_bytes
from eitskin_studies.harness.numbers import keep_numbers, tables_of

WIDTH = 100

Tabular: TypeAlias = tuple[Sequence[str], Sequence[Sequence[str]]]
Filling: TypeAlias = tuple[dict[str, str], dict[str, Tabular]]

NOT_MEASURED = "(not measured)"
# mesh, contacts, converter and reference of all pages but those that say otherwise
AS_EVERYWHERE = "[simulated as everywhere](../../docs/reference/metrics.md#scenes-and-frames)"
PARTS = Path(__file__).parent / "pages.toml"
_CELL = re.compile(r"\{([^{}|]+)\|([^{}|]+)\|([^{}|]+)\}")
_INTERVAL = re.compile(r" (?:\(-?[\d.]+ to [\d.]+\)|\[-?[\d.]+, [\d.]+\])")


def existing_page(text: str) -> Path:
    """A page that is named at the command line, refused before any work where it cannot be filled.

    Raises:
        FileError: it cannot be read.
        ConfigError: it is no text.
    """
    _read(Path(text))
    return Path(text)


def _read(page: Path) -> str:
    try:
        return read_bytes(page, "page").decode("utf-8")
    except UnicodeDecodeError:
        raise ConfigError(f"{page}: not UTF-8 text, so not a page") from None


def fill_marks(page: Path, name: str, filling: Filling) -> None:
    """Write texts and tables between their marks in ``page``, so that none is ever copied by hand;
    of the tables what ``pages.toml`` says of the page ``name``, and its sentences about them. What
    was written is stored (``numbers.keep_numbers``).

    Raises:
        FileError: the page cannot be read or written.
        ConfigError: a mark is missing; nothing was written.
    """
    text = _read(page)
    texts, tables = filling
    parts = load_toml(PARTS, "list of what pages show").get(name, {})
    contents = {mark: _wrapped(content) for mark, content in texts.items()}
    for mark, part in parts.items():
        cells = _CELL.findall(part.get("text", ""))
        if cells and all(table in tables for table, _, _ in cells):
            contents[mark] = _wrapped(_said(part["text"], tables, f"{PARTS.name}: {name}.{mark}"))
    for mark, table in tables.items():
        part = parts.get(mark, {})
        if part.get("page", True):
            contents[mark] = markdown_table(*_part(table, part, f"{PARTS.name}: {name}.{mark}"))
    for mark, content in contents.items():
        text = _placed(text, mark, content, page)
    write_bytes(page, text.encode("utf-8"))
    keep_numbers(page, name, filling)


def fill_readme(readme: Path, results: Path) -> None:
    """Write the README's lines with numbers between their marks: ``pages.toml`` has them under
    README, with cells {PAGE.TABLE|row|column} of the tables of the pages in ``results``.

    Raises:
        FileError: the README cannot be read or written.
        ConfigError: it lacks a mark, or a page lacks a table, row or column.
    """
    text, tables = _read(readme), tables_of(results)
    for mark, part in load_toml(PARTS, "list of what pages show")["README"].items():

        def number(cell: re.Match[str]) -> str:
            return _number_of(tables, cell[1], cell[2], cell[3])

        text = _placed(text, mark, _wrapped(_CELL.sub(number, part["text"])), readme)
    write_bytes(readme, text.encode("utf-8"))


def _number_of(tables: Mapping[str, Tabular], table: str, row: str, column: str) -> str:
    """A cell of a page's table. The column "first of NAME" is a of a cell "a / b" or "a, b". A row
    is named by its first cell, or by as many as are needed: "after each drive, 0"."""
    where, (part, _, name) = f"{PARTS.name}: README", column.rpartition(" of ")
    if table not in tables:
        raise ConfigError(f"{where}: no table {table!r}; {nearest(table, tables)}")
    head, rows = tables[table]
    if name not in head:
        raise ConfigError(f"{where}: no column {name!r}; {nearest(name, head)}")
    found = [one for one in rows if row in _row_names(one)]
    if len(found) != 1:
        raise ConfigError(f"{where}: {len(found)} rows of {table} are named {row!r}")
    cell = found[0][list(head).index(name)]
    return re.split(" / |, ", cell)[("first", "second").index(part)] if part else cell


def _row_names(cells: Sequence[str]) -> list[str]:
    """The first cell of a row, the first two, and so on."""
    return [", ".join(cells[:k]) for k in range(1, len(cells) + 1)]


def _placed(text: str, mark: str, content: str, page: Path) -> str:
    """``text`` of ``page`` with ``content`` between the marks of the name ``mark``."""
    marked = re.compile(
        f"(<!-- {re.escape(mark)} -->\n).*?(<!-- end {re.escape(mark)} -->)", re.DOTALL
    )
    if not marked.search(text):
        raise ConfigError(
            f"{page}: has no marks <!-- {mark} --> and <!-- end {mark} -->; add them where the"
            " text is to be"
        )
    return marked.sub(lambda match: f"{match[1]}{content}\n{match[2]}", text)


def _said(sentence: str, tables: Mapping[str, Tabular], where: str) -> str:
    """``sentence`` with cells of ``tables``, without intervals, where it has {table|row|column}; a
    row is named by its first cell, or by as many as tell it from others: "40, 200, off"."""

    def cell(match: re.Match[str]) -> str:
        (head, rows), row, column = tables[match[1]], match[2], match[3]
        if column not in head:
            raise ConfigError(f"{where}: no column {column!r}; {nearest(column, head)}")
        found = [one for one in rows if row in _row_names(one)]
        if len(found) > 1:
            raise ConfigError(f"{where}: {len(found)} rows begin with {row!r}; name more cells")
        return _INTERVAL.sub("", found[0][list(head).index(column)]) if found else NOT_MEASURED

    return _CELL.sub(cell, sentence)


def _wrapped(text: str) -> str:
    """Lines of at most ``WIDTH``, code spans and lines of tables whole; further lines of a list's
    entry are indented."""
    whole = re.sub("`[^`]*`", lambda code: code[0].replace(" ", "\0"), text)
    lines = (
        line
        if line.startswith("|")
        else textwrap.fill(
            line,
            WIDTH,
            subsequent_indent="  " if line.startswith("- ") else "",
            break_long_words=False,
            break_on_hyphens=False,
        )
        for line in whole.split("\n")
    )
    return "\n".join(lines).replace("\0", " ")


def _part(table: Tabular, part: Mapping[str, Any], where: str) -> Tabular:
    """Return the part of a table that its page shows."""
    head, rows = table
    check_keys(part, ("page", "columns", "rows", "without", "intervals"), where)

    def place(column: str) -> int:
        if column not in head:
            raise ConfigError(f"{where}: no column {column!r}; {nearest(column, head)}")
        return list(head).index(column)

    for key, kept in (("rows", True), ("without", False)):
        for column, cells in part.get(key, {}).items():
            at = place(column)
            rows = [row for row in rows if (row[at] in cells) == kept]
    columns = [place(one) for one in part.get("columns", head)]
    shown = [[row[k] for k in columns] for row in rows]
    if not part.get("intervals", True):
        shown = [[_INTERVAL.sub("", cell) for cell in row] for row in shown]
    return [head[k] for k in columns], shown


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table for a terminal, columns to the right but the first."""
    table = [tuple(head), *map(tuple, rows)]
    widths = [max(len(row[k]) for row in table) for k in range(len(head))]
    lines = []
    for row in table:
        first, *rest = (word.rjust(width) for word, width in zip(row, widths, strict=True))
        lines.append("  ".join([first.strip().ljust(widths[0]), *rest]).rstrip())
    return "\n".join(lines)
