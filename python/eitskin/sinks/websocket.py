"""``ws://HOST:PORT``: start a WebSocket server that any number of clients connect to; each receives
every message as a JSON text.

Programs and pages of this machine may connect; a page that another host served may not.
"""

import asyncio
import contextlib
import re
import threading
from collections.abc import Coroutine
from concurrent import futures
from typing import Any

from eitskin.errors import SinkError, missing_extra
from eitskin.sinks.sink import Dropped, OutgoingMessage, Sink, TouchSource, address, nothing_more

USAGE = "ws://127.0.0.1:PORT, where clients connect"
FULL_BYTES = 1 << 20  # unsent bytes of a client, above which it gets no messages until it has read
LOCAL = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")


class WebSocketSink:
    """A WebSocket server. Clients that do not read are left out.

    Raises:
        SinkError: the port is taken, or the host is not this machine.
        MissingExtraError: websockets is not installed.
    """

    def __init__(self, url: str, host: str, port: int) -> None:
        self._url, self._clients = url, set[Any]()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name=f"eitskin {url} server", daemon=True
        )
        self._thread.start()
        try:
            self._server = self._call(self._serve(host, port))
        except OSError as error:
            self._stop()
            raise SinkError(
                f"--to {url}: cannot listen there ({error.strerror or error}); name another port,"
                " or end the program that has it"
            ) from None
        except BaseException:
            self._stop()
            raise

    def write(self, outgoing: OutgoingMessage) -> None:
        if not self._call(self._send(outgoing.text)):
            raise Dropped

    def close(self) -> None:
        async def end() -> None:
            self._server.close()
            await self._server.wait_closed()

        with contextlib.suppress(futures.TimeoutError):
            self._call(end())
        self._stop()

    @property
    def port(self) -> int:
        number: int = next(iter(self._server.sockets)).getsockname()[1]
        return number

    def _call(self, what: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(what, self._loop).result(5.0)

    def _stop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(1.0)

    async def _serve(self, host: str, port: int) -> Any:
        try:
            from websockets.asyncio.server import ServerConnection, serve
        except ImportError:
            raise missing_extra("ws", "websockets") from None

        class Client(ServerConnection):
            def data_received(self, data: bytes) -> None:
                """Pings are answered at once, so a client that sends only pings and never reads is
                disconnected."""
                if self.transport.get_write_buffer_size() > 2 * FULL_BYTES:
                    self.transport.abort()
                else:
                    super().data_received(data)

        return await serve(
            self._client, host, port, origins=[None, LOCAL], max_size=1 << 16, close_timeout=1,
            create_connection=Client,
        )  # fmt: skip

    async def _client(self, client: Any) -> None:
        self._clients.add(client)
        try:
            async for _ in client:
                pass  # messages of clients are ignored
        except Exception:  # it closed without a close message
            pass
        finally:
            self._clients.discard(client)

    async def _send(self, text: str) -> bool:
        """Send ``text`` to all clients that read; return False if a client was left out."""
        from websockets.asyncio.server import broadcast

        reading = [
            one
            for one in self._clients
            if one.transport is not None and one.transport.get_write_buffer_size() < FULL_BYTES
        ]
        left_out = len(self._clients) - len(reading)
        broadcast(reading, text)
        return left_out == 0


def open_sink(url: str, source: TouchSource) -> Sink:
    parts, host, port = address(url, None, usage=USAGE, lowest=0)
    nothing_more(url, parts, USAGE)
    return WebSocketSink(url, host, port)
