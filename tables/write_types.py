"""TypeScript declarations and a C++ header of the messages, from their JSON Schema
(``python/eitskin/session/message.schema.json``), for receivers in these languages.

Of JSON Schema this knows what that file uses: objects with properties, arrays, enums, constants,
references, and types that may also be null. Anything else is an error.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from table import ROOT, Lines, wrapped

SCHEMA = "python/eitskin/session/message.schema.json"
TYPESCRIPT, CPP = "examples/types/eitskin_message.d.ts", "examples/types/eitskin_message.hpp"
SIMPLE = {"integer": "integer", "number": "number", "string": "string", "boolean": "boolean"}
IN_TYPESCRIPT = {"integer": "number", "object": "Record<string, unknown>"}
IN_CPP = {
    "integer": "std::int64_t",
    "number": "double",
    "string": "std::string",
    "boolean": "bool",
}
CPP_WORDS = ("true", "false", "default", "new", "delete", "class")


@dataclass(frozen=True)
class Kind:
    """A type: a simple one, "object" (of anything), the name of a structure, or an array of
    ``items``; ``values`` are all that a string or number can be."""

    name: str
    items: "Kind | None" = None
    values: tuple[str | int, ...] = ()
    nullable: bool = False


@dataclass(frozen=True)
class Member:
    name: str
    kind: Kind
    required: bool
    doc: str


@dataclass(frozen=True)
class Structure:
    name: str
    members: tuple[Member, ...]


class Reader:
    """The structures of a schema in ``structures``, each behind those that it has in it."""

    def __init__(self, schema: dict[str, Any]) -> None:
        self.defs = schema["$defs"]
        self.structures: dict[str, Structure] = {}
        self.messages = [self.kind(one, "").name for one in schema["oneOf"]]

    def kind(self, schema: dict[str, Any], name: str) -> Kind:
        """The type that ``schema`` describes; ``name`` is for an object that has no other."""
        if "$ref" in schema:
            target = schema["$ref"].removeprefix("#/$defs/")
            return self.kind(self.defs[target], pascal(target))
        if "const" in schema or "enum" in schema:
            values = tuple(schema.get("enum", [schema.get("const")]))
            return Kind("string" if isinstance(values[0], str) else "integer", values=values)
        types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
        (kind,) = (one for one in types if one != "null")
        made = self._of(kind, schema, name)
        return replace(made, nullable="null" in types)

    def _of(self, kind: str, schema: dict[str, Any], name: str) -> Kind:
        if kind == "array":
            return Kind("array", items=self.kind(schema["items"], name.removesuffix("s")))
        if kind == "object" and "properties" in schema:
            self._structure(schema, name)
            return Kind(name)
        return Kind("object" if kind == "object" else SIMPLE[kind])

    def _structure(self, schema: dict[str, Any], name: str) -> None:
        if name in self.structures:
            return
        members = tuple(
            Member(
                key,
                self.kind(one, name + pascal(key)),
                key in schema["required"],
                one.get("description", ""),
            )
            for key, one in schema["properties"].items()
        )
        self.structures[name] = Structure(name, members)


def pascal(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def message_types() -> Iterator[tuple[str, Lines]]:
    """Both files, with their lines."""
    reader = Reader(json.loads((ROOT / SCHEMA).read_text(encoding="utf-8")))
    yield TYPESCRIPT, _typescript(reader)
    yield CPP, _cpp(reader)


# ---- TypeScript


def _typescript(reader: Reader) -> Lines:
    yield f"// Written by tables/make_tables.py from {SCHEMA}."
    yield "// The messages of eitskin, version 1: docs/reference/message.md."
    for one in reader.structures.values():
        yield ""
        yield f"export interface {one.name} {{"
        for member in one.members:
            yield from _comment(member.doc)
            mark = "" if member.required else "?"
            yield f"  {member.name}{mark}: {in_typescript(member.kind)};"
        yield "}"
    yield ""
    yield f"export type Message = {' | '.join(reader.messages)};"


def _comment(doc: str) -> Lines:
    if doc:
        lines = list(wrapped(doc, "  /** ", "   *  "))
        yield from (*lines[:-1], lines[-1] + " */")


def in_typescript(kind: Kind) -> str:
    if kind.items is not None:
        inner = in_typescript(kind.items)
        shown = f"({inner})[]" if " " in inner else f"{inner}[]"
    elif kind.values:
        shown = " | ".join(json.dumps(value) for value in kind.values)
    else:
        shown = IN_TYPESCRIPT.get(kind.name, kind.name)
    return f"{shown} | null" if kind.nullable else shown


# ---- C++

CPP_HEAD = f"""// Written by tables/make_tables.py from {SCHEMA}.
// The messages of eitskin, version 1: docs/reference/message.md. C++17.
//
// from_json reads each structure from the JSON of nlohmann/json, or of a library with the same
// functions: `json.get<eitskin::Frame>()`. Members that a message may lack, or that may be null,
// are std::optional. Objects without a fixed form (`info`, `link`, ...) are left out: read them
// from the JSON.
#ifndef EITSKIN_MESSAGE_HPP
#define EITSKIN_MESSAGE_HPP

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace eitskin {{
namespace detail {{

template <class T> struct value {{
    template <class Json> static void read(const Json &from, T &to) {{ from.get_to(to); }}
}};
template <class T> struct value<std::optional<T>> {{
    template <class Json> static void read(const Json &from, std::optional<T> &to)
    {{
        if (from.is_null()) {{
            to.reset();
            return;
        }}
        T read{{}};
        value<T>::read(from, read);
        to = std::move(read);
    }}
}};
template <class T> struct value<std::vector<T>> {{
    template <class Json> static void read(const Json &from, std::vector<T> &to)
    {{
        to.clear();
        for (const auto &one : from) {{
            T read{{}};
            value<T>::read(one, read);
            to.push_back(std::move(read));
        }}
    }}
}};
template <class Json, class T> void member(const Json &from, const char *name, T &to)
{{
    const auto found = from.find(name);
    if (found != from.end())
        value<T>::read(*found, to);
}}

}} // namespace detail"""


def _cpp(reader: Reader) -> Lines:
    yield from CPP_HEAD.split("\n")
    for one in reader.structures.values():
        members = [member for member in one.members if in_cpp(member) is not None]
        yield ""
        yield f"struct {one.name} {{"
        for member in members:
            yield from wrapped(member.doc, "    // ", "    // ")
            yield f"    {in_cpp(member)} {cpp_name(member.name)}{_initial(member)};"
        yield "};"
        yield f"template <class Json> void from_json(const Json &from, {one.name} &to)"
        yield "{"
        for member in members:
            yield f'    detail::member(from, "{member.name}", to.{cpp_name(member.name)});'
        yield "}"
    yield from ("", "} // namespace eitskin", "", "#endif")


def cpp_name(name: str) -> str:
    return name + "_" if name in CPP_WORDS else name


def in_cpp(member: Member) -> str | None:
    """Its type in C++; None: it is left out."""
    shown = _cpp_kind(member.kind)
    optional = member.kind.nullable or not member.required
    return f"std::optional<{shown}>" if shown is not None and optional else shown


def _cpp_kind(kind: Kind) -> str | None:
    if kind.items is not None:
        inner = _cpp_kind(kind.items)
        nullable = f"std::optional<{inner}>" if kind.items.nullable else inner
        return None if inner is None else f"std::vector<{nullable}>"
    return None if kind.name == "object" else IN_CPP.get(kind.name, kind.name)


def _initial(member: Member) -> str:
    plain = member.required and not member.kind.nullable and member.kind.items is None
    return "{}" if plain and member.kind.name in IN_CPP and member.kind.name != "string" else ""
