"""Tables of eitskin.sinks.ros2 to messages of ROS 2, whatever their classes are."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from typing import Any


def fill(message: Any, table: Mapping[str, Any], parts: Mapping[str, Callable[[], Any]]) -> Any:
    """Set the fields of ``message`` that ``table`` names, and return it. ``parts``: what makes one
    element of a field that is an array of messages."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            fill(getattr(message, name), value, parts)
        elif name in parts:
            setattr(message, name, [fill(parts[name](), one, parts) for one in value])
        elif isinstance(value, bytes):
            setattr(message, name, array("B", value))
        elif name == "level":
            setattr(message, name, bytes([value]))  # of type byte
        else:
            setattr(message, name, value)
    return message
