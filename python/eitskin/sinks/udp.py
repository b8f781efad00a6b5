"""``udp://HOST:PORT``: send each message as a datagram of JSON."""

import socket

from eitskin.errors import SinkError
from eitskin.sinks.sink import OutgoingMessage, Sink, TouchSource, address, nothing_more

USAGE = "udp://HOST:PORT"


class UdpSink:
    """A socket that sends a datagram per message. Nobody needs to listen; a message that is too
    long for a datagram fails."""

    def __init__(self, target: socket.socket) -> None:
        self._socket = target

    def write(self, outgoing: OutgoingMessage) -> None:
        send(self._socket, outgoing.text.encode())

    def close(self) -> None:
        self._socket.close()


def open_sink(url: str, source: TouchSource) -> Sink:
    parts, host, port = address(url, None, usage=USAGE)
    nothing_more(url, parts, USAGE)
    return UdpSink(connected(url, host, port))


def send(target: socket.socket, data: bytes) -> None:
    """Send a datagram; nobody needs to listen."""
    try:
        target.send(data)
    except ConnectionRefusedError:  # caused by an earlier datagram: nobody listens on this machine
        target.send(data)


def connected(url: str, host: str, port: int) -> socket.socket:
    """Return a socket that sends datagrams to ``host`` and ``port``.

    Raises:
        SinkError: the host is unknown or cannot be reached.
    """
    try:
        kind, _, _, _, target = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        opened = socket.socket(kind, socket.SOCK_DGRAM)
        opened.connect(target)
    except OSError as error:
        raise SinkError(
            f"--to {url}: cannot send there ({error.strerror or error}); check host and port"
        ) from None
    return opened
