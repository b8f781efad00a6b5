"""The tables as Python modules: options, diagnostics and info of a frame, packets of the link."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from table import WIDTH, Lines, Table, Tables, enum_of, origin, plain, split_type, types_of, wrapped
from write_constants import python_constants

# how Python has a field that is not a plain number: its type, and its value where none is given
FORMS = {
    "text": ("str", '""'),
    "version": ("tuple[int, int, int]", "(0, 0, 0)"),
    "hash": ("bytes", "bytes(32)"),
    "pair": ("tuple[int, int]", "(0, 0)"),
    "words": ("tuple[int, int, int, int, int]", "(0, 0, 0, 0, 0)"),
    "electrodes": ("tuple[int, ...]", "()"),
    "stop": ("str", '""'),
    "shown": ("str", '"solver"'),
    "negated": ("int", "0"),
    "flag": ("bool", "False"),
    "unless": ("bool", "True"),
    "stages": ("dict[str, StageStats]", "{}"),
    "known": ("float | None", "None"),  # None: not known, 0 in C
    "one": ("int", "1"),  # a number, 1 where none is given
}
REALS = ("f32", "real")
LETTERS = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q", "i32": "i", "f32": "f", "char": "s"}


def python_modules(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """Each module with its lines."""
    yield "python/eitskin/core/options_table.py", _options_module(tables)
    yield "python/eitskin/core/diagnostics_table.py", _diagnostics_module(tables)
    yield "python/eitskin/core/constants_table.py", _constants_module(tables)
    yield "python/eitskin/core/gestures_table.py", _gestures_module(tables)
    if "link" in tables:
        yield "python/eitskin/device/wire/link_table.py", _link_module(tables)


def _head(about: str, name: str, imports: str) -> Lines:
    yield from docstring(f"{about} {origin(name)}", "")
    yield ""
    yield from imports.strip("\n").split("\n")
    yield ""


def docstring(text: str, indent: str) -> Lines:
    lines = wrapped(text, f'{indent}"""', indent)
    if len(lines) == 1 and len(lines[0]) <= 97:
        yield f'{lines[0]}"""'
    else:
        yield from (*lines, f'{indent}"""')


def remark(text: str, indent: str = "") -> Lines:
    yield from wrapped(text, f"{indent}# ", f"{indent}# ")


def said(line: str, doc: str) -> Lines:
    """``line`` with its remark behind it, or above where it does not fit."""
    short = f"{line}  # {plain(doc)}" if doc else line
    if len(short) <= WIDTH:
        yield short
    else:
        indent = line[: len(line) - len(line.lstrip())]
        yield from (*remark(doc, indent), line)


def joined(before: str, items: Sequence[str]) -> Lines:
    """A tuple in one line, or one item a line where it does not fit."""
    short = f"{before}({', '.join(items)})"
    if len(short) <= WIDTH:
        yield short
    else:
        yield from (f"{before}(", *(f"    {item}," for item in items), ")")


def word(name: str) -> str:
    """ "WORKING_SET" to "working-set"."""
    return name.lower().replace("_", "-")


# ---- enums ----


def _names(enum: Table, name: str) -> Lines:
    """A tuple of the members' names, or of their texts, in order."""
    texts = enum.get("columns", [""])[0] == "text"
    yield from remark(f"{enum['c']}: {enum['doc']}")
    items = [f'"{row[3] if texts else word(row[0])}"' for row in enum["rows"]]
    yield from joined(f"{name} = ", items)


def _numbers(enum: Table) -> Lines:
    """A number a member, and all bits."""
    yield from remark(f"{enum['c']}: {enum['doc']}")
    yield from (f"{name} = {value}" for name, value, *_ in enum["rows"])
    if "all" in enum:
        yield f"{all_name(enum)} = {_all(enum)}"


def all_name(enum: Table) -> str:
    """ "EITS_TOUCH_FIT_ALL" to "ALL_TOUCH_FIT"."""
    return f"ALL_{enum['all'].removeprefix('EITS_').removesuffix('_ALL')}"


def _all(enum: Table) -> int:
    return int(sum(row[1] for row in enum["rows"]))


def _class(enum: Table) -> Lines:
    kind, _, name = enum["python"].partition(" ")
    yield from ("", "", f"class {name}({kind}):")
    yield from docstring(f"{enum['c']}: {enum['doc']}", "    ")
    yield ""
    for member, value, doc, *_ in enum["rows"]:
        number = f"0x{value:X}" if enum.get("hexadecimal") else value
        yield from said(f"    {member} = {number}", doc)


# ---- options ----


def _options_module(tables: Tables) -> Lines:
    table, types = tables["options"]["options"], types_of(tables["options"])
    rows = sorted(table["rows"], key=lambda row: row[2] not in ("model", "rule"))
    yield from _head(
        "The options of the core.",
        "options",
        "from dataclasses import dataclass\n\n"
        "from eitskin.core.diagnostics_table import ALL_DIAGNOSTICS",
    )
    for enum in tables["options"]["enum"]:
        yield from _numbers(enum) if "all" in enum else _names(enum, enum["python"])
    for name, value in tables["options"]["limits"].items():
        yield f"{name} = {value}"
    yield from ("", "", "@dataclass(frozen=True)", "class OptionFields:")
    yield from docstring(table["doc"], "    ")
    yield ""
    for name, kind, default, _, _, doc in rows:
        yield from said(f"    {name}: {_option_type(kind)}{_default(tables, kind, default)}", doc)
    yield from ("", "", *remark("Least and greatest value of each option that is a number."))
    yield "RANGES: dict[str, tuple[float, float]] = {"
    for name, kind, _, least, greatest, _ in table["rows"]:
        if _option_type(kind) in ("int", "float"):
            bits = kind.startswith("bits ")
            low = 0 if bits else _limit(least)
            high = _all(enum_of(tables, kind[5:])) if bits else _limit(greatest)
            yield f'    "{name}": ({low}, {high}),'
    yield from (
        "}",
        *remark("The names that an option may have, and the numbers that stand for them."),
    )
    yield "CHOICES: dict[str, dict[str, int]] = {"
    for name, kind, *_ in (row for row in table["rows"] if row[1].startswith("eits_")):
        numbers = ", ".join(f'"{word(row[0])}": {row[1]}' for row in types[kind]["rows"])
        yield f'    "{name}": {{{numbers}}},'
    yield "}"
    yield from remark("The own defaults of a model, by the same names.")
    yield from joined("OF_MODEL = ", [f'"{row[0]}"' for row in rows if row[2] == "model"])


def _option_type(kind: str) -> str:
    plain = {"u32": "int", "real": "float", "flag": "bool"}
    return plain.get(kind, "int" if kind.startswith("bits ") else "str")


def _default(tables: Tables, kind: str, default: Any) -> str:
    if default in ("model", "rule"):
        return ""
    if kind.startswith("eits_"):
        prefix = enum_of(tables, kind)["prefix"]
        return f' = "{word(default.removeprefix(prefix))}"'
    if kind.startswith("bits "):
        return f" = {all_name(enum_of(tables, kind[5:]))}"
    types = {"flag": bool, "real": float}
    return f" = {types[kind](default)}" if kind in types else f" = {_limit(default)}"


def _limit(value: Any) -> str:
    named = {"any": "2**32 - 1", "huge": "1e30"}
    return named.get(value, str(value).removeprefix("EITS_"))


# ---- structs ----


def _python_type(kind: str, form: str = "") -> tuple[str, str]:
    """Type of a field and its value where none is given."""
    if form:
        return FORMS[form]
    return ("float", "0.0") if split_type(kind)[0] in REALS else ("int", "0")


def _fields(
    struct: Table, rows: list[list[Any]], wire_type: Callable[..., str] | None = None
) -> Lines:
    """The fields, those from ``optional_from`` on with a value where none is given; of a type on
    the wire where there is one."""
    optional = False
    for name, kind, doc, *form in rows:
        optional = optional or struct.get("optional_from") == name
        of_type, value = _python_type(kind, *form)
        of_type = wire_type(kind, *form) if wire_type else of_type
        yield from said(f"    {safe(name)}: {of_type}{f' = {value}' if optional else ''}", doc)


def safe(name: str) -> str:
    """``lambda`` is a word of Python's, and it has the stages by name."""
    return {"lambda": "lambda_", "stage": "stages"}.get(name, name)


def _dataclass(struct: Table, bases: str = "") -> Lines:
    yield from ("", "", "@dataclass(frozen=True)", f"class {struct['python']}{bases}:")
    yield from docstring(f"{struct['c']}: {struct['doc']}", "    ")
    yield from ("", *_fields(struct, struct["rows"]))


def _diagnostics_module(tables: Tables) -> Lines:
    types = types_of(tables["diagnostics"])
    yield from _head(
        "Diagnostics and info of a frame, from the core.",
        "diagnostics",
        "from dataclasses import dataclass",
    )
    yield from _names(types["eits_diagnostic"], "DIAGNOSTICS")
    yield f"{all_name(types['eits_diagnostic'])} = {_all(types['eits_diagnostic'])}"
    yield from _names(types["eits_stop"], "STOPS")
    yield from _names(types["eits_shown"], "SHOWN")
    yield from _dataclass(types["eits_info"])
    yield from _dataclass(types["eits_touch"])


def _gestures_module(tables: Tables) -> Lines:
    types = types_of(tables["gestures"])
    yield from list(_head("Events from touches in time.", "gestures", "from enum import IntEnum"))[
        :-1
    ]
    yield from _class(types["eits_event_kind"] | {"python": "IntEnum EventKind"})
    yield from _class(types["eits_event_phase"] | {"python": "IntEnum EventPhase"})


def _constants_module(tables: Tables) -> Lines:
    yield from docstring(
        "The core's numbers that are a choice; tables/constants.toml has their reasons."
        f" {origin('constants')}",
        "",
    )
    yield from python_constants(tables)


# ---- link ----


def _link_module(tables: Tables) -> Lines:
    table, types = tables["link"], types_of(tables["link"])
    yield from _head(
        "Packets of the link: their numbers, and their fields as they lie on the wire.",
        "link",
        "from dataclasses import dataclass\nfrom enum import IntEnum, IntFlag\n"
        "from typing import Annotated\n\n"
        "from eitskin.device.wire.layout import Command, Payload",
    )
    yield from (f"{name} = {value}" for name, value in table["numbers"].items())
    yield from _names(types["eits_stage"], "STAGES")
    yield from _wire_types(table["struct"])
    for enum in table["enum"]:
        if "python" in enum:
            yield from _class(enum)
    for struct in table["struct"]:
        if "python" in struct:
            yield from _payload(struct)
    for name, _, doc, content, *python in types["eits_packet_type"]["rows"]:
        if python:
            yield from _command(types[content], name, doc, python[0])


def _wire_types(structs: Sequence[Table]) -> Lines:
    """A name for each kind of field on the wire."""
    rows = (row for struct in structs for row in struct["rows"])
    made = {_wire_type(kind, *form): (kind, *form) for _, kind, _, *form in rows}
    for name, (kind, *form) in sorted(made.items()):
        python = _python_type(kind, *form)[0].replace("StageStats", '"StageStats"')
        yield f'{name} = Annotated[{python}, "{_letters(kind)}", "{"".join(form)}"]'


def _wire_type(kind: str, form: str = "") -> str:
    """u32 is U32, 16 characters are Text16, an electrode mask is Electrodes."""
    count = split_type(kind)[1] if form == "text" else ""
    return f"{(form or kind).capitalize()}{count}"


def _letters(kind: str) -> str:
    """A field as ``struct`` has it; bytes and texts in one piece."""
    base, count = split_type(kind)
    if base == "eits_stage_stats":
        return f"{4 * count}I"
    if base == "char" or (base == "u8" and count):
        return f"{count}s"
    return f"{count}{LETTERS[base]}" if count else LETTERS[base]


def _payload(struct: Table) -> Lines:
    yield from ("", "", "@dataclass(frozen=True)")
    yield f'class {struct["python"]}(Payload, c="{struct["c"]}"):'
    yield from docstring(struct["doc"], "    ")
    yield from ("", *_fields(struct, struct["rows"], _wire_type))


def _command(struct: Table, packet: str, doc: str, python: str) -> Lines:
    """A command; its request number is not a field, since the link gives it."""
    yield from ("", "", "@dataclass(frozen=True)")
    yield f'class {python}(Command, c="{struct["c"]}", kind=PacketType.{packet}):'
    yield from docstring(doc, "    ")
    fields = [*_fields(struct, struct["rows"][1:], _wire_type)]
    if struct.get("bytes_follow"):
        fields.append('    data: bytes = b""')
    if fields:
        yield from ("", *fields)
