"""``mcap:FILE``: record ROS 2 messages (CDR) for ROS, Foxglove and similar programs.

The topics are those of ``ros2_topics``: /touches, /reports if ``--report drive`` is set, /contacts,
/poses and /markers in metres, /image if images are streamed, and /diagnostics when the diagnostics
change. The file is written in chunks of about a second, and a killed program loses the last chunk.
The list of chunks stays in memory until the end. If the source has a name, topics begin with it
(/NAME/touches), and it is the frame of reference.
"""

from typing import Any

from eitskin.errors import missing_extra
from eitskin.sinks.csv_file import new_file
from eitskin.sinks.ros2_topics import RosTopics, definitions
from eitskin.sinks.sink import OutgoingMessage, Sink, TouchSource

CHUNK_BYTES, REPORTS_BYTES, IMAGES_BYTES = 1 << 14, 1 << 16, 1 << 18  # about a second of each


class McapSink:
    """An open MCAP file."""

    def __init__(self, stream: Any, source: TouchSource) -> None:
        self._stream, self._topics = stream, RosTopics(source)
        self._writer: Any = None
        self._types: dict[str, Any] = {}

    def write(self, outgoing: OutgoingMessage) -> None:
        message = outgoing.message
        if message["type"] == "summary":
            return
        if self._writer is None:
            images = outgoing.frame is not None and outgoing.frame.image is not None
            self._begin(
                IMAGES_BYTES if images else REPORTS_BYTES if outgoing.report else CHUNK_BYTES
            )
        for topic, kind, table in self._topics.of(outgoing):
            now = outgoing.time_ns
            self._writer.write_message(topic, self._types[kind], table, now, now)
        if outgoing.report is not None:
            return
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
            name: self._writer.register_msgdef(name, text) for name, text in definitions().items()
        }


def open_sink(url: str, source: TouchSource) -> Sink:
    try:
        import mcap_ros2.writer  # noqa: F401
    except ImportError:
        raise missing_extra("mcap", "mcap-ros2-support") from None
    return McapSink(new_file(url, source), source)
