"""``csv:FILE``: write a line per touch. A frame without touches, or a drive without touches with
``--report drive``, gets one line with empty cells. Each line is written completely as it arrives,
so that a killed program leaves a readable file."""

import csv
from io import StringIO
from pathlib import Path
from typing import Any

from eitskin.device.recordings.new_file import RecordingFile, WaitingFile
from eitskin.errors import FileError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.sinks.sink import OutgoingMessage, Sink, TouchSource

TOUCH = (
    "id", "x_mm", "y_mm", "radius_mm", "strength_s_per_m_mm2", "force_n", "confidence",
    "x_variance_mm2", "xy_covariance_mm2", "y_variance_mm2", "long_x_mm", "long_y_mm",
    "radius_sd_mm",
)  # fmt: skip
HEAD = ("frame", "time_s", "time_unix_s")
DRIVE = (
    "drive",
    "vx_mm_per_s",
    "vy_mm_per_s",
    "confirmed",
)  # empty in the lines of frames
PLACE = {
    "position_m": ("position_x_m", "position_y_m", "position_z_m"),
    "normal": ("normal_x", "normal_y", "normal_z"),
}  # in the frame ``link``; empty for a flat skin that no robot file places
COLUMNS = (
    *(*HEAD, *TOUCH, "found", "refused", "events", *DRIVE, "source", "link"),
    *PLACE["position_m"],
    *PLACE["normal"],
)


class CsvSink:
    """An open CSV file, written to after each frame."""

    def __init__(self, file: WaitingFile) -> None:
        self._file = file

    def write(self, outgoing: OutgoingMessage) -> None:
        message = outgoing.message
        if message["type"] not in ("frame", "report"):
            return
        shared = {name: message.get(name) for name in (*HEAD, "drive", "refused", "source", "link")}
        if message["type"] == "frame":
            shared["found"] = "; ".join(message["found"])
            shared["events"] = " ".join(event["kind"] for event in message["events"])
        lines = [shared | _with_place(touch) for touch in message["touches"] or [{}]]
        self._file.write(_text([[line.get(name) for name in COLUMNS] for line in lines]))
        self._file.sync_now_and_then()
        self._file.check()

    def close(self) -> None:
        self._file.close()


def _with_place(touch: dict[str, Any]) -> dict[str, Any]:
    """Return ``touch`` with its place in the link's frame in a cell per number."""
    place: dict[str, float] = {}
    for name, columns in PLACE.items():
        place |= dict(zip(columns, touch.get(name, ()), strict=False))
    return touch | place


def _text(rows: list[Any]) -> bytes:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def new_file(url: str, source: TouchSource, first: bytes = b"") -> WaitingFile:
    """Return a new file for a URL such as ``csv:FILE``, with ``first`` written to it.

    Raises:
        UsageError: the URL names no file.
        FileError: the file exists and may not be overwritten, or cannot be written.
    """
    scheme, _, name = url.partition(":")
    if not name:
        raise UsageError(f"--to {url}: name a file, as in  {scheme}:touches.{scheme}")
    path = Path(name)
    refuse_unwritable(path)
    if path.exists() and not source.overwrite:
        raise FileError(
            f"{path}: exists already; name another file, or overwrite it with  --overwrite"
        )
    return WaitingFile(RecordingFile(path, first, overwrite=source.overwrite))


def open_sink(url: str, source: TouchSource) -> Sink:
    return CsvSink(new_file(url, source, _text([COLUMNS])))
