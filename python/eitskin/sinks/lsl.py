"""``lsl:[NAME][?touches=N]``: publish a stream of the Lab Streaming Layer with one sample per
frame.

The float32 channels are the number of touches, then id, x_mm, y_mm, radius_mm, strength, force_n,
confirmed and the covariance of the place (x_variance_mm2, xy_covariance_mm2, y_variance_mm2) of the
N strongest touches (8 by default), NaN for missing ones. With ``--report drive`` a second stream,
NAME-drives, starts at the first report. Its double64 channels are time_s and the number of touches,
then id, confirmed, x_mm, y_mm, vx_mm_per_s, vy_mm_per_s, strength and the covariance of each. Both
streams are irregular.
"""

import os
from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

from eitskin.errors import SinkError, UsageError, missing_extra
from eitskin.sinks.sink import OutgoingMessage, Sink, TouchSource, or_nan, setting

QUIET = "[log]\nlevel = -2\n"  # liblsl prints errors only
COVARIANCE = ("x_variance_mm2", "xy_covariance_mm2", "y_variance_mm2")
FIELDS = (
    "id", "x_mm", "y_mm", "radius_mm", "strength_s_per_m_mm2", "force_n", "confirmed", *COVARIANCE,
)  # fmt: skip
MOVING = (
    "id", "confirmed", "x_mm", "y_mm", "vx_mm_per_s", "vy_mm_per_s", "strength_s_per_m_mm2",
    *COVARIANCE,
)  # fmt: skip
UNITS = {
    "time_s": "s", "x_mm": "mm", "y_mm": "mm", "radius_mm": "mm", "force_n": "N",
    "vx_mm_per_s": "mm/s", "vy_mm_per_s": "mm/s",
}  # fmt: skip


class LslSink:
    """An outlet of frames, and one of drives if they are reported. Samples carry LSL's own clock at
    the time they are sent.

    Raises:
        RuntimeError: liblsl cannot open an outlet.
    """

    def __init__(self, name: str, source: TouchSource, touches: int) -> None:
        self._name, self._touches = name, touches
        self._unique = quote(source.url, safe="")
        self._frames = self._outlet(name, ["touches"], FIELDS, "float32")
        self._drives: Any = None

    def write(self, outgoing: OutgoingMessage) -> None:
        if outgoing.frame is not None:
            self._push(self._frames, [], outgoing.message["touches"] or [], FIELDS)
        elif outgoing.report is not None:
            if self._drives is None:
                name, first = f"{self._name}-drives", ["time_s", "touches"]
                self._drives = self._outlet(name, first, MOVING, "double64")
            message = outgoing.message
            self._push(self._drives, [message["time_s"]], message["touches"], MOVING)

    def close(self) -> None:
        self._frames = self._drives = None  # their destructors close the streams

    def _outlet(self, name: str, first: list[str], fields: Sequence[str], kind: str) -> Any:
        from pylsl import StreamInfo, StreamOutlet

        labels = [*first, *(f"{field}_{k}" for k in range(self._touches) for field in fields)]
        unique = self._unique + name.removeprefix(self._name)
        info = StreamInfo(name, "Touches", len(labels), 0.0, kind, unique)
        channels = info.desc().append_child("channels")
        for label in labels:
            channel = channels.append_child("channel")
            channel.append_child_value("label", label)
            unit = UNITS.get(label) or UNITS.get(label.rpartition("_")[0], "")
            channel.append_child_value("unit", unit)
        return StreamOutlet(info, max_buffered=10)

    def _push(
        self, outlet: Any, first: list[float], touches: list[Any], fields: Sequence[str]
    ) -> None:
        sample = [*first, float(len(touches))]
        for number in range(self._touches):
            one = touches[number] if number < len(touches) else {}
            sample += [or_nan(one.get(name)) for name in fields]
        outlet.push_sample(sample)


def open_sink(url: str, source: TouchSource) -> Sink:
    name, _, query = url.partition(":")[2].partition("?")
    touches = setting(url, query, "touches", 1, 64, 8)
    if "/" in name:
        raise UsageError(f"--to {url}: write  lsl:NAME  with a name without slashes")
    try:
        from pylsl import set_config_content
    except (ImportError, RuntimeError, OSError):
        raise missing_extra("lsl", "pylsl with liblsl") from None
    if "LSLAPICFG" not in os.environ:
        set_config_content(QUIET)
    try:
        return LslSink(name or source.name or "eitskin", source, touches)
    except Exception as error:
        raise SinkError(
            f"--to {url}: liblsl opened no outlet ({error}); try another name"
        ) from None
