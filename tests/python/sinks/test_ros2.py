"""The node's conversion, with classes that are as strict about their fields as rclpy's."""

import re
import sys
from array import array
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.session.frame import Notice
from eitskin.sinks import ros2

ROOT = Path(__file__).resolve().parents[3]
NODE = ROOT / "examples" / "python" / "ros2"
KINDS = {
    "string": str, "bool": bool, "byte": bytes, "float64": float, "int32": int, "uint32": int,
    "uint8": int, "uint8[]": array, "float64[3]": list,
}  # fmt: skip


def message_class(text: str, others: dict[str, type]) -> type:
    """A class with the fields of a definition, which takes nothing else."""
    fields = {}
    for line in text.splitlines():
        match = re.match(r"(\S+) (\w+)\s*(#.*)?$", line)
        if match:
            fields[match.group(2)] = match.group(1)

    class Message:
        def __init__(self) -> None:
            for name, kind in fields.items():
                if kind in others:
                    object.__setattr__(self, name, others[kind]())

        def __setattr__(self, name: str, value: Any) -> None:
            kind = fields[name]
            if kind.endswith("[]") and kind != "uint8[]":
                assert all(isinstance(one, others[kind[:-2]]) for one in value), name
            else:
                assert isinstance(value, KINDS[kind]), (name, kind, value)
            object.__setattr__(self, name, value)

    return Message


def classes(definition: str) -> tuple[type, dict[str, type]]:
    """The class of a definition, and of those that it uses."""
    first, *rest = re.split(r"={80}\nMSG: ", definition)
    made: dict[str, type] = {}
    for part in reversed(rest):  # a type stands before those that it uses
        name, _, text = part.partition("\n")
        made[name] = message_class(text, made)
    return message_class(first, made), made


def test_messages_take_what_the_conversion_sets(swipe, drives):
    sys.path.insert(0, str(NODE / "eitskin_ros"))
    try:
        from eitskin_ros.conversion import fill
    finally:
        sys.path.pop(0)
    defined = ros2.definitions()
    frame = next(one for one in swipe.frames if one.touches)
    now = 1_700_000_000_123_456_789

    array_class, parts = classes(defined["eitskin_msgs/msg/TouchArray"])
    table = ros2.touch_array(frame.message(), now, "skin")
    message = fill(array_class(), table, {"touches": parts["eitskin_msgs/Touch"]})
    (touch,) = frame.touches
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(now, 10**9)
    assert (message.frame, message.touches[0].id) == (frame.number, touch.id)
    assert message.touches[0].x_mm == touch.x_mm and np.isnan(message.touches[0].force_n)
    assert message.touches[0].covariance_mm2[0] == touch.x_variance_mm2

    report_class, parts = classes(defined["eitskin_msgs/msg/Report"])
    report = drives.reports[-1]
    table = ros2.report(report.message(), now, "skin")
    message = fill(report_class(), table, {"touches": parts["eitskin_msgs/MovingTouch"]})
    assert (message.time_s, message.drive) == (report.time_s, report.drive)
    assert message.touches[0].vx_mm_per_s == report.touches[0].vx_mm_per_s

    image_class, _ = classes(defined["sensor_msgs/msg/Image"])
    assert swipe.source.model is not None and frame.image is not None
    table = ros2.image(swipe.source.model.grid, frame.image, now, "skin")
    image = fill(image_class(), table, {})
    assert image.header.frame_id == "skin" and len(image.data) == image.step * image.height

    status_class, parts = classes(defined["diagnostic_msgs/msg/DiagnosticArray"])
    notice = Notice("fault", "electrode 5 open", 1.0)
    for reported, level in ((frame.message(), b"\0"), (notice.message(), b"\1")):
        table = ros2.diagnostics(reported, now, "skin", "sim")
        made = {"status": parts["diagnostic_msgs/DiagnosticStatus"], "values": lambda: None}
        assert [one.level for one in fill(status_class(), table, made).status] == [level]


def test_the_workspace_has_the_messages_that_ship():
    shipped = {path.name: path.read_text() for path in ROOT.glob("python/eitskin/sinks/msg/*.msg")}
    built = {path.name: path.read_text() for path in NODE.glob("eitskin_msgs/msg/*.msg")}
    assert shipped == built and len(built) == 6
