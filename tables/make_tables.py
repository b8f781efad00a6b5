"""Write the content of the tables in this folder to all places that need it: C headers, Python
modules and reference pages. From the messages' JSON Schema, write types for TypeScript and C++.

``python tables/make_tables.py`` writes; with ``--check`` it only names the files that differ, and
fails if any does. What it writes is committed, so that no build needs this program.

A table is a TOML file. ``[[enum]]`` and ``[[struct]]`` are types of C, in the order of the header;
their ``rows`` are members:

- of an enum: name, number, what it means; where needed, further columns that the enum's table names
- of a struct: name, type, what it is; where Python has it in another form, that form (FORMS in
  ``write_python.py``)
- of ``[options]``: name, type, default value, least, greatest, what it is
- of a group in ``constants.toml``: name, value, unit, what it is, what it trades; the group says
  how its numbers were chosen, and what checks them
"""

import sys
from collections.abc import Iterator
from pathlib import Path

from table import ROOT, Tables, read_tables
from write_c import c_headers, c_layouts, c_options, c_texts
from write_constants import c_constants
from write_docs import pages
from write_python import python_modules
from write_types import message_types


def written(tables: Tables) -> Iterator[tuple[Path, str]]:
    """Each file that comes from the tables, with its content."""
    for path, lines in (
        *c_headers(tables),
        *c_texts(tables),
        *c_options(tables),
        *c_layouts(tables),
        *c_constants(tables),
        *python_modules(tables),
        *pages(tables),
        *message_types(),
    ):
        yield ROOT / path, "\n".join(lines).rstrip("\n") + "\n"


def main(*arguments: str) -> int:
    stale = [
        (path, content)
        for path, content in written(read_tables())
        if not path.exists() or path.read_text(encoding="utf-8") != content
    ]
    for path, content in stale:
        print(path.relative_to(ROOT))
        if "--check" not in arguments:
            path.write_text(content, encoding="utf-8")
    return int("--check" in arguments and bool(stale))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
