"""``mqtt://[USER:PASSWORD@]HOST[:1883][/topic]``: publish each message to topic/frame,
topic/report, topic/notice or topic/summary of a broker. The default topic is eitskin, or
eitskin/NAME of a board, skin or source that has a name."""

import threading
from typing import Any
from urllib.parse import unquote

from eitskin.errors import SinkError, missing_extra
from eitskin.sinks.sink import (
    Dropped,
    OutgoingMessage,
    Sink,
    TouchSource,
    address,
    nothing_more,
    without_password,
)

USAGE = "mqtt://HOST or mqtt://HOST:PORT/topic"
PORT = 1883
CONNECT_S = 5.0
SENT_S = 1.0


class MqttSink:
    """A connection to a broker with quality of service 0. While the broker is away, messages are
    dropped and the client reconnects by itself."""

    def __init__(self, client: Any, topic: str) -> None:
        self._client, self._topic = client, topic
        self._last: Any = None

    def write(self, outgoing: OutgoingMessage) -> None:
        if not self._client.is_connected() or not self._sent():
            raise Dropped
        self._last = self._client.publish(
            f"{self._topic}/{outgoing.message['type']}", outgoing.text
        )
        if not self._sent():
            raise Dropped

    def _sent(self) -> bool:
        """Return whether the last message has been sent, so that messages do not pile up in the
        client.

        Raises:
            Dropped: the broker went away meanwhile.
        """
        if self._last is None:
            return True
        try:
            self._last.wait_for_publish(SENT_S)
        except (RuntimeError, ValueError):  # the broker went away meanwhile
            self._last = None
            raise Dropped from None
        return bool(self._last.is_published())

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


def open_sink(url: str, source: TouchSource) -> Sink:
    """Connect to the broker that ``url`` names.

    Raises:
        UsageError: the address cannot be read.
        SinkError: no broker answers, or it refuses.
        MissingExtraError: paho-mqtt is not installed.
    """
    parts, host, port = address(url, PORT, usage=USAGE)
    nothing_more(url, parts, USAGE, path=True)
    try:
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion
    except ImportError:
        raise missing_extra("mqtt", "paho-mqtt") from None
    client, answered, refused = Client(CallbackAPIVersion.VERSION2), threading.Event(), []

    def connected(_client: Any, _data: Any, _flags: Any, reason: Any, _more: Any) -> None:
        if reason.is_failure:
            refused.append(str(reason))
        answered.set()

    client.on_connect = connected
    client.reconnect_delay_set(1, 10)
    if parts.username is not None:
        client.username_pw_set(unquote(parts.username), unquote(parts.password or ""))
    shown = without_password(url)
    try:
        client.connect(host, port, keepalive=30)
    except (OSError, ValueError) as error:
        raise SinkError(
            f"--to {shown}: no broker answers there ({error}); start one, or check host and port"
        ) from None
    client.loop_start()
    if not answered.wait(CONNECT_S) or refused:
        client.loop_stop()
        why = refused[0] if refused else "no answer"
        raise SinkError(f"--to {shown}: the broker refuses ({why}); check user and password")
    default = "eitskin" if source.name is None else f"eitskin/{source.name}"
    return MqttSink(client, parts.path.strip("/") or default)
