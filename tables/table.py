"""Reading the tables, and lines of text that the writers share."""

import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
WIDTH = 100
WIRE_BYTES = {"u8": 1, "u16": 2, "u32": 4, "u64": 8, "i32": 4, "f32": 4, "char": 1}

Table = dict[str, Any]
Tables = dict[str, Table]
Lines = Iterator[str]


def read_tables() -> Tables:
    """Every table, by its file's name."""
    return {
        path.stem: tomllib.loads(path.read_text(encoding="utf-8"))
        for path in sorted((ROOT / "tables").glob("*.toml"))
    }


def types_of(table: Table) -> dict[str, Table]:
    """Enums and structs by their name in C."""
    return {one["c"]: one for kind in ("enum", "struct") for one in table.get(kind, [])}


def enum_of(tables: Tables, name: str) -> Table:
    """Return the enum with the C name ``name``, from any table."""
    return next(types_of(table)[name] for table in tables.values() if name in types_of(table))


def split_type(kind: str) -> tuple[str, int]:
    """ "u32[5]" to ("u32", 5); without brackets the number is 0."""
    match = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", kind)
    assert match is not None, kind
    return match[1], int(match[2] or 0)


def size_on_wire(known: dict[str, Table], kind: str) -> int:
    """Bytes of a number, or of a struct in ``known``."""
    if kind in WIRE_BYTES:
        return WIRE_BYTES[kind]
    fields = (split_type(row[1]) for row in known[kind]["rows"])
    return sum(size_on_wire(known, base) * max(count, 1) for base, count in fields)


def plain(text: str) -> str:
    """In one line."""
    return " ".join(text.split())


def wrapped(text: str, first: str, others: str) -> list[str]:
    """``text`` in lines of at most WIDTH, which begin so."""
    return textwrap.wrap(
        plain(text), WIDTH, initial_indent=first, subsequent_indent=others, break_on_hyphens=False
    )


def origin(name: str) -> str:
    """Return the sentence in a generated file that names its origin."""
    return f"Written by tables/make_tables.py from tables/{name}.toml."
