"""Define what a sink is, what it is given, and how its address is read."""

import math
import re
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar
from urllib.parse import SplitResult, parse_qs, urlsplit

from eitskin.config import plain_whole
from eitskin.errors import UsageError
from eitskin.model.model import Model
from eitskin.session.frame import DriveReport, Frame, Message, Notice
from eitskin.session.message import encoded

Box = tuple[float, float, float, float]
THIS_MACHINE = "127.0.0.1"


class Dropped(Exception):
    """A sink cannot take an item for now, for example while its broker is away. The item is
    counted, and no error is reported."""


@dataclass(frozen=True, eq=False)
class TouchSource:
    """The origin of touches: the device's URL, its board, and its model if the host has it.
    ``overwrite`` allows overwriting existing files. ``name`` is the source's name as given, None if
    none was, and ``source`` the one in messages, which is then the board's serial number. ``tare``
    takes the reference again, from any thread; None if there is no board. ``link`` is the frame of
    reference that messages give places in, if there is one. ``skins`` are the sources of a robot,
    which has neither board nor model itself; empty: it is no robot."""

    url: str
    board: str = ""
    model: Model | None = None
    overwrite: bool = False
    name: str | None = None
    source: str | None = None
    tare: Callable[[], "Future[None]"] | None = None
    link: str | None = None
    skins: "tuple[TouchSource, ...]" = ()

    @property
    def each(self) -> "dict[str | None, TouchSource]":
        """The skins by the source in their messages; of one device itself alone."""
        return {one.source: one for one in self.skins or (self,)}

    @property
    def box_mm(self) -> Box | None:
        """The skin's bounding box (x0, y0, x1, y1), or None if the model is not known or does not
        describe its skin."""
        skin = None if self.model is None else self.model.known_skin
        return None if skin is None else skin.outline.bounding_box_mm


class OutgoingMessage:
    """An item on its way to sinks: a frame, touches after a drive, a notice, or the final
    ``summary`` message. The message and its text are made once, when a sink first asks for them."""

    def __init__(self, item: Message | dict[str, Any]) -> None:
        self.frame = item if isinstance(item, Frame) else None
        self.report = item if isinstance(item, DriveReport) else None
        self.notice = item if isinstance(item, Notice) else None
        self._item = item

    @cached_property
    def message(self) -> dict[str, Any]:
        """The message of docs/reference/message.md."""
        return self._item if isinstance(self._item, dict) else self._item.message()

    @cached_property
    def time_ns(self) -> int:
        """The message's time, in UTC if that is known."""
        unix_s = self.message["time_unix_s"]
        return round(1e9 * ((self.message["time_s"] if unix_s is None else unix_s) or 0.0))

    @cached_property
    def text(self) -> str:
        """The message as a line of JSON."""
        return encoded(self.message)


T = TypeVar("T")


class OfSkin(Generic[T]):
    """One thing that a sink keeps for each skin: ``make`` makes it of a source, ``of`` finds it."""

    def __init__(self, source: TouchSource, make: Callable[[TouchSource], T]) -> None:
        self.kept = {name: make(one) for name, one in source.each.items()}
        self._only = next(iter(self.kept.values())) if len(self.kept) == 1 else None

    def of(self, message: dict[str, Any]) -> T | None:
        """Return what is kept for the skin of ``message``; None for a robot's summary."""
        return self._only or self.kept.get(message.get("source"))


class Sink(Protocol):
    """An open output. All calls except opening it are made in a thread of its own.

    The module of a sink has a function ``open_sink(url, source)``, which its entry point names. It
    raises an EitskinError of one line if the sink cannot be opened.
    """

    def write(self, outgoing: OutgoingMessage) -> None:
        """Send an item; this may take time. Raises Dropped, or any other error, which is
        counted."""

    def close(self) -> None:
        """Finish files and release ports."""


def without_password(url: str) -> str:
    """Return ``url`` with its password hidden."""
    return re.sub(r"(?<=//)([^/@:]*):[^/@]*@", r"\1:...@", url)


def address(
    url: str, port: int | None, *, usage: str, lowest: int = 1
) -> tuple[SplitResult, str, int]:
    """Return the parts of ``url``, its host (this machine if none is named) and its port.

    ``port`` is the default. A server passes 0 as ``lowest``, and port 0 then means any free port.

    Raises:
        UsageError: the URL is not an address.
    """
    shown = without_password(url)
    try:
        parts = urlsplit(url)
        named = parts.port
    except ValueError:
        raise UsageError(f"--to {shown}: not an address; write  {usage}") from None
    chosen = port if named is None else named
    if not url.startswith(f"{parts.scheme}://") or chosen is None or not lowest <= chosen <= 65535:
        raise UsageError(f"--to {shown}: write  {usage}")
    return parts, parts.hostname or THIS_MACHINE, chosen


def setting(url: str, query: str, name: str, low: int, high: int, default: int) -> int:
    """Return the whole number in the query ``name=N``, or ``default`` if the query is empty.

    Raises:
        UsageError: the query is not ``name=N`` with N from ``low`` to ``high``.
    """
    try:
        values = parse_qs(query, strict_parsing=True, keep_blank_values=True) if query else {}
        number = plain_whole(values.pop(name, [str(default)])[-1])
        if values or not low <= number <= high:
            raise ValueError
    except ValueError:
        raise UsageError(
            f"--to {url}: what follows '?' must be {name}=N, N from {low} to {high}"
        ) from None
    return number


def nothing_more(url: str, parts: SplitResult, usage: str, *, path: bool = False) -> None:
    """Raise a UsageError if anything follows the port, except a path if ``path`` is set."""
    if parts.query or parts.fragment or (parts.path not in ("", "/") and not path):
        raise UsageError(
            f"--to {without_password(url)}: nothing may follow the port; write  {usage}"
        )


def or_nan(value: float | None) -> float:
    """Return ``value``, or NaN if it is None."""
    return math.nan if value is None else value
