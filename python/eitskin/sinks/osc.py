"""``osc://HOST:PORT[/prefix]``: send a bundle of OSC messages per frame over UDP.

The messages of a frame are /eitskin/frame number time_s touches; for each touch /eitskin/touch id
x_mm y_mm radius_mm strength force_n confidence confirmed xx xy yy (nil if unknown; xx, xy, yy: the
covariance of the place in mm^2); and /eitskin/event kind x_mm y_mm direction_deg value zone
touch_ids... After a drive, /eitskin/drive frame drive time_s touches is sent, then for each touch
/eitskin/moving id x_mm y_mm vx_mm_per_s vy_mm_per_s strength confirmed xx xy yy. Notices are sent
as /eitskin/notice kind text.
"""

from importlib.util import find_spec
from typing import Any

from eitskin.errors import missing_extra
from eitskin.sinks.sink import OutgoingMessage, Sink, TouchSource, address, nothing_more
from eitskin.sinks.udp import connected, send

# how sure a touch is
SURE = ("confirmed", "x_variance_mm2", "xy_covariance_mm2", "y_variance_mm2")
USAGE = "osc://HOST:PORT or osc://HOST:PORT/prefix"


def need_osc(extra: str) -> None:
    if find_spec("pythonosc") is None:
        raise missing_extra(extra, "python-osc")


def bundle(messages: list[tuple[str, list[Any]]]) -> bytes:
    """Return an OSC bundle that is handled at once; None becomes nil."""
    from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
    from pythonosc.osc_message_builder import OscMessageBuilder

    whole = OscBundleBuilder(IMMEDIATELY)
    for path, arguments in messages:
        message = OscMessageBuilder(path)
        for one in arguments:
            message.add_arg(one)
        whole.add_content(message.build())
    built: bytes = whole.build().dgram
    return built


class OscSink:
    """A socket that sends a datagram per frame."""

    def __init__(self, target: Any, prefix: str) -> None:
        self._socket, self._prefix = target, prefix

    def write(self, outgoing: OutgoingMessage) -> None:
        messages = [
            (self._prefix + path, values) for path, values in osc_messages(outgoing.message)
        ]
        if messages:
            send(self._socket, bundle(messages))

    def close(self) -> None:
        self._socket.close()


def osc_messages(message: dict[str, Any]) -> list[tuple[str, list[Any]]]:
    """Return the paths and arguments for a message, or an empty list for a summary."""
    if message["type"] == "notice":
        return [("/notice", [message["kind"], message["text"]])]
    if message["type"] == "report":
        head = [message["frame"] & 0x7FFFFFFF, message["drive"], float(message["time_s"])]
        names = ("id", "x_mm", "y_mm", "vx_mm_per_s", "vy_mm_per_s", "strength_s_per_m_mm2", *SURE)
        moving = [("/moving", [one[name] for name in names]) for one in message["touches"]]
        return [("/drive", [*head, len(moving)]), *moving]
    if message["type"] != "frame":
        return []
    touches = message["touches"] or []
    listed: list[tuple[str, list[Any]]] = [
        ("/frame", [message["frame"] & 0x7FFFFFFF, float(message["time_s"]), len(touches)])
    ]
    for t in touches:
        place = [t["id"], t["x_mm"], t["y_mm"], t["radius_mm"]]
        known = [t["strength_s_per_m_mm2"], t["force_n"], t["confidence"]]
        listed.append(("/touch", place + known + [t[name] for name in SURE]))
    for event in message["events"]:
        values = [
            event[name] for name in ("kind", "x_mm", "y_mm", "direction_deg", "value", "zone")
        ]
        listed.append(("/event", values + event["touch_ids"]))
    return listed


def open_sink(url: str, source: TouchSource) -> Sink:
    parts, host, port = address(url, None, usage=USAGE)
    nothing_more(url, parts, USAGE, path=True)
    need_osc("osc")
    default = "/eitskin" if source.name is None else f"/eitskin/{source.name}"
    return OscSink(connected(url, host, port), parts.path.rstrip("/") or default)
