"""Pages whose tables commands write: a section a command, or the places between marks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from eitskin.errors import ConfigError
from eitskin.fileio import read_bytes, write_bytes


def put_section(path: Path, title: str, section: str, heading: str) -> None:
    """Replace the section "## ``title``" of the page at ``path`` by ``section`` (without its
    heading), or append it; a page that does not exist begins with ``heading``.

    Raises:
        FileError: it cannot be read or written.
    """
    page = read_bytes(path, "page").decode("utf-8") if path.exists() else f"# {heading}\n"
    whole = f"## {title}\n\n{section.strip()}\n"
    pattern = re.compile(rf"^## {re.escape(title)}\n.*?(?=^## |\Z)", re.M | re.S)
    replaced, count = pattern.subn(lambda _: whole + "\n", page)
    page = replaced if count else f"{page.rstrip()}\n\n{whole}"
    write_bytes(path, (page.rstrip() + "\n").encode("utf-8"))


def fill_marks(page: Path, texts: Mapping[str, str]) -> None:
    """Write each text between ``<!-- NAME -->`` and ``<!-- end NAME -->`` of ``page``, so that none
    is ever copied by hand.

    Raises:
        FileError: the page cannot be read or written.
        ConfigError: a mark is missing; nothing was written.
    """
    text = read_bytes(page, "page").decode("utf-8")
    for name, content in texts.items():
        marked = re.compile(
            f"(<!-- {re.escape(name)} -->\n).*?(<!-- end {re.escape(name)} -->)", re.DOTALL
        )
        if not marked.search(text):
            raise ConfigError(
                f"{page}: has no marks <!-- {name} --> and <!-- end {name} -->; add them where the"
                " text is to be"
            )
        text = marked.sub(
            lambda match, content=content: f"{match.group(1)}{content}\n{match.group(2)}",  # type: ignore[misc]
            text,
        )
    write_bytes(page, text.encode("utf-8"))


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
