"""Make messages of ROS 2 as plain tables: a touch array and a report after a drive (``msg/``),
sensor_msgs/Image and diagnostic_msgs/DiagnosticArray.

``mcap:`` writes them, and the node in examples/python/ros2 publishes them. Nothing here needs ROS.
"""

import math
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.fem.grid import Grid

if TYPE_CHECKING:
    import numpy.typing as npt

Table = dict[str, Any]
NUMBERS = (
    "x_mm", "y_mm", "radius_mm", "strength_s_per_m_mm2", "force_n", "confidence", "long_x_mm",
    "long_y_mm", "radius_sd_mm",
)  # fmt: skip
COVARIANCE = ("x_variance_mm2", "xy_covariance_mm2", "y_variance_mm2")
OK, WARN, ERROR = 0, 1, 2
COMMON = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
}
IMAGE = """std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
"""
DIAGNOSTICS = "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n"
STATUS = """byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
diagnostic_msgs/KeyValue[] values
"""
KEY_VALUE = "string key\nstring value\n"


def definitions() -> dict[str, str]:
    """Return the definition of each message type together with the types it uses, in the format of
    ros2msg files."""
    folder = files("eitskin.sinks").joinpath("msg")
    touch = folder.joinpath("Touch.msg").read_text("utf-8")
    array = folder.joinpath("TouchArray.msg").read_text("utf-8")
    moving = folder.joinpath("MovingTouch.msg").read_text("utf-8")
    report = folder.joinpath("Report.msg").read_text("utf-8")
    diagnostic = {"diagnostic_msgs/DiagnosticStatus": STATUS, "diagnostic_msgs/KeyValue": KEY_VALUE}
    return {
        "eitskin_msgs/msg/TouchArray": whole(array, {"eitskin_msgs/Touch": touch}),
        "eitskin_msgs/msg/Report": whole(report, {"eitskin_msgs/MovingTouch": moving}),
        "sensor_msgs/msg/Image": whole(IMAGE, {}),
        "diagnostic_msgs/msg/DiagnosticArray": whole(DIAGNOSTICS, diagnostic),
    }


def whole(first: str, others: dict[str, str]) -> str:
    """Return the definition ``first`` with those of ``others`` and of headers behind it."""
    parts = [f"{'=' * 80}\nMSG: {name}\n{text}" for name, text in (others | COMMON).items()]
    return "".join((first, *parts))


def header(time_ns: int, frame_id: str) -> Table:
    """Return a std_msgs/Header."""
    return {"stamp": {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}, "frame_id": frame_id}


def touch_array(message: Table, time_ns: int, frame_id: str) -> Table:
    """Return the eitskin_msgs/TouchArray for a frame's message."""
    touches = [
        {
            "id": touch["id"],
            **{name: _known(touch[name]) for name in NUMBERS},
            "covariance_mm2": [_known(touch[name]) for name in COVARIANCE],
            "confirmed": touch["confirmed"],
        }
        for touch in message["touches"] or []
    ]
    return {
        "header": header(time_ns, frame_id),
        "frame": message["frame"],
        "time_s": _known(message["time_s"]),
        "refused": message["refused"] is not None,
        "touches": touches,
    }


def report(message: Table, time_ns: int, frame_id: str) -> Table:
    """Return the eitskin_msgs/Report for a message of touches after a drive."""
    head = {name: message[name] for name in ("frame", "drive", "time_s")}
    touches = [
        {name: value for name, value in touch.items() if name not in COVARIANCE}
        | {"covariance_mm2": [touch[name] for name in COVARIANCE]}
        for touch in message["touches"]
    ]
    return {"header": header(time_ns, frame_id)} | head | {"touches": touches}


def image(grid: Grid, values: "npt.ArrayLike", time_ns: int, frame_id: str) -> Table:
    """Return a sensor_msgs/Image in encoding 32FC1 and S/m: row 0 has the highest y, and pixels
    outside the skin are NaN."""
    picture = np.ascontiguousarray(grid.image(values)[::-1], dtype="<f4")
    height, width = picture.shape
    return {
        "header": header(time_ns, frame_id),
        "height": height,
        "width": width,
        "encoding": "32FC1",
        "is_bigendian": 0,
        "step": 4 * width,
        "data": picture.tobytes(),
    }


def diagnostics(message: Table, time_ns: int, frame_id: str, hardware: str) -> Table:
    """Return the diagnostic_msgs/DiagnosticArray for the message of a frame or a notice."""
    if message["type"] == "notice":
        status = [_status(WARN, f"eitskin {message['kind']}", message["text"], hardware)]
    elif message["refused"] is not None:
        status = [_status(ERROR, "eitskin frame", message["refused"], hardware)]
    else:
        pairs = zip(message["diagnostics"], message["found"], strict=True)
        status = [_status(WARN, f"eitskin {name}", text, hardware) for name, text in pairs]
        status = status or [_status(OK, "eitskin frame", "nothing found", hardware)]
    return {"header": header(time_ns, frame_id), "status": status}


def _status(level: int, name: str, text: str, hardware: str) -> Table:
    return {"level": level, "name": name, "message": text, "hardware_id": hardware, "values": []}


def _known(value: float | None) -> float:
    return math.nan if value is None else float(value)
