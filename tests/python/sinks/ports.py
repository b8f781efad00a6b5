"""Ports for programs that open one by its number."""

import random
import socket
from pathlib import Path

RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
TRIES = 100


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    """A port of 127.0.0.1 that nobody else gets before its program opens it: it lies below those
    that the system hands out to whoever asks for any port, and it is drawn by chance.

    Raises:
        AssertionError: all ports that were tried are in use.
    """
    lowest = int(RANGE.read_text().split()[0])
    for _ in range(TRIES):
        port = random.SystemRandom().randrange(max(1024, lowest // 2), lowest)
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise AssertionError(f"no free port below {lowest}")
