"""The tables as C: public headers, texts of numbers, ranges of options."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from table import (
    WIDTH,
    Lines,
    Table,
    Tables,
    enum_of,
    origin,
    plain,
    size_on_wire,
    split_type,
    types_of,
    wrapped,
)

TYPES = {
    "u8": "uint8_t", "u16": "uint16_t", "u32": "uint32_t", "u64": "uint64_t", "i32": "int32_t",
    "f32": "float", "char": "char", "real": "eits_real", "flag": "uint32_t", "bits": "uint32_t",
}  # fmt: skip


def comment(text: str, indent: str = "") -> Lines:
    """A C comment, in one line or in as many as it needs."""
    one = f"{indent}/* {plain(text)} */"
    if len(one) <= WIDTH:
        yield one
        return
    lines = wrapped(text + " */", f"{indent}/* ", f"{indent} * ")
    if lines[-1].strip() == "* */":  # the end never stands alone
        before, _, last = lines[-2].rpartition(" ")
        lines[-2:] = [before, f"{indent} * {last} */"]
    yield from lines


def c_headers(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """The public headers that are whole tables."""
    for name, table in tables.items():
        if "header" in table:
            yield f"csrc/include/eitskin/{table['header']}", _header(name, table)


def _header(name: str, table: Table) -> Lines:
    guard = f"EITSKIN_{Path(table['header']).stem.upper()}_H"
    about = [*table["about"].strip().split("\n"), "", origin(name)]
    yield f"/* eitskin: {about[0]}"
    yield from (f" * {line}".rstrip() for line in about[1:])
    yield from (" */", f"#ifndef {guard}", f"#define {guard}", "")
    yield from (f'#include "eitskin/{other}"' for other in table["includes"])
    yield from ("", "#ifdef __cplusplus", 'extern "C" {', "#endif", "")
    types = types_of(table)
    for item in table["order"]:
        if item == "eits_options":
            yield from _options(table["options"])
        elif item in types:
            yield from _enum(types[item]) if "prefix" in types[item] else _struct(types[item])
        else:
            yield from table["text"][item].strip("\n").split("\n")
        yield ""
    yield from ("#ifdef __cplusplus", "}", "#endif", "#endif")


def _enum(enum: Table) -> Lines:
    yield from comment(enum["doc"])
    yield f"typedef enum {enum['c']} {{"
    for place, (name, value, doc, *_) in enumerate(enum["rows"], 1):
        if doc:
            yield from comment(doc, "    ")
        number = f"0x{value:02x}" if enum.get("hexadecimal") else str(value)
        yield f"    {enum['prefix']}{name} = {number}{',' * (place != len(enum['rows']))}"
    yield f"}} {enum['c']};"
    if "all" in enum:
        yield f"#define {enum['all']} {sum(row[1] for row in enum['rows'])}u"
    if "count" in enum:
        yield f"#define {enum['count']} {max(row[1] for row in enum['rows']) + 1}u"


def _struct(struct: Table) -> Lines:
    yield from comment(struct["doc"])
    yield f"typedef struct {struct['c']} {{"
    for name, kind, doc, *_ in struct["rows"]:
        yield from _field(name, kind, doc)
    yield f"}} {struct['c']};"


def _options(options: Table) -> Lines:
    yield from comment(options["doc"])
    yield "typedef struct eits_options {"
    for name, kind, _, _, _, doc in options["rows"]:
        yield from _field(name, kind.partition(" ")[0], doc)
    yield "} eits_options;"


def _field(name: str, kind: str, doc: str) -> Lines:
    base, count = split_type(kind)
    if doc:
        yield from comment(doc, "    ")
    yield f"    {TYPES.get(base, base)} {name}{f'[{count}]' if count else ''};"


def c_texts(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """The functions that put a number into words."""
    yield "csrc/src/base/texts.c", _texts(tables)


def _texts(tables: Tables) -> Lines:
    names = [name for name, table in tables.items() if any(map(_has_texts, table.get("enum", [])))]
    yield from comment("Numbers in words. " + " ".join(map(origin, names)))
    yield from (f'#include "eitskin/{tables[name]["header"]}"' for name in names)
    for enum in (one for name in names for one in tables[name]["enum"] if _has_texts(one)):
        short = enum["c"].removeprefix("eits_")
        yield from ("", f"const char *{enum['c']}_text({enum['c']} {short})", "{")
        yield f"    switch ({short}) {{"
        for name, _, _, text, *_ in enum["rows"]:
            yield from (f"    case {enum['prefix']}{name}:", f'        return "{text}";')
        yield from ("    }", f'    return "unknown {short}";', "}")


def _has_texts(enum: Table) -> bool:
    return bool(enum.get("columns", [""])[0] == "text")


def c_options(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """Ranges and default values of the options."""
    yield "csrc/src/model/options_table.h", _options_table(tables)


def _options_table(tables: Tables) -> Lines:
    rows = tables["options"]["options"]["rows"]
    yield from comment(
        f"Ranges and default values, included by options.c alone. {origin('options')}"
    )
    yield from (
        "/* clang-format off */",
        "#define OPTION(name, whole, least, greatest) \\",
        "    {#name, offsetof(eits_options, name), sizeof(((eits_options *)0)->name), whole, \\",
        "     (eits_real)least, (eits_real)greatest}",
        "static const eits_option OPTIONS[] = {",
    )
    for name, kind, _, least, greatest, _ in rows:
        low, high = limits(tables, kind, least, greatest)
        yield f"    OPTION({name}, {int(kind != 'real')}, {low}, {high}),"
    yield from ("};", "#undef OPTION", "")
    yield from comment("An option that depends on more of a model than its defaults is 0 here.")
    yield "static eits_options usual_options(const eits_defaults *d)"
    yield from ("{", "    return (eits_options){")
    for name, kind, default, *_ in rows:
        cast = "eits_real" if kind == "real" else kind if kind.startswith("eits_") else "uint32_t"
        value = (
            f"d->{name}" if default == "model" else "0" if default == "rule" else number(default)
        )
        yield f"        .{name} = ({cast}){value},"
    yield from ("    };", "}", "/* clang-format on */")


def c_layouts(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """That payloads lie in memory as on the wire: without padding, sizes say it all."""
    yield "csrc/src/link/layouts.h", _layouts(tables["link"])


def _layouts(link: Table) -> Lines:
    yield from comment(f"Payloads are copied as they lie in memory. {origin('link')}")
    known = types_of(link)
    for struct in link["struct"]:
        name, size = struct["c"], size_on_wire(known, struct["c"])
        yield f'_Static_assert(sizeof({name}) == {size}, "{name} has padding");'


def limits(tables: Tables, kind: str, least: Any, greatest: Any) -> tuple[str, str]:
    """Least and greatest value of an option, as C has them."""
    if kind == "flag":
        return "0", "1"
    if kind.startswith("bits "):
        return "0", str(enum_of(tables, kind.removeprefix("bits "))["all"])
    if kind.startswith("eits_"):
        return "0", str(max(row[1] for row in enum_of(tables, kind)["rows"]))
    return number(least), number(greatest)


def number(value: Any) -> str:
    """A value of a table: a whole number or a name as it stands, else a float."""
    if isinstance(value, float):
        return f"{value!r}f"
    return {"any": "UINT32_MAX", "huge": "1e30f"}.get(value, str(value))
