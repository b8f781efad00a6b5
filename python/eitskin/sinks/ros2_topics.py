"""Say which ROS 2 messages a frame, a drive's touches or a notice become, and on which topics:
``mcap:`` records them and ``ros2:`` publishes them.

Messages that a robot reads are in metres and by REP 103 and 105: contacts, poses and markers are in
the frame of the skin's link, where that is known (a robot file or the model of a surface names it).
Else they are in the skin's own frame, with x to the right and y up as the skin is seen from above,
and z out of it. The messages in millimetres and the image are always of the skin's own drawing.
"""

import math
from collections.abc import Iterator, Sequence
from importlib.resources import files
from itertools import chain
from types import SimpleNamespace
from typing import Any

from eitskin.robot.placement import Placement
from eitskin.sinks import ros2
from eitskin.sinks.sink import OfSkin, OutgoingMessage, TouchSource, or_nan

Topic = tuple[str, str, ros2.Table]  # its name, the type of its messages, a message
CONTACTS, POSES = "eitskin_msgs/msg/ContactArray", "geometry_msgs/msg/PoseArray"
MARKERS = "visualization_msgs/msg/MarkerArray"
CYLINDER, DELETE_ALL = 3, 3
HEIGHT_M = 0.002  # of a marker
XYZ = "float64 x\nfloat64 y\nfloat64 z\n"
OWN = Placement("")  # in the skin's own frame
LIFETIME_NS = 500_000_000  # of markers, after which a stream that ended shows nothing
COLOUR = (0.9, 0.35, 0.1)


def frame_id(source: TouchSource) -> str:
    """The skin's own frame of reference in ROS: the source's name, or skin."""
    return source.name or "skin"


def topics_of(source: TouchSource) -> str:
    """Return the beginning of each topic: the source's name, if it has one."""
    return "" if source.name is None else f"/{source.name}"


def definitions() -> dict[str, str]:
    """Return the definition of each message type together with the types it uses, in the format of
    ros2msg files."""
    folder = files("eitskin.sinks").joinpath("msg")

    def text(name: str) -> str:
        return folder.joinpath(name).read_text("utf-8")

    return ros2.definitions() | {
        CONTACTS: ros2.whole(
            text("ContactArray.msg"),
            {
                "eitskin_msgs/Contact": text("Contact.msg"),
                "geometry_msgs/Point": XYZ,
                "geometry_msgs/Vector3": XYZ,
            },
        ),
        POSES: text("PoseArray.msgdef"),
        MARKERS: text("MarkerArray.msgdef"),
    }


class RosTopics:
    """The messages of a source, or of all skins of a robot."""

    def __init__(self, source: TouchSource) -> None:
        self._skins = OfSkin(source, _SkinTopics)

    def of(self, outgoing: OutgoingMessage) -> Iterator[Topic]:
        skin = self._skins.of(outgoing.message)
        return iter(()) if skin is None else skin.of(outgoing)


class _SkinTopics:
    """The messages of one skin. Diagnostics are repeated only when they change."""

    def __init__(self, source: TouchSource) -> None:
        self._source, self._frame_id, self._prefix = source, frame_id(source), topics_of(source)
        self._link = source.link or self._frame_id
        self._status: Any = None

    def of(self, outgoing: OutgoingMessage) -> Iterator[Topic]:
        for name, kind, table in self._plain(outgoing):
            yield self._prefix + name, kind, table

    def _plain(self, outgoing: OutgoingMessage) -> Iterator[Topic]:
        message = outgoing.message
        if message["type"] == "summary":  # it has no time
            return
        now, at, link = outgoing.time_ns, self._frame_id, self._link
        if outgoing.report is not None:
            yield "/reports", "eitskin_msgs/msg/Report", ros2.report(message, now, at)
            yield "/contacts", CONTACTS, contacts(message, now, link)
            return
        if outgoing.frame is not None:
            yield "/touches", "eitskin_msgs/msg/TouchArray", ros2.touch_array(message, now, at)
            yield "/contacts", CONTACTS, contacts(message, now, link)
            yield "/poses", POSES, poses(message, now, link)
            yield "/markers", MARKERS, markers(message, now, link)
            model = self._source.model
            if outgoing.frame.image is not None and model is not None:
                table = ros2.image(model.grid, outgoing.frame.image, now, at)
                yield "/image", "sensor_msgs/msg/Image", table
        table = ros2.diagnostics(message, now, at, self._source.board)
        if table["status"] != self._status or outgoing.notice is not None:
            yield "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", table
            self._status = table["status"]


def contacts(message: ros2.Table, time_ns: int, frame: str) -> ros2.Table:
    """Return the eitskin_msgs/ContactArray of a frame, or of a drive, whose touches have neither
    confidence nor force."""
    return {
        "header": ros2.header(time_ns, frame),
        "contacts": [_contact(touch) for touch in message["touches"] or []],
    }


def _contact(touch: ros2.Table) -> ros2.Table:
    def known(name: str, factor: float = 1.0) -> float:
        return or_nan(touch.get(name)) * factor

    place = placed(touch)
    velocity = place.get("velocity_m_per_s")
    covariance = place["covariance_m2"]
    return {
        "id": touch["id"],
        "position": _vector(place["position_m"]),
        "normal": _vector(place["normal"]),
        "velocity": _vector([math.nan] * 3 if velocity is None else velocity),
        "radius": known("radius_mm", place["scale"] / 1e3),
        "force": known("force_n"),
        "confidence": known("confidence"),
        "covariance": [math.nan] * 9 if covariance is None else [*chain(*covariance)],
    }


def placed(touch: ros2.Table) -> ros2.Table:
    """Return the place of a touch in its link's frame, or in the skin's own if the message does not
    have the former."""
    if "position_m" in touch:
        return touch
    facts = {name: touch.get(name) for name in ("x_mm", "y_mm", *ros2.COVARIANCE)}
    moves = {name: touch[name] for name in ("vx_mm_per_s", "vy_mm_per_s") if name in touch}
    return OWN.place(SimpleNamespace(**facts, **moves)).as_dict()


def _vector(numbers: Sequence[float]) -> ros2.Table:
    return dict(zip("xyz", numbers, strict=True))


def poses(message: ros2.Table, time_ns: int, frame: str) -> ros2.Table:
    """Return the geometry_msgs/PoseArray of a frame: the centre of each touch, z out of the
    skin."""
    found = [_pose(placed(touch), 0.0) for touch in message["touches"] or []]
    return {"header": ros2.header(time_ns, frame), "poses": found}


def _pose(place: ros2.Table, turn_rad: float) -> ros2.Table:
    """A touch's centre, with its frame turned about the normal."""
    x, y, z, w = place["quaternion_xyzw"]
    s, c = math.sin(turn_rad / 2), math.cos(turn_rad / 2)
    return {
        "position": _vector(place["position_m"]),
        "orientation": {
            "x": x * c + y * s, "y": y * c - x * s, "z": z * c + w * s, "w": w * c - z * s
        },
    }  # fmt: skip


def markers(message: ros2.Table, time_ns: int, frame: str) -> ros2.Table:
    """Return the visualization_msgs/MarkerArray of a frame: a flat cylinder per touch, in place of
    those of the frame before. An ellipse has its long axis along the marker's x."""
    head = ros2.header(time_ns, frame)
    nowhere = placed({"x_mm": 0.0, "y_mm": 0.0})
    found = [_marker(head, DELETE_ALL, 0, _pose(nowhere, 0.0), (1.0, 1.0), 0.0)]
    for touch in message["touches"] or []:
        place = placed(touch)
        m_per_mm = place["scale"] / 1e3
        radius = touch["radius_mm"] * m_per_mm
        along = math.hypot(touch["long_x_mm"] or 0.0, touch["long_y_mm"] or 0.0) * m_per_mm
        turn, size = 0.0, (radius, radius)
        if along > 0:  # the ellipse has the area pi radius^2
            turn = math.atan2(touch["long_y_mm"], touch["long_x_mm"])
            size = (along, radius**2 / along)
        alpha = 0.9 if touch["confidence"] is None else max(0.3, touch["confidence"])
        found.append(_marker(head, 0, touch["id"], _pose(place, turn), size, alpha))
    return {"markers": found}


def _marker(
    head: ros2.Table,
    action: int,
    number: int,
    pose: ros2.Table,
    half_m: tuple[float, float],
    alpha: float,
) -> ros2.Table:
    red, green, blue = COLOUR
    return {
        "header": head,
        "ns": "touches",
        "id": number % 2**31,
        "type": CYLINDER,
        "action": action,
        "pose": pose,
        "scale": {"x": 2 * half_m[0], "y": 2 * half_m[1], "z": HEIGHT_M},
        "color": {"r": red, "g": green, "b": blue, "a": alpha},
        "lifetime": {"sec": 0, "nanosec": LIFETIME_NS},
        "frame_locked": True,
        "points": [],
        "colors": [],
        "texture_resource": "",
        "texture": {"header": head, "format": "", "data": []},
        "uv_coordinates": [],
        "text": "",
        "mesh_resource": "",
        "mesh_file": {"filename": "", "data": []},
        "mesh_use_embedded_materials": False,
    }
