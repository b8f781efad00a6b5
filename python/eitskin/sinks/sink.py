"""What a sink is, what it is given, and how its address is read."""

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol
from urllib.parse import SplitResult, parse_qs, urlsplit

from eitskin.errors import UsageError
from eitskin.model.model import Model
from eitskin.session.frame import DriveReport, Frame, Message, Notice
from eitskin.session.message import encoded

Box = tuple[float, float, float, float]
THIS_MACHINE = "127.0.0.1"


class Dropped(Exception):
    """A sink could not take this one for now, such as while its broker is away. It is counted
    without a line for the user."""


@dataclass(frozen=True, eq=False)
class TouchSource:
    """Whose touches they are: the device's URL, its board, and its model where the host has it.
    ``overwrite``: files that exist may be written over."""

    url: str
    board: str = ""
    model: Model | None = None
    overwrite: bool = False

    @property
    def box_mm(self) -> Box | None:
        """The skin's bounding box (x0, y0, x1, y1); None where the model is not known."""
        return None if self.model is None else self.model.skin.outline.bounding_box_mm


class OutgoingMessage:
    """A frame, touches after a drive, a notice, or the ``summary`` message that ends it all, on its
    way to sinks. What they share is made once, by the first that asks for it."""

    def __init__(self, item: Message | dict[str, Any]) -> None:
        self.frame = item if isinstance(item, Frame) else None
        self.report = item if isinstance(item, DriveReport) else None
        self.notice = item if isinstance(item, Notice) else None
        self._item = item

    @cached_property
    def message(self) -> dict[str, Any]:
        """As docs/reference/message.md."""
        return self._item if isinstance(self._item, dict) else self._item.message()

    @cached_property
    def time_ns(self) -> int:
        """The message's time, UTC where that is known."""
        unix_s = self.message["time_unix_s"]
        return round(1e9 * ((self.message["time_s"] if unix_s is None else unix_s) or 0.0))

    @cached_property
    def text(self) -> str:
        """The message as a line of JSON."""
        return encoded(self.message)


class Sink(Protocol):
    """An open way out. All but opening it happens in one thread of its own.

    A module of a sink has ``open_sink(url, source)``, which its entry point names. It raises an
    EitskinError of one line where the sink cannot be opened.
    """

    def write(self, outgoing: OutgoingMessage) -> None:
        """Send it; may take its time. Raises Dropped, or whatever went wrong, which is counted."""

    def close(self) -> None:
        """Finish files, let go of ports."""


def without_password(url: str) -> str:
    """``url`` as it may be shown."""
    return re.sub(r"(?<=//)([^/@:]*):[^/@]*@", r"\1:...@", url)


def address(
    url: str, port: int | None, *, usage: str, lowest: int = 1
) -> tuple[SplitResult, str, int]:
    """The parts of ``url``, its host (this machine where none is named) and port; a server may have
    0 as its ``lowest``, which is any."""
    shown = without_password(url)
    try:
        parts = urlsplit(url)
        named = parts.port
    except ValueError:
        raise UsageError(f"--to {shown}: no address; write  {usage}") from None
    chosen = port if named is None else named
    if not url.startswith(f"{parts.scheme}://") or chosen is None or not lowest <= chosen <= 65535:
        raise UsageError(f"--to {shown}: write  {usage}")
    return parts, parts.hostname or THIS_MACHINE, chosen


def setting(url: str, query: str, name: str, low: int, high: int, usual: int) -> int:
    """The whole number ``name=N`` of a query; ``usual`` where it is empty."""
    try:
        values = parse_qs(query, strict_parsing=True, keep_blank_values=True) if query else {}
        number = int(values.pop(name, [str(usual)])[-1])
        if values or not low <= number <= high:
            raise ValueError
    except ValueError:
        raise UsageError(
            f"--to {url}: what follows '?' must be {name}=N, N from {low} to {high}"
        ) from None
    return number


def nothing_more(url: str, parts: SplitResult, usage: str, *, path: bool = False) -> None:
    """Refuse what stands after the port."""
    if parts.query or parts.fragment or (parts.path not in ("", "/") and not path):
        raise UsageError(
            f"--to {without_password(url)}: nothing may follow the port; write  {usage}"
        )


def or_nan(value: float | None) -> float:
    """NaN for what is not known."""
    return math.nan if value is None else value
