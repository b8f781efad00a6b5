"""Connections to the page's server, which cannot block it: each has a limited time for its request,
their number is limited, and a connection whose answers are not read is closed."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

HEAD_S = 5.0  # that a request's head may take
MAX_CONNECTIONS = 128  # then the oldest connection without a request is closed
MAX_UNREAD = 4 << 20  # bytes that wait for a page to read them


class PageConnection(H11Protocol):
    """A connection by HTTP, until it becomes a WebSocket."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._head_timer = self.loop.call_later(HEAD_S, self._cut_without_head)
        if len(self.connections) > MAX_CONNECTIONS:
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        self._head_timer.cancel()
        super().connection_lost(exc)

    def _make_room(self) -> None:
        silent = [one for one in self._others() if not one.decided]
        oldest = min(silent, key=lambda one: one._head_timer.when(), default=self)
        oldest.transport.abort()
        self.connections.discard(oldest)

    def _cut_without_head(self) -> None:
        if not self.decided:
            self.transport.abort()

    def _others(self) -> "list[PageConnection]":
        return [one for one in self.connections if isinstance(one, PageConnection)]

    @property
    def decided(self) -> bool:
        """The request's head has come."""
        scope: Any = self.scope  # None until then
        return scope is not None


class PageSocket(WebSocketsSansIOProtocol):
    """A page's WebSocket."""

    def data_received(self, data: bytes) -> None:
        """Pings are answered at once, so a page that only pings and never reads is cut."""
        if self.transport.get_write_buffer_size() > MAX_UNREAD:
            self.transport.abort()
            return
        super().data_received(data)


def connection_classes() -> dict[str, Any]:
    """Return the classes of connections as arguments of uvicorn's Config."""
    return {"http": PageConnection, "ws": PageSocket}
