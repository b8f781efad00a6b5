"""An effect's table in a scene becomes its ``Parameters``: keys, types and ranges are checked
against the dataclass."""

import dataclasses
import functools
import types
import typing
from collections.abc import Mapping
from typing import Any

from eitskin.config import check_keys, nearest
from eitskin.errors import ConfigError, EitskinError
from eitskin.scene.effect import EffectModule


def parse_parameters(module: EffectModule, table: Mapping[str, Any], where: str) -> Any:
    """``module.Parameters`` filled from ``table``; ``where`` says file and table.

    Raises:
        ConfigError: a key is unknown, missing, of the wrong type or out of range, or keys
            contradict each other.
    """
    fields = {one.name: one for one in dataclasses.fields(module.Parameters)}
    check_keys(table, fields, where)
    declared: Any = module.Parameters
    hints = _hints(declared)
    values = {}
    for name, one in fields.items():
        if name in table:
            values[name] = _value(table[name], hints[name], one.metadata, f"{where}: {name}")
        elif one.default is dataclasses.MISSING and one.default_factory is dataclasses.MISSING:
            raise ConfigError(f"{where}: the key {name!r} is required")
    try:
        return module.Parameters(**values)
    except EitskinError as error:
        raise type(error)(f"{where}: {error}") from None


@functools.cache
def _hints(parameters: Any) -> dict[str, Any]:
    return typing.get_type_hints(parameters)


def _value(value: Any, hint: Any, metadata: Mapping[str, Any], what: str) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        inner = [one for one in arguments if one is not type(None)]
        return _value(value, inner[0], metadata, what)
    if origin is tuple:
        return _items(value, arguments, metadata, what)
    if hint is bool:
        if not isinstance(value, bool):
            raise ConfigError(f"{what} must be true or false, not {value!r}")
        return value
    if hint is str:
        return _word(value, metadata, what)
    if hint in (int, float):
        return _number(value, hint, metadata, what)
    raise ConfigError(
        f"{what}: the effect declares a type that scenes do not know ({hint}); repair the effect"
    )


def _items(
    value: Any, arguments: tuple[Any, ...], metadata: Mapping[str, Any], what: str
) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{what} must be a list, not {value!r}")
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        kinds = (arguments[0],) * len(value)
    elif len(value) != len(arguments):
        raise ConfigError(f"{what} must be a list of {len(arguments)}, not {value!r}")
    else:
        kinds = arguments
    pairs = zip(value, kinds, strict=True)
    return tuple(
        _value(one, kind, metadata, f"{what} entry {k} (from 0)")
        for k, (one, kind) in enumerate(pairs)
    )


def _word(value: Any, metadata: Mapping[str, Any], what: str) -> str:
    choices = metadata.get("choices")
    if not isinstance(value, str):
        raise ConfigError(f"{what} must be text in quotes, not {value!r}")
    if choices is not None and value not in choices:
        raise ConfigError(f"{what} = {value!r} is not known; {nearest(value, choices)}")
    return value


def _number(value: Any, kind: type, metadata: Mapping[str, Any], what: str) -> float | int:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(f"{what} must be a number, not {value!r}")
    if kind is int and value != value // 1:
        raise ConfigError(f"{what} = {value!r} must be a whole number")
    low, high = metadata.get("low", float("-inf")), metadata.get("high", float("inf"))
    open_low = bool(metadata.get("open_low", False))
    finite = float("-inf") < value < float("inf")
    if not (finite and low <= value <= high) or (open_low and value == low):
        bounds = [f"{'above' if open_low else 'at least'} {low:g}"] if low > float("-inf") else []
        bounds += [f"at most {high:g}"] if high < float("inf") else []
        unit = f" {metadata['unit']}" if metadata.get("unit") not in (None, "", "1") else ""
        raise ConfigError(
            f"{what} = {value!r} is out of range; it must be"
            f" {' and '.join(bounds) or 'finite'}{unit}"
        )
    return kind(value)  # type: ignore[no-any-return]


def describe_parameters(module: EffectModule) -> list[dict[str, Any]]:
    """Each parameter's name, type, default, range, unit and meaning, for ``eitskin scene effects
    NAME``."""
    declared: Any = module.Parameters
    hints = _hints(declared)
    rows = []
    for one in dataclasses.fields(module.Parameters):
        default = one.default
        if one.default_factory is not dataclasses.MISSING:
            default = one.default_factory()
        hint = hints[one.name]
        rows.append(
            {
                "name": one.name,
                "type": (
                    hint.__name__ if isinstance(hint, type) else str(hint).replace("typing.", "")
                ),
                "default": "required" if default is dataclasses.MISSING else default,
                **{
                    key: one.metadata[key]
                    for key in ("low", "high", "choices", "unit", "doc")
                    if key in one.metadata
                },
            }
        )
    return rows
