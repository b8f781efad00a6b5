"""The tables in the reference pages, between marks: ``<!-- table NAME -->``, ``<!-- end -->``."""

import re
from collections.abc import Iterator
from typing import Any

from table import ROOT, Lines, Table, Tables, plain, size_on_wire, types_of, wrapped

MARKED = re.compile(r"(<!-- table (\w+) -->\n).*?(?=<!-- end -->)", re.DOTALL)


def pages(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """Yield each page with marks, with the text between its marks generated again."""
    known = {name: one for table in tables.values() for name, one in types_of(table).items()}
    for path in sorted((ROOT / "docs" / "reference").glob("*.md")):
        page = path.read_text(encoding="utf-8")
        if not MARKED.search(page):
            continue
        again = MARKED.sub(lambda m: m[1] + "\n".join(_table(tables, known, m[2])) + "\n", page)
        yield str(path.relative_to(ROOT)), iter(again.split("\n"))


def _table(tables: Tables, known: dict[str, Table], name: str) -> Lines:
    if name == "eits_options":
        yield from _options(tables["options"]["options"], tables["options"]["limits"])
    else:
        yield from _enum(known, known[name])


def _row(*cells: Any) -> str:
    return "| " + " | ".join(plain(str(cell)).replace("|", "\\|") for cell in cells) + " |"


def _enum(known: dict[str, Table], enum: Table) -> Lines:
    """Number, name, meaning, and the columns for the page, structs with their bytes: a table where
    the first of them is a text in place of the name, else a list; text if there are none."""
    columns = enum.get("columns", [])
    if not columns:
        yield from ("```text", *_values(enum), "```")
        return
    texts = columns[:1] == ["text"]
    shown = columns[texts:]
    if texts:
        yield _row("number", "name", "what", *shown)
        yield "|---|---|---|" + "---|" * len(shown)
    for name, value, doc, *others in enum["rows"]:
        number = f"0x{value:02x}" if enum.get("hexadecimal") else value
        named = f"`{others[0]}`" if texts else name
        cells = [_sized(known, cell) for cell in others[texts : texts + len(shown)]]
        if texts:
            yield _row(number, named, doc, *cells)
        else:
            yield from wrapped("; ".join([doc, *cells]), f"- {number} {named}: ", "  ")


def _sized(known: dict[str, Table], payload: str) -> str:
    """A payload, its structs with their bytes."""
    struct = re.compile(r"eits_(?:packet|command)_\w+")
    return struct.sub(lambda m: f"{m[0]} ({size_on_wire(known, m[0])})", payload)


def _values(enum: Table) -> Lines:
    width = max(len(row[0]) for row in enum["rows"])
    for name, value, doc, *_ in enum["rows"]:
        number = f"0x{value:02x}" if enum.get("hexadecimal") else value
        head = f"{number:>6}  {name:<{width}}  "
        yield from wrapped(doc, head, " " * len(head))


def _options(options: Table, limits: Table) -> Lines:
    for name, kind, default, least, greatest, doc in options["rows"]:
        most = limits.get(str(greatest).removeprefix("EITS_"), greatest)
        span = f"from {least}" if greatest in ("any", "huge") else f"{least} to {most}"
        shown = str(default).replace("EITS_", "").replace("SIGN_", "").lower()
        shown += f"; {span}" if kind in ("u32", "real") else ""
        yield from wrapped(plain(doc), f"- `{name}` ({shown}): ", "  ")
