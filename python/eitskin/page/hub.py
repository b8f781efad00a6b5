"""The open pages. A frame is sent to each page that has drawn its last one. Frames that a page
cannot take are dropped and counted; other pages do not wait for it. The newest frame of each skin
waits."""

import asyncio
import time
from collections import deque
from dataclasses import dataclass

from eitskin.page.facts import surface_text
from eitskin.surface.surface_map import SurfaceMap

IN_FLIGHT = 4  # frames of each skin that a page may have without having drawn them
TEXTS = 200  # messages that wait for a page; the oldest go first


@dataclass(frozen=True, eq=False)
class Outgoing:
    """A frame for the pages: its ``number``, its bytes, when it was complete (monotonic, ns), and
    the ``source`` that names its skin."""

    number: int
    data: bytes
    arrived_ns: int
    source: str | None = None


class PageClient:
    """One page: the messages that wait for it, and the frames that it has not drawn yet."""

    def __init__(self) -> None:
        self.may_command = self.presses = False
        self.sent = self.dropped = 0
        self.latencies_ms: deque[float] = deque(
            maxlen=100
        )  # from complete to drawn, as the page reports
        self._texts: deque[str] = deque(maxlen=TEXTS)
        self._surfaces: dict[str, str] = {}  # that wait, by source; none may be lost
        self.shown: dict[str, SurfaceMap | None] = {}
        """The surface of each skin that the page has, or will get."""
        self._frames: dict[str | None, Outgoing] = {}  # by source, in the order of their turns
        self._sources: set[str | None] = set()
        self._flying: dict[int, int] = {}
        self._changed = asyncio.Event()

    def offer(self, frame: Outgoing) -> None:
        """Offer the newest frame of a skin; it replaces one that was not sent yet."""
        self.dropped += frame.source in self._frames
        self._frames[frame.source] = frame
        self._sources.add(frame.source)
        self._changed.set()

    def tell(self, text: str) -> None:
        """A message that is no frame."""
        self._texts.append(text)
        self._changed.set()

    def show(self, source: str, surface: SurfaceMap | None) -> None:
        """The surface of a skin, if the page has another one; it comes before all else."""
        if self.shown.get(source) is not surface:
            self.shown[source] = surface
            self._surfaces[source] = surface_text(source, surface)
            self._changed.set()

    def drawn(self, number: int) -> None:
        """The page has drawn frame ``number``, and all that were sent before it."""
        arrived = self._flying.get(number)
        if arrived is None:
            return
        self.latencies_ms.append((time.monotonic_ns() - arrived) / 1e6)
        self._flying = {one: at for one, at in self._flying.items() if one > number}
        self._changed.set()

    async def next(self) -> str | bytes:
        """Wait for the next message to send, and return it."""
        while True:
            if self._surfaces:
                return self._surfaces.pop(next(iter(self._surfaces)))
            if self._texts:
                return self._texts.popleft()
            if self._frames and len(self._flying) < IN_FLIGHT * len(self._sources):
                frame = self._frames.pop(next(iter(self._frames)))
                self._flying[frame.number] = frame.arrived_ns
                self.sent += 1
                return frame.data
            self._changed.clear()
            await self._changed.wait()


class Hub:
    """All pages. Belongs to the server's loop; ``size`` may be looked at from anywhere."""

    def __init__(self) -> None:
        self.pages: set[PageClient] = set()

    @property
    def size(self) -> int:
        return len(self.pages)

    def offer(self, frame: Outgoing) -> None:
        for page in self.pages:
            page.offer(frame)

    def tell(self, text: str) -> None:
        for page in self.pages:
            page.tell(text)
