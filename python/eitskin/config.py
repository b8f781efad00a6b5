"""Read TOML tables into dataclasses, strictly: an unknown key is an error that names the nearest
known one. Errors are ConfigErrors with the file, the table and the key."""

import difflib
import re
import sys
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, field, fields
from pathlib import Path
from typing import Any

from eitskin.errors import ConfigError, EitskinError
from eitskin.fileio import read_bytes

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MAX_LISTED = 30

MAX_TOML_BYTES = 1_000_000
MAX_KEY_PARTS = 32  # the parser's time grows with the square of the number of parts
# A part must start at the start of a word; otherwise the search would take more than linear time.
_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
DEEP_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{MAX_KEY_PARTS}}}")


def load_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Parse the TOML file ``path``; ``what`` names its kind in errors.

    Raises:
        FileError: it cannot be read.
        ConfigError: it is not UTF-8, not TOML, or has keys of too many parts.
    """
    content = read_bytes(path, what, MAX_TOML_BYTES)
    try:
        return parse_toml(content.decode("utf-8"), what, str(path))
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not UTF-8 text, so not a {what}") from None


def parse_toml(text: str, what: str, where: str) -> dict[str, Any]:
    """Return the table in the TOML ``text``.

    ``what`` names the kind of text in errors, and ``where`` its source.

    Raises:
        ConfigError: the text is not TOML, is nested too deeply, or has keys of too many parts.
    """
    try:
        if DEEP_KEY.search(text):
            raise ConfigError(f"{where}: not a {what}: a key of over {MAX_KEY_PARTS} parts")
        return tomllib.loads(text)
    except ValueError as error:  # raised also for whole numbers with thousands of digits
        raise ConfigError(f"{where}: not valid TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{where}: not a {what}: nested too deeply") from None


def plain_number(text: str) -> float:
    """The number in ``text`` as people write it: not Python's 1_0, and not the digits of other
    scripts. Raises a ValueError."""
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def plain_whole(text: str) -> int:
    """As ``plain_number``, a whole number."""
    plain_number(text)
    return int(text)


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a remedy for the unknown ``name``: the nearest of ``known``, or all of them if none is
    near."""
    choices = sorted(known)
    close = difflib.get_close_matches(name, choices, n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"known are: {listed(choices)}"


def listed(items: Sequence[object]) -> str:
    """Return "a, b, c", or for a long list its beginning and how many more there are."""
    shown = ", ".join(map(str, items[:MAX_LISTED]))
    return shown if len(items) <= MAX_LISTED else f"{shown} and {len(items) - MAX_LISTED} more"


def first_few(items: Sequence[object], most: int) -> str:
    """Return "a, b, c", or "a, b, c, ..." if there are more than ``most``."""
    return ", ".join(map(str, items[:most])) + (", ..." if len(items) > most else "")


def check_keys(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    """Raise a ConfigError if ``table`` has keys that are not ``known``; ``where`` names file and
    table."""
    allowed = set(known)
    for key in table:
        if key not in allowed:
            raise ConfigError(f"{where}: unknown key {key!r}; {nearest(key, allowed)}")


def number(
    table: Mapping[str, Any],
    key: str,
    default: float | None,
    where: str,
    *,
    low: float = float("-inf"),
    high: float = float("inf"),
    open_low: bool = False,
    unit: str = "",
) -> float:
    """Return the number at ``key``, or ``default`` (None: the key is required).

    It must be in [low, high], or in (low, high] with ``open_low``. Errors state this range with
    ``unit``, which is mm where the key says so.

    Raises:
        ConfigError: it is missing, not a number, or out of range.
    """
    value = table.get(key, default)
    if value is None:
        raise ConfigError(f"{where}: the key {key!r} is required")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ConfigError(f"{where}: {key} must be a number, not {value!r}")
    finite = float("-inf") < value < float("inf")
    if not (finite and low <= value <= high) or (open_low and value == low):
        bounds = [f"{'above' if open_low else 'at least'} {low:g}"] if low > float("-inf") else []
        bounds += [f"at most {high:g}"] if high < float("inf") else []
        allowed = " and ".join(bounds) or "finite"
        unit = unit or ("mm" if key.endswith("_mm") else "")
        allowed += f" {unit}" if unit not in ("", "1") else ""
        raise ConfigError(f"{where}: {key} = {value!r} is out of range; it must be {allowed}")
    try:
        return float(value)
    except OverflowError:
        raise ConfigError(
            f"{where}: {key} has {len(str(value))} digits, too many for a float"
        ) from None


def integer(
    table: Mapping[str, Any], key: str, default: int | None, where: str, *, low: int, high: int
) -> int:
    """Return the whole number at ``key``, or ``default`` (None: the key is required), within [low,
    high]."""
    value = number(table, key, default, where, low=low, high=high)
    if value != int(value):
        raise ConfigError(f"{where}: {key} = {value!r} must be a whole number")
    return int(value)


def flag(table: Mapping[str, Any], key: str, default: bool | None, where: str) -> bool:
    """Return the truth value at ``key``, or ``default`` (None: the key is required)."""
    value = table.get(key, default)
    if not isinstance(value, bool):
        raise ConfigError(f"{where}: {key} must be true or false, not {value!r}")
    return value


def word(table: Mapping[str, Any], key: str, default: str | None, where: str) -> str:
    """Return the text at ``key``, or ``default`` (None: the key is required)."""
    value = table.get(key, default)
    if not isinstance(value, str):
        raise ConfigError(f"{where}: {key} must be text in quotes, not {value!r}")
    return value


def subtable(table: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    """Return the table at ``key``, or an empty one."""
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise ConfigError(f"{where}: {key} must be a table: write [{key}]")
    return value


def choice(
    table: Mapping[str, Any], key: str, default: str | None, known: Iterable[str], where: str
) -> str:
    """Return the word at ``key``, or ``default`` (None: the key is required); it must be one of
    ``known``."""
    options = list(known)
    value = table.get(key, default)
    if value is None:
        raise ConfigError(f"{where}: the key {key!r} is required; one of {', '.join(options)}")
    if not isinstance(value, str) or value not in options:
        raise ConfigError(
            f"{where}: {key} = {value!r} is not known; {nearest(str(value), options)}"
        )
    return value


def parameter(
    default: Any,
    unit: str = "1",
    doc: str = "",
    *,
    low: float | None = None,
    high: float | None = None,
    open_low: bool = False,
    choices: tuple[str, ...] = (),
) -> Any:
    """Return a dataclass field for ``from_table`` with its default, its unit, a description, and
    its range [low, high], or (low, high] with ``open_low``."""
    limits = {"low": low, "high": high, "open_low": open_low or None, "choices": choices or None}
    given = {name: limit for name, limit in limits.items() if limit is not None}
    return field(default=default, metadata={"unit": unit, "doc": doc, **given})


def from_table(kind: Any, table: Mapping[str, Any], where: str) -> Any:
    """Return the dataclass ``kind`` with the values in ``table``; ``where`` names file and table.

    Its fields are float, int, bool, str, tuples of these, or one of them ``| None``, within the
    limits that ``parameter`` sets.

    Raises:
        ConfigError: a key is unknown, missing, of the wrong type or out of range.
        EitskinError: ``kind`` itself refuses the values; ``where`` is put before its text.
    """
    known = {one.name: one for one in fields(kind)}
    check_keys(table, known, where)
    hints = typing.get_type_hints(kind)
    values = {}
    for name, one in known.items():
        if name in table:
            values[name] = _value(table[name], hints[name], one.metadata, name, where)
        elif one.default is MISSING and one.default_factory is MISSING:
            raise ConfigError(f"{where}: the key {name!r} is required")
    try:
        return kind(**values)
    except EitskinError as error:
        raise type(error)(f"{where}: {error}") from None


def _value(value: Any, hint: Any, limits: Mapping[str, Any], key: str, where: str) -> Any:
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        other = next(one for one in inner if one is not type(None))
        return _value(value, other, limits, key, where)
    if origin is tuple:
        return _items(value, inner, limits, key, where)
    table = {key: value}
    if hint is bool:
        return flag(table, key, None, where)
    if hint is str:
        found = word(table, key, None, where)
        return choice(table, key, None, limits["choices"], where) if "choices" in limits else found
    if hint not in (int, float):
        raise ConfigError(f"{where}: {key} is declared as {hint}, which tables cannot hold")
    given = {name: limits[name] for name in ("low", "high", "open_low", "unit") if name in limits}
    number(table, key, None, where, **given)
    if hint is int and value != value // 1:
        raise ConfigError(f"{where}: {key} = {value!r} must be a whole number")
    return hint(value)


def _items(
    value: Any, kinds: tuple[Any, ...], limits: Mapping[str, Any], key: str, where: str
) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{where}: {key} must be a list, not {value!r}")
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        kinds = (kinds[0],) * len(value)
    elif len(value) != len(kinds):
        raise ConfigError(f"{where}: {key} must be a list of {len(kinds)}, not {value!r}")
    return tuple(
        _value(one, kind, limits, f"{key} entry {k} (from 0)", where)
        for k, (one, kind) in enumerate(zip(value, kinds, strict=True))
    )
