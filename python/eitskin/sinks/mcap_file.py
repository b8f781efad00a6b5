"""``mcap:FILE``: record ROS 2 messages (CDR) for ROS, Foxglove and similar programs.

The topics are /touches with eitskin_msgs/msg/TouchArray, /reports with eitskin_msgs/msg/Report if
``--report drive`` is set, /image with sensor_msgs/msg/Image if images are streamed, and
/diagnostics with diagnostic_msgs/msg/DiagnosticArray when the diagnostics change. The file is
written in chunks of about a second, and a killed program loses the last chunk. The list of chunks
stays in memory until the end. If the source has a name, topics begin with it (/NAME/touches), and
it is the frame of reference.
"""

from typing import Any

from eitskin.errors import missing_extra
from eitskin.sinks import ros2
from eitskin.sinks.csv_file import new_file
from eitskin.sinks.sink import OutgoingMessage, Sink, TouchSource

CHUNK_BYTES, REPORTS_BYTES, IMAGES_BYTES = 1 << 14, 1 << 16, 1 << 18  # about a second of each


def frame_id(source: TouchSource) -> str:
    """The frame of reference in ROS: the source's name, or skin."""
    return source.name or "skin"


def topics_of(source: TouchSource) -> str:
    """What topics begin with: the source's name, if it has one."""
    return "" if source.name is None else f"/{source.name}"


class McapSink:
    """An open MCAP file."""

    def __init__(self, stream: Any, source: TouchSource) -> None:
        self._stream, self._source = stream, source
        self._frame_id, self._prefix = frame_id(source), topics_of(source)
        self._writer: Any = None
        self._types: dict[str, Any] = {}
        self._status: Any = None

    def write(self, outgoing: OutgoingMessage) -> None:
        message = outgoing.message
        if message["type"] == "summary":
            return
        if self._writer is None:
            images = outgoing.frame is not None and outgoing.frame.image is not None
            self._begin(
                IMAGES_BYTES if images else REPORTS_BYTES if outgoing.report else CHUNK_BYTES
            )
        now = outgoing.time_ns
        if outgoing.report is not None:
            table = ros2.report(message, now, self._frame_id)
            self._put("/reports", "eitskin_msgs/msg/Report", table, now)
            return
        if outgoing.frame is not None:
            table = ros2.touch_array(message, now, self._frame_id)
            self._put("/touches", "eitskin_msgs/msg/TouchArray", table, now)
            if outgoing.frame.image is not None and self._source.model is not None:
                table = ros2.image(
                    self._source.model.grid, outgoing.frame.image, now, self._frame_id
                )
                self._put("/image", "sensor_msgs/msg/Image", table, now)
        table = ros2.diagnostics(message, now, self._frame_id, self._source.board)
        if table["status"] != self._status or outgoing.notice is not None:
            self._put("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", table, now)
            self._status = table["status"]
        self._stream.sync_now_and_then()
        self._stream.check()

    def close(self) -> None:
        if self._writer is None:
            self._begin(CHUNK_BYTES)
        try:
            self._writer.finish()
        finally:
            self._stream.close()

    def _begin(self, chunk_bytes: int) -> None:
        from mcap_ros2.writer import Writer

        self._writer = Writer(self._stream, chunk_size=chunk_bytes)
        self._types = {
            name: self._writer.register_msgdef(name, text)
            for name, text in ros2.definitions().items()
        }

    def _put(self, topic: str, kind: str, table: ros2.Table, time_ns: int) -> None:
        self._writer.write_message(self._prefix + topic, self._types[kind], table, time_ns, time_ns)


def open_sink(url: str, source: TouchSource) -> Sink:
    try:
        import mcap_ros2.writer  # noqa: F401
    except ImportError:
        raise missing_extra("mcap", "mcap-ros2-support") from None
    return McapSink(new_file(url, source), source)
