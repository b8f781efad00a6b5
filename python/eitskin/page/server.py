"""The page's server: its three files, one WebSocket, and a model's upload. Nothing of it waits for
a page, and nothing of the board waits for it."""

from __future__ import annotations

import asyncio
import errno
import hmac
import ipaddress
import json
import re
import socket
import threading
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from eitskin.errors import EitskinError, UsageError, missing_extra
from eitskin.page.commands import PageCommands
from eitskin.page.facts import frame_bytes, setup_text, surface_of, text_of
from eitskin.page.hub import Hub, Outgoing, PageClient
from eitskin.page.reader import AttachOutputs, SessionReader
from eitskin.page.teacher import Teacher
from eitskin.session.frame import Frame
from eitskin.session.settings import SessionSettings

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket

FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/drawing.js": ("drawing.js", "text/javascript; charset=utf-8"),
    "/plots.js": ("plots.js", "text/javascript; charset=utf-8"),
    "/surface.js": ("surface.js", "text/javascript; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
}
MIN_TOKEN = 12
MAX_MODEL_BYTES = 8 << 20
HELLO_S = 10.0
MAX_WAITING = 16  # commands of a page that are not answered yet
ABOUT_S = 1.0  # between two messages of how a page keeps up
NO_TOKEN, NO_ORIGIN = 4401, 4403  # codes that close a WebSocket


def load_server() -> tuple[Any, Any]:
    """starlette and uvicorn."""
    try:
        import starlette
        import uvicorn
        import websockets  # noqa: F401 -- what uvicorn speaks WebSocket with
    except ImportError:
        raise missing_extra("view", "starlette, uvicorn and websockets") from None
    return starlette, uvicorn


def listen(host: str, port: int) -> socket.socket:
    """A socket on ``host`` and ``port``, 0 for any that is free."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family)
    except OSError as error:
        taken = error.errno == errno.EADDRINUSE
        why = "another program has it, perhaps a second view" if taken else error.strerror
        raise UsageError(
            f"cannot listen on {host} port {port} ({why}); name another with  --port, --port 0  for"
            " any that is free"
        ) from None


class PageServer:
    """Serves one device's page on ``listening`` until ``stop``. Commands need the
    ``token``; where ``remote``, everything does. ``say`` gets lines for whoever started it.
    """

    def __init__(
        self,
        url: str,
        settings: SessionSettings,
        listening: socket.socket,
        *,
        token: str,
        host: str,
        remote: bool = False,
        speed: float = 1.0,
        folder: Path = Path(),
        say: Callable[[str], None] = lambda text: None,
        outputs: AttachOutputs | None = None,
        teacher: Teacher | None = None,
    ) -> None:
        _, self._uvicorn = load_server()
        self._listening, self._token, self._remote = listening, token, remote
        self.host, self.port = host, int(listening.getsockname()[1])
        self._say = say
        self.hub, self._loop = Hub(), asyncio.new_event_loop()
        self._waiting: dict[str | None, Frame] = {}  # by source
        self._newest: dict[str | None, Frame] = {}  # for pages that come later
        self._frames, self._taking = 0, threading.Lock()
        self.skipped = 0  # frames that came while the one before was not taken up yet
        self.reader = SessionReader(
            url,
            settings,
            speed=speed,
            folder=folder,
            on_frame=self._frame,
            on_news=self._news,
            outputs=outputs,
            teacher=teacher,
        )
        self.commands = PageCommands(self.reader)

    @property
    def address(self) -> str:
        """The address to open, without the token."""
        name = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{name}:{self.port}/"

    def serve(self) -> None:
        """Until Ctrl-C or ``stop``."""
        from eitskin.page.connections import connection_classes

        config = self._uvicorn.Config(
            self._app(),
            log_level="warning",
            lifespan="off",
            **connection_classes(),
            ws_per_message_deflate=False,
            ws_max_size=1 << 16,
            server_header=False,
            date_header=False,
            access_log=False,
            timeout_graceful_shutdown=0.2,  # pages get a last message, and are gone
        )
        self._server = self._uvicorn.Server(config)
        self.reader.start()
        try:
            self._loop.run_until_complete(self._server.serve(sockets=[self._listening]))
        finally:
            self.reader.stop()
            self._loop.run_until_complete(self._loop.shutdown_asyncgens())
            self._loop.close()
        if self.reader.frames == 0 and self.reader.error is not None:
            raise self.reader.error

    def stop(self) -> None:
        """End ``serve``; from any thread."""
        self._call(lambda: setattr(self._server, "should_exit", True))

    # ---- from the board's thread ----

    def _call(self, action: Callable[[], None]) -> None:
        with suppress(RuntimeError):  # the loop is closed: nobody looks on any more
            self._loop.call_soon_threadsafe(action)

    def _frame(self, frame: Frame) -> None:
        with self._taking:
            self.skipped += frame.source in self._waiting
            first = not self._waiting
            self._waiting[frame.source] = frame
        if first:
            self._call(self._send_frames)

    def _news(self, kind: str, facts: dict[str, Any]) -> None:
        failed = kind == "state" and facts["state"] == "failed"
        at_once = failed and self.reader.frames == 0
        if at_once:
            self.stop()  # ``serve`` raises the error
        if kind == "state" and facts["state"] == "live":
            self._call(self._send_setup)
        text = text_of(kind, **facts)
        self._call(self._send_setup if kind == "setup" else lambda: self.hub.tell(text))
        if kind == "notice":
            self._say(str(facts["text"]))
        elif not at_once and (failed or (kind == "state" and facts["text"])):
            self._say(f"{facts['state']}: {facts['text']}")

    # ---- in the loop ----

    def _send_frames(self) -> None:
        with self._taking:
            waiting, self._waiting = self._waiting, {}
        fresh = not waiting.keys() <= self._newest.keys()
        self._newest |= waiting
        for frame in waiting.values():
            self._frames += 1
            if self.hub.size:
                self.hub.offer(self._outgoing(frame, frame.arrived_ns))
        if fresh:
            self._send_setup()  # the reference is known now

    def _outgoing(self, frame: Frame, arrived_ns: int) -> Outgoing:
        data = frame_bytes(self._frames, frame)
        return Outgoing(self._frames, data, arrived_ns, frame.source)

    def _send_setup(self) -> None:
        for page in self.hub.pages:
            self._tell_setup(page)

    def _tell_setup(self, page: PageClient) -> None:
        session = self.reader.session or self.reader.last
        if session is not None:
            for name, part in session.parts.items():
                page.show(name, surface_of(part))
            page.tell(setup_text(session, page.may_command, self.reader.length_s))

    def _app(self) -> Starlette:
        from starlette.applications import Starlette
        from starlette.routing import Route, WebSocketRoute

        routes: list[Any] = [Route(path, self._file, methods=["GET"]) for path in FILES]
        routes.append(Route("/model", self._model, methods=["POST"]))
        routes.append(Route("/recording", self._recording, methods=["GET"]))
        routes.append(WebSocketRoute("/live", self._live))
        return Starlette(routes=routes)

    def _host_is_ours(self, host: str) -> bool:
        """Return whether a Host header names this server: by its name as given, this machine's, or
        an address; any other name may be a trick of another site (DNS rebinding)."""
        if not re.fullmatch(r"[A-Za-z0-9.\-]+(:\d{1,5})?|\[[0-9A-Fa-f:.]+\](:\d{1,5})?", host):
            return False
        try:
            name = (urlsplit(f"//{host}").hostname or "").lower()
        except ValueError:  # such as [:::::]
            return False
        if name in ("localhost", self.host.lower(), socket.gethostname().lower()):
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        return self._remote or address.is_loopback

    def _from_here(self, headers: Any) -> bool:
        """Return whether Host is ours, and Origin, where a browser sends one, the same."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self._host_is_ours(host):
            return False
        try:
            return origin is None or urlsplit(origin).netloc == host
        except ValueError:  # such as http://[
            return False

    def _knows(self, token: object) -> bool:
        return isinstance(token, str) and hmac.compare_digest(token.encode(), self._token.encode())

    async def _file(self, request: Request) -> Response:
        from starlette.responses import PlainTextResponse, Response

        if not self._host_is_ours(request.headers.get("host", "")):
            return PlainTextResponse("another host's name\n", 403)
        name, kind = FILES[request.url.path]
        content = (files("eitskin.page") / "static" / name).read_bytes()
        host = request.headers["host"]
        headers = {
            "Content-Security-Policy": (
                "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self';"
                f" connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none';"
                " frame-ancestors 'none'"
            ),
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cache-Control": "no-store",
        }
        return Response(content, media_type=kind, headers=headers)

    def _refused(self, request: Request) -> Response | None:
        """The answer to a request of another site, or without the token."""
        from starlette.responses import JSONResponse

        if not self._from_here(request.headers):
            return JSONResponse({"error": "another site asks"}, 403)
        if not self._knows(request.headers.get("x-eitskin-token")):
            return JSONResponse({"error": "this needs the token"}, 401)
        return None

    async def _recording(self, request: Request) -> Response:
        from starlette.responses import FileResponse, JSONResponse

        if (refused := self._refused(request)) is not None:
            return refused
        try:
            path = self.commands.recording()
            if not path.is_file():
                raise UsageError(f"{path.name}: the recording is not there any more")
        except EitskinError as error:
            return JSONResponse({"error": str(error)}, 404)
        return FileResponse(path, filename=path.name, media_type="application/octet-stream")

    async def _model(self, request: Request) -> Response:
        from starlette.requests import ClientDisconnect
        from starlette.responses import JSONResponse

        if (refused := self._refused(request)) is not None:
            return refused
        body = bytearray()
        try:
            async for piece in request.stream():
                body += piece
                if len(body) > MAX_MODEL_BYTES:
                    return JSONResponse({"error": "this is too long for a model"}, 413)
        except ClientDisconnect:  # nobody reads the answer
            return JSONResponse({"error": "the upload was cut off"}, 400)
        try:
            text = await asyncio.wrap_future(self.commands.upload(bytes(body)))
        except EitskinError as error:
            return JSONResponse({"error": str(error)}, 400)
        return JSONResponse({"text": text})

    async def _live(self, socket: WebSocket) -> None:
        if not self._from_here(socket.headers) or socket.headers.get("origin") is None:
            await socket.close(NO_ORIGIN)  # before it is accepted: HTTP 403
            return
        await socket.accept()
        page = PageClient()
        try:
            hello = json.loads(await asyncio.wait_for(socket.receive_text(), HELLO_S))
            page.may_command = self._knows(hello.get("token"))
        except Exception:
            await _closed(socket.close(1002))
            return
        if self._remote and not page.may_command:
            await _closed(socket.close(NO_TOKEN, "this needs the token"))
            return
        self.hub.pages.add(page)
        page.tell(text_of("state", state=self.reader.state, text=self.reader.text))
        self._tell_setup(page)
        if self.reader.teacher is not None:
            page.tell(text_of("teach", **self.reader.teacher.facts()))
        for frame in self._newest.values():
            page.offer(self._outgoing(frame, time.monotonic_ns()))
        tasks = [
            asyncio.create_task(one)
            for one in (self._send(socket, page), self._receive(socket, page), self._about(page))
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.hub.pages.discard(page)
            if page.presses:
                with suppress(EitskinError):  # the session is over
                    self.commands.press({})
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _send(self, socket: WebSocket, page: PageClient) -> None:
        while True:
            content = await page.next()
            if isinstance(content, str):
                await socket.send_text(content)
            else:
                await socket.send_bytes(content)

    async def _about(self, page: PageClient) -> None:
        while True:
            await asyncio.sleep(ABOUT_S)
            latencies = sorted(page.latencies_ms)
            median = latencies[len(latencies) // 2] if latencies else None
            page.tell(
                text_of("page", dropped=page.dropped, skipped=self.skipped, latency_ms=median)
            )

    async def _receive(self, socket: WebSocket, page: PageClient) -> None:
        """Read the page's messages. No answer is waited for here, so that a command that the board
        does not answer keeps nobody from  Start again."""
        answers: set[asyncio.Task[None]] = set()
        try:
            while True:
                try:
                    message = json.loads(await socket.receive_text())
                    if not isinstance(message, dict):
                        raise ValueError
                    if message.get("type") == "drawn":
                        page.drawn(int(message["number"]))
                        continue
                except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
                    await socket.close(1003)
                    return
                if len(answers) >= MAX_WAITING:
                    page.tell(_refusal(f"the last {MAX_WAITING} commands are not answered yet"))
                    continue
                task = asyncio.create_task(self._answer(message, page))
                answers.add(task)
                task.add_done_callback(answers.discard)
        finally:
            for task in list(answers):
                task.cancel()

    async def _answer(self, message: dict[str, Any], page: PageClient) -> None:
        if not page.may_command:
            reason = "this needs the token: open the address that  eitskin view  printed"
            page.tell(_refusal(reason))
            return
        what, value = message.get("do"), message.get("value")
        if what == "press":
            page.presses = isinstance(value, dict) and any(value.values())
        try:
            done = self.commands.do(what, value)
            if isinstance(done, Future):
                done = await asyncio.wrap_future(done)
        except Exception as error:  # of whatever kind: the page waits for an answer
            page.tell(_refusal(str(error) or type(error).__name__, what))
            return
        page.tell(text_of("answer", ok=True, text=done, do=what))


def _refusal(text: str, what: object = None) -> str:
    return text_of("answer", ok=False, text=text, do=what if isinstance(what, str) else None)


async def _closed(closing: Awaitable[None]) -> None:
    with suppress(Exception):  # it is gone already
        await closing
