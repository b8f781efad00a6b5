"""The node: a skin's touches, images and diagnostics as topics. Untested with ROS itself."""

from __future__ import annotations

import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from eitskin_msgs.msg import Touch, TouchArray
from rclpy.node import Node
from sensor_msgs.msg import Image

import eitskin
from eitskin.errors import EitskinError
from eitskin.sinks import ros2
from eitskin_ros.conversion import fill


class Skin(Node):
    """Publishes until the stream or ROS ends."""

    def __init__(self) -> None:
        super().__init__("skin")
        usual = {"device": "auto", "mode": "touches", "frame_id": "skin", "speed": 0.0, "model": ""}
        self.setting = {
            name: self.declare_parameter(name, value).value for name, value in usual.items()
        }
        self.touches = self.create_publisher(TouchArray, "touches", 10)
        self.image = self.create_publisher(Image, "image", 2)
        self.diagnostics = self.create_publisher(DiagnosticArray, "diagnostics", 10)

    def follow(self) -> None:
        """Publish every frame."""
        how, place = self.setting, self.setting["frame_id"]
        frames = eitskin.stream(
            how["device"], mode=how["mode"], model=how["model"] or None, speed=how["speed"]
        )
        shown = None
        for frame in frames:
            message, now = frame.message(), time.time_ns()
            table = ros2.touch_array(message, now, place)
            self.touches.publish(fill(TouchArray(), table, {"touches": Touch}))
            if frame.image is not None and frame.known is not None:
                table = ros2.image(frame.known.model.grid, frame.image, now, place)
                self.image.publish(fill(Image(), table, {}))
            for one in (*(notice.message() for notice in frame.notices), message):
                table = ros2.diagnostics(one, now, place, how["device"])
                if table["status"] != shown:
                    parts = {"status": DiagnosticStatus, "values": lambda: None}
                    self.diagnostics.publish(fill(DiagnosticArray(), table, parts))
                shown = table["status"]
            if not rclpy.ok():
                return


def main() -> None:
    """``ros2 run eitskin_ros skin``."""
    rclpy.init()
    node = Skin()
    spinning = threading.Thread(target=rclpy.spin, args=(node,), daemon=True)
    spinning.start()
    try:
        node.follow()
    except KeyboardInterrupt:
        pass
    except EitskinError as error:
        node.get_logger().error(str(error))
    finally:
        rclpy.try_shutdown()
