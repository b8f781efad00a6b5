"""The table of constants: a header for each module of C, and the Python module."""

from collections.abc import Iterator
from typing import Any

from table import Lines, Table, Tables, origin, plain
from write_c import comment


def c_constants(tables: Tables) -> Iterator[tuple[str, Lines]]:
    """A header for each module."""
    modules = tables["constants"]["module"]
    known = {row[0]: row[1] for one in modules for group in one["group"] for row in group["rows"]}
    for module in modules:
        header = module.get("header", f"csrc/src/{module['name']}/constants.h")
        yield header, _header(module, known)


def _header(module: Table, known: dict[str, Any]) -> Lines:
    core = "header" not in module
    prefix = module.get("prefix", "EITS_")
    about = "The numbers of this module that are a choice, with their reasons."
    yield from comment(f"{about} {origin('constants')}")
    guard = f"EITSKIN_{module['name'].upper()}_CONSTANTS_H"
    yield from (f"#ifndef {guard}", f"#define {guard}", "")
    if core:
        yield from ('#include "base/vec.h"', "")
    yield "/* clang-format off */"
    for group in module["group"]:
        yield ""
        yield from comment(f"---- Chosen: {plain(group['chosen'])}. Check: {group['check']}")
        for name, value, unit, what, trades, *written_out in group["rows"]:
            yield ""
            yield from comment(f"{_said(what, unit)}. {trades}")
            if written_out:
                yield f"/* {name} = {value}, in the source as {written_out[0]} */"
            else:
                yield f"#define {prefix}{name} {_c_value(value, known, core)}"
    yield from ("", "/* clang-format on */", "", "#endif")


def _said(what: str, unit: str) -> str:
    return f"{what} [{unit}]" if unit else what


def _c_value(value: Any, known: dict[str, Any], core: bool) -> str:
    """Its bits are those of a double literal that is cast; a text is C as it stands, or names the
    row that has the value. Firmware has floats."""
    if isinstance(value, str) and value.startswith("= "):
        value = known[value.removeprefix("= ")]
    if isinstance(value, list):
        return f"R(sizeof(eits_real) == 4 ? {value[0]} : {value[1]})"
    if isinstance(value, float):
        return f"R({value!r})" if core else f"{value!r}f"
    return str(value)


def python_constants(tables: Tables) -> Lines:
    """Names and values that eitskin reads, those of float64 where there are two; the table says the
    rest."""
    for module in tables["constants"]["module"]:
        rows = [row for group in module["group"] for row in group["rows"]]
        rows = [row for row in rows if row[0] in module.get("package", ())]
        if not rows:
            continue
        yield from ("", f"# {module['name']}")
        for name, value, *_ in rows:
            yield f"{name} = {_number(value)!r}"


def _number(value: Any) -> float:
    """As Python has it."""
    if isinstance(value, list):
        return _number(value[1])
    if isinstance(value, str):
        return float.fromhex(value) if value.startswith("0x") else float(value.removesuffix("f"))
    return value  # type: ignore[no-any-return]
