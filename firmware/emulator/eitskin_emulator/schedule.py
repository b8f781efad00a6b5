"""A schedule: events in the board's time, each at one time or none."""

import heapq
from collections.abc import Callable

NEVER = 1 << 62


class Event:
    """An action that takes place at a time: it is called with that time, in ticks."""

    __slots__ = ("action", "at", "ticket")

    def __init__(self, action: Callable[[int], None]) -> None:
        self.action = action
        self.at = NEVER
        self.ticket = 0


class Schedule:
    """Events in order of time, and at equal times in the order in which they were set. ``earlier``
    is called whenever an earlier event is added."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Event]] = []
        self._tickets = 0
        self.earlier: Callable[[int], None] = lambda at: None

    def set(self, event: Event, at: int | None) -> None:
        """Let ``event`` happen at ``at`` and not before; None: not at all."""
        if at is None:
            event.at = NEVER
            return
        if event.at == at:
            return
        self._tickets += 1
        event.at, event.ticket = at, self._tickets
        heapq.heappush(self._heap, (at, self._tickets, event))
        self.earlier(at)

    def next_at(self) -> int:
        """When the next event is due; NEVER if none is."""
        heap = self._heap
        while heap:
            at, ticket, event = heap[0]
            if event.at == at and event.ticket == ticket:
                return at
            heapq.heappop(heap)
        return NEVER

    def run_due(self, now: int) -> None:
        """Run the events that are due at ``now`` or before; each is called with its own time."""
        while self.next_at() <= now:
            at, _, event = heapq.heappop(self._heap)
            event.at = NEVER
            event.action(at)

    def clear(self) -> None:
        """Forget all events."""
        for _, _, event in self._heap:
            event.at = NEVER
        self._heap.clear()
