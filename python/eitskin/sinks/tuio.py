"""``tuio://HOST[:3333]``: send TUIO 1.1, profile /tuio/2Dcur, over UDP to multi-touch programs.

Each frame gives a bundle: source, alive with all ids, a set per touch, and fseq. x and y of a set
are relative to the skin's bounding box, 0 to 1, y downwards as TUIO defines it; the speed is in
boxes per second, the acceleration in boxes per second squared. The source is NAME@HOST, where NAME
is the path of ``tuio://HOST/NAME``, else the name of the board, skin or source, else eitskin with
the board's serial number and the number of this process, so that two skins are two sources. With
``--report drive`` each drive gives a bundle with its ids and speeds. A frame without reports after
it, and the end of the stream, give a bundle without touches.
"""

import math
import os
import socket
from typing import Any

from eitskin.device.timing import check_name
from eitskin.errors import SinkError
from eitskin.sinks.osc import bundle, need_osc
from eitskin.sinks.sink import Box, OutgoingMessage, Sink, TouchSource, address, nothing_more
from eitskin.sinks.udp import connected, send

USAGE = "tuio://HOST, tuio://HOST:PORT or tuio://HOST/NAME"
PORT = 3333
PATH = "/tuio/2Dcur"
State = tuple[float, float, float, float, float]  # x, y, their speeds, the acceleration


class Cursors:
    """Turns touches of successive frames into TUIO messages."""

    def __init__(self, box_mm: Box, name: str) -> None:
        self._box, self._name = box_mm, name
        self._frame, self._time_s = 0, 0.0
        self._before: dict[int, State] = {}

    def messages(self, touches: list[dict[str, Any]], time_s: float) -> list[tuple[str, list[Any]]]:
        """Return the messages for the touches at ``time_s``, of a frame or after a drive."""
        self._frame += 1
        elapsed_s, self._time_s = time_s - self._time_s, time_s
        now = {t["id"]: self._state(t, elapsed_s) for t in touches}
        self._before = now
        sets: list[tuple[str, list[Any]]] = [
            (PATH, ["set", one, *map(float, state)]) for one, state in now.items()
        ]
        return [
            (PATH, ["source", self._name]),
            (PATH, ["alive", *now]),
            *sets,
            (PATH, ["fseq", self._frame]),
        ]

    @property
    def some(self) -> bool:
        """Return whether the last messages had touches."""
        return bool(self._before)

    def _state(self, touch: dict[str, Any], elapsed_s: float) -> State:
        x0, y0, x1, y1 = self._box
        x = min(max((touch["x_mm"] - x0) / (x1 - x0), 0.0), 1.0)
        y = min(max((y1 - touch["y_mm"]) / (y1 - y0), 0.0), 1.0)
        before = self._before.get(touch["id"])
        if "vx_mm_per_s" in touch:
            speed_x = touch["vx_mm_per_s"] / (x1 - x0)
            speed_y = -touch["vy_mm_per_s"] / (y1 - y0)
        elif before is None or elapsed_s <= 0:
            return x, y, 0.0, 0.0, 0.0
        else:
            speed_x, speed_y = (x - before[0]) / elapsed_s, (y - before[1]) / elapsed_s
        if before is None or elapsed_s <= 0:
            return x, y, speed_x, speed_y, 0.0
        change = math.hypot(speed_x, speed_y) - math.hypot(before[2], before[3])
        return x, y, speed_x, speed_y, change / elapsed_s


class TuioSink:
    """A socket that sends a datagram per frame, or per drive if drives are reported."""

    def __init__(self, target: socket.socket, cursors: Cursors) -> None:
        self._socket, self._cursors, self._time_s = target, cursors, 0.0
        self._reported: int | None = None  # the frame of the last report

    def write(self, outgoing: OutgoingMessage) -> None:
        message = outgoing.message
        if message["type"] == "notice":
            return
        touches = message.get("touches") or []
        if message["type"] == "report":
            self._reported = message["frame"]
        elif message["type"] == "frame" and self._reported is not None:
            # While there are touches, every drive reports. A frame after the last report has none,
            # even if packets were lost.
            if message["frame"] <= self._reported:
                return
            touches = []
        self._time_s = message.get("time_s", self._time_s)
        send(self._socket, bundle(self._cursors.messages(touches, self._time_s)))

    def close(self) -> None:
        if self._cursors.some:  # the stream was interrupted: end all touches
            self._socket.send(bundle(self._cursors.messages([], self._time_s)))
        self._socket.close()


def open_sink(url: str, source: TouchSource) -> Sink:
    parts, host, port = address(url, PORT, usage=USAGE)
    nothing_more(url, parts, USAGE, path=True)
    named = parts.path.strip("/") or source.name
    need_osc("tuio")
    if source.box_mm is None:
        raise SinkError(
            f"--to {url}: TUIO needs the skin's bounding box, which is in the board's model; name"
            " its file with  --model FILE"
        )
    if parts.path.strip("/"):
        check_name(parts.path.strip("/"), f"--to {url}")
    own = f"eitskin-{source.source or source.board or 'board'}-{os.getpid()}"
    name = f"{named or own}@{socket.gethostname()}"
    return TuioSink(connected(url, host, port), Cursors(source.box_mm, name))
