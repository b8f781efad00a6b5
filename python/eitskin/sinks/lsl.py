"""``lsl:[NAME][?touches=N]``: a stream of the Lab Streaming Layer, one sample a frame.

Float32 channels: the number of touches, then id, x_mm, y_mm, radius_mm, strength and force_n of the
N strongest (8 where none is named), NaN where there is none.
"""

from __future__ import annotations

import os
from typing import Any
from urllib.parse import quote

from eitskin.errors import SinkError, UsageError, missing_extra
from eitskin.sinks.sink import Sink, Source, Told, or_nan, setting

QUIET = "[log]\nlevel = -2\n"  # no lines of its own but of what goes wrong
FIELDS = ("id", "x_mm", "y_mm", "radius_mm", "strength_s_per_m_mm2", "force_n")
UNITS = {"x_mm": "mm", "y_mm": "mm", "radius_mm": "mm", "force_n": "N"}


class LslSink:
    """An outlet; samples carry LSL's own clock at the time they are sent."""

    def __init__(self, outlet: Any, touches: int) -> None:
        self._outlet, self._touches = outlet, touches

    def write(self, told: Told) -> None:
        if told.frame is None:
            return
        touches = told.message["touches"] or []
        sample = [float(len(touches))]
        for number in range(self._touches):
            one = touches[number] if number < len(touches) else {}
            sample += [or_nan(one.get(name)) for name in FIELDS]
        self._outlet.push_sample(sample)

    def close(self) -> None:
        self._outlet = None  # its destructor says goodbye


def open_sink(url: str, source: Source) -> Sink:
    """See the module.

    Raises:
        UsageError: the address cannot be read.
        MissingExtraError: pylsl or its library is not installed.
        SinkError: the library opens no outlet.
    """
    name, _, query = url.partition(":")[2].partition("?")
    touches = setting(url, query, "touches", 1, 64, 8)
    if "/" in name:
        raise UsageError(f"--to {url}: write  lsl:NAME , the stream's name without slashes")
    try:
        from pylsl import StreamInfo, StreamOutlet, set_config_content
    except (ImportError, RuntimeError, OSError):
        raise missing_extra("lsl", "pylsl with liblsl") from None
    if "LSLAPICFG" not in os.environ:
        set_config_content(QUIET)
    labels = ["touches", *(f"{field}_{k}" for k in range(touches) for field in FIELDS)]
    try:
        info = StreamInfo(
            name or "eitskin", "Touches", len(labels), 0.0, "float32", quote(source.url, safe="")
        )
        channels = info.desc().append_child("channels")
        for label in labels:
            channel = channels.append_child("channel")
            channel.append_child_value("label", label)
            channel.append_child_value("unit", UNITS.get(label.rpartition("_")[0], ""))
        return LslSink(StreamOutlet(info, max_buffered=10), touches)
    except Exception as error:
        raise SinkError(f"--to {url}: liblsl opens no outlet ({error}); try another name") from None
