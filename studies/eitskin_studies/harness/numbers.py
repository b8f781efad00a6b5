"""The stored numbers behind pages: the values with which a command filled a page's marks, and the
commit.

``studies/results/numbers/PAGE.json`` holds them mark by mark, because a page may be filled by
several commands. A test fills each page from its file again and compares. The README's numbers are
taken from the tables of the pages.
"""

import json
import re
from pathlib import Path
from typing import Any

from eitskin.errors import ConfigError
from eitskin.fileio import parse_json, read_bytes, write_bytes
from eitskin_studies.harness.commit import last_commit

FOLDER = "numbers"
FORMAT = "eitskin-numbers"
MEASURED = ("csrc", "python", "studies/eitskin_studies")  # what a number depends on
_MARKED = re.compile(r"<!-- (?!end )([^>]+?) -->\n(.*?)\n<!-- end \1 -->", re.DOTALL)

Texts = dict[str, str]
Tables = dict[str, tuple[Any, Any]]


def file_of(page: Path) -> Path:
    """The file of the numbers of ``page``, in a folder beside it."""
    return page.parent / FOLDER / f"{page.stem}.json"


def keep_numbers(page: Path, name: str, filling: tuple[Any, Any]) -> None:
    """Store the values that ``page`` was filled with, and the commit; other marks keep their
    values.

    Raises:
        FileError: it cannot be written.
        ConfigError: the file that is there does not hold numbers.
    """
    path, commit = file_of(page), last_commit(MEASURED)
    marks = _read(path)["marks"] if path.exists() else {}
    texts, tables = filling
    marks |= {mark: {"commit": commit, "text": text} for mark, text in texts.items()}
    marks |= {
        mark: {"commit": commit, "head": list(head), "rows": [list(row) for row in rows]}
        for mark, (head, rows) in tables.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    # a line a mark, so that differences can be read
    lines = ",\n".join(f"{json.dumps(mark)}: {json.dumps(marks[mark])}" for mark in sorted(marks))
    head = json.dumps({"format": FORMAT, "page": name})[:-1]
    write_bytes(path, f'{head}, "marks": {{\n{lines}\n}}}}\n'.encode())


def stored_filling(path: Path) -> tuple[str, tuple[Texts, Tables]]:
    """The name of a page in ``pages.toml``, and the texts and tables that it was filled with.

    Raises:
        FileError, ConfigError: the file cannot be read, or does not hold numbers.
    """
    values = _read(path)
    texts = {mark: one["text"] for mark, one in values["marks"].items() if "text" in one}
    tables = {
        mark: (one["head"], one["rows"]) for mark, one in values["marks"].items() if "head" in one
    }
    return values["page"], (texts, tables)


def _read(path: Path) -> Any:
    try:
        values = parse_json(read_bytes(path, "stored numbers"))
        if values["format"] == FORMAT:
            return values
    except (ValueError, KeyError, TypeError):
        pass
    raise ConfigError(f"{path}: does not hold stored numbers; remove it and run its command again")


def tables_of(folder: Path) -> Tables:
    """The tables between marks of all pages in ``folder``, as "PAGE.MARK"."""
    found: Tables = {}
    for page in sorted(folder.glob("*.md")):
        for mark, content in _MARKED.findall(page.read_text(encoding="utf-8")):
            lines = [line for line in content.splitlines() if line.startswith("|")]
            if len(lines) > 2:
                rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
                found[f"{page.stem}.{mark}"] = (rows[0], rows[2:])
    return found
