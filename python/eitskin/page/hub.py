"""The pages that are open. A frame goes to each page that has drawn what it got; what a page cannot
take is dropped and counted, and nobody waits for it."""

import asyncio
import time
from collections import deque
from dataclasses import dataclass

IN_FLIGHT = 4  # frames that a page may have without having drawn them
TEXTS = 200  # messages that wait for a page; the oldest go first


@dataclass(frozen=True, eq=False)
class Outgoing:
    """A frame for the pages: its ``number``, its bytes, when it was complete (monotonic, ns)."""

    number: int
    data: bytes
    arrived_ns: int


class PageClient:
    """One page: what waits for it, and what it has not drawn yet."""

    def __init__(self) -> None:
        self.may_command = False
        self.sent = self.dropped = 0
        self.latencies_ms: deque[float] = deque(
            maxlen=100
        )  # from complete to drawn, as the page reports
        self._texts: deque[str] = deque(maxlen=TEXTS)
        self._frame: Outgoing | None = None
        self._flying: dict[int, int] = {}
        self._changed = asyncio.Event()

    def offer(self, frame: Outgoing) -> None:
        """The newest frame; one that was not sent yet is dropped for it."""
        self.dropped += self._frame is not None
        self._frame = frame
        self._changed.set()

    def tell(self, text: str) -> None:
        """A message that is no frame."""
        self._texts.append(text)
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
            if self._texts:
                return self._texts.popleft()
            frame = self._frame
            if frame is not None and len(self._flying) < IN_FLIGHT:
                self._frame = None
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
