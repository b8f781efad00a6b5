"""``foxglove:[//HOST[:8765]]``: start a live server that the Foxglove application connects to.

/touches carries the message of docs/reference/message.md with its schema, /notices the notices,
/reports the touches after drives if those are reported, and /image a foxglove.RawImage if images
are streamed.
"""

import json
from typing import Any

import numpy as np

from eitskin.errors import SinkError, missing_extra
from eitskin.session.message import schema
from eitskin.sinks.ros2_topics import frame_id, topics_of
from eitskin.sinks.sink import OfSkin, OutgoingMessage, Sink, TouchSource, address, nothing_more

USAGE = "foxglove: or foxglove://HOST:PORT"
PORT = 8765
BACKLOG = 128  # messages kept for a client that does not read; the oldest are dropped
TOPICS = {"frame": "/touches", "report": "/reports", "notice": "/notices"}


class _Channels:
    """The channels of a skin."""

    def __init__(self, source: TouchSource, context: Any) -> None:
        import foxglove
        from foxglove.channels import RawImageChannel

        self.frame_id, self.model = frame_id(source), source.model
        described = schema()
        defined = {"$defs": described["$defs"]}
        self.of: dict[str, Any] = {
            name: foxglove.Channel(
                topics_of(source) + topic,
                schema={"title": f"eitskin.{name}", **described["$defs"][name], **defined},
                message_encoding="json",
                context=context,
            )
            for name, topic in TOPICS.items()
        }
        self.pictures = RawImageChannel(topics_of(source) + "/image", context=context)


class FoxgloveSink:
    """A server of the Foxglove SDK with its own channels.

    Raises:
        MissingExtraError: foxglove-sdk is not installed.
        RuntimeError, OSError: it cannot listen.
    """

    def __init__(self, host: str, port: int, source: TouchSource) -> None:
        try:
            import foxglove
            from foxglove.messages import RawImage, Timestamp
        except ImportError:
            raise missing_extra("foxglove", "foxglove-sdk") from None
        self._image, self._time = RawImage, Timestamp
        self._context = context = foxglove.Context()  # closing it closes its channels
        self._skins = OfSkin(source, lambda one: _Channels(one, context))
        self._server = foxglove.start_server(
            name=f"eitskin {source.name or source.url}",
            host=host,
            port=port,
            context=context,
            message_backlog_size=BACKLOG,
        )

    @property
    def port(self) -> int:
        return int(self._server.port)

    def write(self, outgoing: OutgoingMessage) -> None:
        skin = self._skins.of(outgoing.message)
        channel = None if skin is None else skin.of.get(outgoing.message["type"])
        if skin is None or channel is None:
            return
        now = outgoing.time_ns
        channel.log(json.dumps(outgoing.message).encode(), log_time=now)
        if (
            outgoing.frame is not None
            and outgoing.frame.image is not None
            and skin.model is not None
        ):
            picture = np.nan_to_num(skin.model.grid.image(outgoing.frame.image)[::-1])
            height, width = picture.shape
            skin.pictures.log(
                self._image(
                    timestamp=self._time(now // 10**9, now % 10**9),
                    frame_id=skin.frame_id,
                    width=width,
                    height=height,
                    encoding="32FC1",
                    step=4 * width,
                    data=picture.astype("<f4").tobytes(),
                ),
                log_time=now,
            )

    def close(self) -> None:
        self._server.stop()


def open_sink(url: str, source: TouchSource) -> Sink:
    """Open the sink of the module's docstring."""
    named = "foxglove://" if url == "foxglove:" else url
    parts, host, port = address(named, PORT, usage=USAGE)
    nothing_more(url, parts, USAGE)
    try:
        return FoxgloveSink(host, port, source)
    except (RuntimeError, OSError) as error:
        raise SinkError(
            f"--to {url}: cannot listen there ({error}); name another port, or end the program"
            " that has it"
        ) from None
