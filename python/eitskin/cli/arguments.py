"""Helpers with which commands declare their options, one line each; the help states the
defaults."""

import argparse
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from eitskin.config import plain_number, plain_whole
from eitskin.errors import UsageError


def above(low: float) -> float:
    """Return the lower end of a range that excludes ``low``."""
    return math.nextafter(low, math.inf)


RING_OHM = (above(0), 1e7)  # range of --resistor-ring
SCENE_HELP = "a scene file, or a scene of the library (eitskin scene list)"


PLAIN: dict[Any, Callable[[str], Any]] = {int: plain_whole, float: plain_number}
plain_number.__name__, plain_whole.__name__ = "float", "int"  # argparse names them in its errors


class Output(type(Path())):  # type: ignore[misc]  # of this system: PosixPath or WindowsPath
    """A file that a command writes; ``refuse_named_twice`` checks these."""


def refuse_named_twice(options: argparse.Namespace) -> None:
    """Raise a UsageError if another option names an output too, before it is overwritten."""
    named = list(_files_of(options))
    for name, path in named:
        for other, file in named:
            if name != other and isinstance(path, Output) and _same(path, file):
                raise UsageError(
                    f"{path}: named twice, as {name} and as {other}; name another file to write"
                )


def _files_of(options: argparse.Namespace) -> Iterator[tuple[str, Path]]:
    """Yield the names of options and the files that they name: a path, or the part after "sim:" and
    the like."""
    for name, value in vars(options).items():
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, Path):
                yield name, one
            elif isinstance(one, str) and ("." in one or "/" in one):
                yield name, Path(one)
                yield name, Path(one.partition(":")[2].partition("?")[0])


def _same(one: Path, other: Path) -> bool:
    try:
        if one.exists() and other.exists():
            return one.is_file() and one.samefile(other)
        return os.path.realpath(one) == os.path.realpath(other)
    except (OSError, ValueError):
        return False


def option(
    parser: Any,
    names: str,
    text: str | None = None,
    kind: Callable[[str], Any] | None = None,
    *,
    default: Any = None,
    within: tuple[float, float] | None = None,
    **more: Any,
) -> None:
    """Add an option. ``names`` holds its names and the placeholder of its value, such as "-o
    --output OUT".

    Without a placeholder, ``kind``, ``default`` and ``choices`` it is a flag. ``kind`` converts the
    text to the value; by default it is the type of the default value. A number must lie ``within``,
    ends included. The help states the default.
    """
    listed = names.split()
    metavar = listed.pop() if len(listed) > 1 and not listed[-1].startswith("-") else None
    if metavar is None and kind is None and default is None and not more:
        parser.add_argument(*listed, action="store_true", help=text)
        return
    if kind is None and isinstance(default, (int, float)):
        kind = type(default)
    kind = PLAIN.get(kind, kind) if kind is not None else None
    if within is not None:
        kind = _within(kind or plain_whole, listed[-1], *within)
    if metavar is not None:
        more["metavar"] = metavar
    if default is not None:
        shown = f"default: %(default){'g' if isinstance(default, float) else 's'}"
        text = f"{text} ({shown})" if text else shown
    parser.add_argument(*listed, type=kind, default=default, help=text, **more)


def _within(kind: Callable[[str], Any], name: str, low: float, high: float) -> Callable[..., Any]:
    """Return ``kind`` extended by a check of the range."""

    def read(text: str) -> Any:
        value = kind(text)
        if not low <= value <= high:
            shown = value if isinstance(value, int) else f"{value:g}"
            lowest = f"{'' if low == round(low, 12) else 'above '}{round(low, 12):.12g}"
            raise UsageError(f"{name} {shown} is out of range; use {lowest} to {high:.12g}")
        return value

    read.__name__ = getattr(kind, "__name__", "value")  # argparse names it if this is not a number
    return read
