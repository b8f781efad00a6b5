"""The tables in the reference pages, between marks: ``<!-- table NAME -->``, ``<!-- end -->``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from table import ROOT, Lines, Table, Tables, plain, size_on_wire, split_type, types_of, wrapped

MARKED = re.compile(r"(<!-- table (\w+) -->\n).*?(?=<!-- end -->)", re.DOTALL)


def pages(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """Each page that has a mark, with what stands between its marks made again."""
    known = {name: one for table in tables.values() for name, one in types_of(table).items()}
    for path in sorted((ROOT / "docs" / "reference").glob("*.md")):
        page = path.read_text(encoding="utf-8")
        if not MARKED.search(page):
            continue
        again = MARKED.sub(lambda m: m[1] + "\n".join(_table(tables, known, m[2])) + "\n", page)
        yield str(path.relative_to(ROOT)), iter(again.split("\n"))


def _table(tables: Tables, known: dict[str, Table], name: str) -> Lines:
    if name == "eits_options":
        yield from _options(tables["options"]["options"])
    elif name == "commands":
        yield from _commands(known)
    elif "prefix" in known[name]:
        yield from _enum(known[name])
    else:
        yield from _struct(known, known[name])


def _row(*cells: Any) -> str:
    return "| " + " | ".join(plain(str(cell)).replace("|", "\\|") for cell in cells) + " |"


def _enum(enum: Table) -> Lines:
    """Number, name (or text), meaning, and the columns for the page; text where there are none."""
    columns = enum.get("columns", [])
    if not columns:
        yield from ("```text", *_values(enum), "```")
        return
    texts = columns[:1] == ["text"]
    shown = columns[texts:]
    yield _row("number", "name", "what", *shown)
    yield "|---|---|---|" + "---|" * len(shown)
    for name, value, doc, *others in enum["rows"]:
        number = f"0x{value:02x}" if enum.get("hexadecimal") else value
        named = f"`{others[0]}`" if texts else name
        yield _row(number, named, doc, *others[texts : texts + len(shown)])


def _values(enum: Table) -> Lines:
    width = max(len(row[0]) for row in enum["rows"])
    for name, value, doc, *_ in enum["rows"]:
        number = f"0x{value:02x}" if enum.get("hexadecimal") else value
        head = f"{number:>6}  {name:<{width}}  "
        yield from wrapped(doc, head, " " * len(head))


def _struct(known: dict[str, Table], struct: Table) -> Lines:
    """Offset, type, name and meaning of each field."""
    yield from ("```text", *_fields(known, struct["rows"], 0), "```")


def _commands(known: dict[str, Table]) -> Lines:
    """The fields of each command that has any, behind its request number."""
    yield "```text"
    for name, _, _, payload, *python in known["eits_packet_type"]["rows"]:
        if python and len(known[payload]["rows"]) > 1:
            bytes_follow = " + k" * bool(known[payload].get("bytes_follow"))
            yield f"{name}, {size_on_wire(known, payload)}{bytes_follow} bytes"
            yield from _fields(known, known[payload]["rows"][1:], 4)
    yield "```"


def _fields(known: dict[str, Table], rows: list[list[Any]], offset: int) -> Lines:
    for name, kind, doc, *_ in rows:
        head = f"{offset:6d}  {kind.removeprefix('eits_'):<8}  "
        yield from wrapped(f"{name}: {doc}" if doc else name, head, " " * len(head))
        base, count = split_type(kind)
        offset += size_on_wire(known, base) * max(count, 1)


def _options(options: Table) -> Lines:
    yield from (_row("option", "usual", "least", "greatest", "what"), "|---|---|---|---|---|")
    for name, kind, usual, least, greatest, doc in options["rows"]:
        if kind not in ("u32", "real"):
            least, greatest = "", ""
        shown = str(usual).replace("EITS_", "").lower()
        yield _row(f"`{name}`", shown, least, {"any": "", "huge": ""}.get(greatest, greatest), doc)
