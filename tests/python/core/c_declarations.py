"""Declarations of C headers and of a cffi cdef, read as text into plain values that can be
compared.

Reads what this project writes: enums, structs, prototypes and object-like macros at file level. Not
a parser of C at large: what it does not understand it reports, so that nothing is passed over in
silence.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

OPEN = "..."  # in a cdef: the compiler knows the rest


@dataclass(frozen=True)
class Struct:
    """Fields as (name, type), in order; ``open`` where the cdef leaves some to the compiler."""

    fields: tuple[tuple[str, str], ...]
    open: bool = False


@dataclass
class Declarations:
    """All of a text. Enums: members as (name, stated value or None). Functions: (result, (type,
    name) of each parameter)."""

    enums: dict[str, tuple[tuple[str, int | None], ...]] = field(default_factory=dict)
    structs: dict[str, Struct] = field(default_factory=dict)
    functions: dict[str, tuple[str, tuple[tuple[str, str], ...]]] = field(default_factory=dict)
    opaque: set[str] = field(default_factory=set)
    macros: set[str] = field(default_factory=set)
    not_understood: list[str] = field(default_factory=list)


def parse(text: str) -> Declarations:
    """The declarations in ``text``, of both branches of conditionals, but for what is there for C++
    alone."""
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    text = re.sub(r"\\\n", " ", text)
    text = re.sub(r"#ifdef __cplusplus\n.*?#endif", "", text, flags=re.S)
    found = Declarations()
    lines = []
    for line in text.splitlines():
        if line.lstrip().startswith("#"):
            macro = re.match(r"\s*#\s*define\s+(\w+)(?!\()\b", line)
            if macro and not re.match(r"\s*#\s*define\s+\w+\(", line):
                found.macros.add(macro.group(1))
        else:
            lines.append(line)
    for statement in _statements(" ".join(lines)):
        _read(statement, found)
    return found


def _statements(text: str) -> list[str]:
    """Split at the semicolons outside of braces."""
    depth, start, parts = 0, 0, []
    for place, letter in enumerate(text):
        depth += (letter == "{") - (letter == "}")
        if letter == ";" and depth == 0:
            parts.append(text[start:place])
            start = place + 1
    parts.append(text[start:])
    return [" ".join(part.split()) for part in parts if part.strip(" }\n\t")]


def _read(statement: str, found: Declarations) -> None:
    enum = re.fullmatch(r"typedef enum (?:\w+ )?\{(.*)\} ?(\w+)", statement)
    struct = re.fullmatch(r"typedef struct (?:\w+ )?\{(.*)\} ?(\w+)", statement)
    opaque = re.fullmatch(r"typedef struct (\w+) \1", statement)
    function = re.fullmatch(r"([\w ]+[ *]+)(\w+) ?\((.*)\)", statement)
    if enum:
        found.enums[enum.group(2)] = _members(enum.group(1))
    elif opaque:
        found.opaque.add(opaque.group(1))
    elif struct:
        found.structs[struct.group(2)] = _fields(struct.group(1), found)
    elif function:
        parameters = (
            [] if function.group(3).strip() in ("", "void") else function.group(3).split(",")
        )
        found.functions[function.group(2)] = (
            _type(function.group(1)),
            tuple(_declarator(p) for p in parameters),
        )
    elif not re.fullmatch(r"struct \w+|typedef (?:float|double) eits_real", statement):
        found.not_understood.append(statement)


def _members(body: str) -> tuple[tuple[str, int | None], ...]:
    members = []
    for part in filter(None, (part.strip() for part in body.split(","))):
        name, _, value = (word.strip() for word in part.partition("="))
        if name != OPEN:
            members.append((name, int(value, 0) if value else None))
    return tuple(members)


def _fields(body: str, found: Declarations) -> Struct:
    fields, is_open = [], False
    for statement in filter(None, (part.strip() for part in body.split(";"))):
        if statement == OPEN:
            is_open = True
            continue
        first, *others = (part.strip() for part in statement.split(","))
        kind, name = _declarator(first)
        if not name:
            found.not_understood.append(statement)
            continue
        fields.append((name, kind))
        base = kind.partition("[")[0].rstrip("* ")
        for other in others:
            other_kind, other_name = _declarator(f"{base} {other}")
            fields.append((other_name, other_kind))
    return Struct(tuple(fields), is_open)


def _declarator(text: str) -> tuple[str, str]:
    """(type, name) of ``const float *scale`` or ``eits_touch last[EITS_MAX_TOUCHES]``."""
    match = re.fullmatch(r"(.*?[\s*])(\w+)\s*((?:\[\w*\])*)", text.strip())
    if not match:
        return text.strip(), ""
    return _type(match.group(1)) + match.group(3), match.group(2)


def _type(text: str) -> str:
    """Spelled in one way: ``const void *``."""
    return re.sub(r"\s+", " ", text.replace("*", " * ")).strip()


def differences(cdef: Declarations, header: Declarations) -> list[str]:
    """Each way in which the cdef does not say what the headers say; empty where they agree."""
    wrong = [f"not understood: {text}" for text in (*cdef.not_understood, *header.not_understood)]
    for name, members in cdef.enums.items():
        stated = header.enums.get(name, ())
        if [member for member, _ in members] != [member for member, _ in stated]:
            wrong.append(f"enum {name}: members or their order")
        for (member, value), (_, true_value) in zip(members, stated, strict=False):
            if value is not None and value != true_value:
                wrong.append(f"enum {name}: value of {member}")
    for name, struct in cdef.structs.items():
        stated_fields = header.structs.get(name, Struct(())).fields
        if struct.open:
            known = {field_name for field_name, _ in struct.fields}
            stated_fields = tuple(pair for pair in stated_fields if pair[0] in known)
        if struct.fields != stated_fields:
            wrong.append(f"struct {name}: fields, their order or types")
    for name, prototype in cdef.functions.items():
        if header.functions.get(name) != prototype:
            wrong.append(f"function {name}: result or parameters")
    wrong += [
        f"function {name}: not in the cdef"
        for name in header.functions.keys() - cdef.functions.keys()
    ]
    wrong += [f"opaque {name}: in one alone" for name in cdef.opaque ^ header.opaque]
    wrong += [f"macro {name}: not in the headers" for name in cdef.macros - header.macros]
    return wrong
