"""URLs' ``?speed=1&loop=1``: when simulated, emulated and recorded frames are given on."""

import math
import re
from dataclasses import dataclass

from eitskin.config import plain_number
from eitskin.errors import UsageError

TIMED = ("sim", "emu", "file")  # schemes whose URLs may name a speed
MIN_SPEED, MAX_SPEED = 1e-3, 1000.0


@dataclass(frozen=True)
class Timing:
    """The timing of frames: with ``speed`` 1 they come as they were scanned, with 0 as fast as they
    can be made; None: not given. With ``loop`` they begin again at the end."""

    speed: float | None = None
    loop: bool = False


def split_name(url: str) -> tuple[str, str | None]:
    """A device's URL without ``name=NAME`` after '?', and that name; None if it has none.

    Raises:
        UsageError: the name cannot be used.
    """
    bare, mark, query = url.rpartition("?")
    pairs = query.split("&") if mark else []
    names = [pair.removeprefix("name=") for pair in pairs if pair.startswith("name=")]
    if not names:
        return url, None
    if len(names) > 1:
        raise UsageError(f"device {url!r}: has two names; leave one out")
    rest = "&".join(pair for pair in pairs if not pair.startswith("name="))
    return bare + ("?" + rest if rest else ""), check_name(names[0], f"device {url!r}")


def is_name(text: str) -> bool:
    """Return whether ``text`` can name a board, skin or source."""
    return re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}", text) is not None


def check_name(name: str, where: str) -> str:
    """``name`` of a board, skin or source, which becomes a part of topics and addresses.

    Raises:
        UsageError: it has other characters, or too many.
    """
    if not is_name(name):
        raise UsageError(
            f"{where}: name {name!r} cannot be used; use 1 to 32 letters, digits, - and _, as in"
            " left-arm"
        )
    return name


def split_timing(url: str) -> tuple[str, Timing]:
    """Return a device's URL without its query, and the settings of the query. In URLs of other
    schemes than sim, emu and file only a name is taken out."""
    url = split_name(url)[0]
    scheme, _, _ = url.partition(":")
    bare, mark, query = url.rpartition("?")
    if scheme not in TIMED or not mark:
        return url, Timing()
    named: dict[str, str] = {}
    for pair in query.split("&"):
        key, _, value = pair.partition("=")
        if key not in ("speed", "loop") or key in named:
            raise UsageError(f"device {url!r}: {pair!r} after '?'; use speed=1, loop=1, or both")
        named[key] = value
    if named.get("loop", "0") not in ("0", "1"):
        raise UsageError(f"device {url!r}: loop must be 0 or 1, not {named['loop']!r}")
    speed = None if "speed" not in named else read_speed(named["speed"], f"device {url!r}")
    return bare, Timing(speed, named.get("loop") == "1")


def read_speed(text: str, where: str) -> float:
    """The speed in "2", "0.5" or "max" (0)."""
    try:
        speed = 0.0 if text == "max" else plain_number(text)
    except ValueError:
        speed = math.nan
    return check_speed(speed, where, text)


def check_speed(speed: float, where: str, text: str | None = None) -> float:
    """``speed``, if it is 0 or within the range.

    Raises:
        UsageError: it is not; ``text`` is it as it was given.
    """
    if speed != 0 and not MIN_SPEED <= speed <= MAX_SPEED:
        shown = f"{speed:g}" if text is None else repr(text)
        raise UsageError(
            f"{where}: speed must be {MIN_SPEED:g} to {MAX_SPEED:g}, or 0 or max for as fast as it"
            f" can, not {shown}"
        )
    return speed
