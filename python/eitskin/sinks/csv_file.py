"""``csv:FILE``: a line a touch, and one with empty cells for a frame, or of ``--report drive`` a
drive, without touches. Each line is written whole as it comes, so that a killed program leaves a
readable file."""

from __future__ import annotations

import csv
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

from eitskin.errors import FileError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.sinks.sink import Sink, Source, Told

TOUCH = (
    "id", "x_mm", "y_mm", "radius_mm", "strength_s_per_m_mm2", "force_n", "confidence",
    "x_variance_mm2", "xy_covariance_mm2", "y_variance_mm2", "long_x_mm", "long_y_mm",
)  # fmt: skip
HEAD = ("frame", "time_s", "time_unix_s")
DRIVE = ("drive", "vx_mm_per_s", "vy_mm_per_s", "confirmed")  # of a drive; empty in frames' lines
COLUMNS = (*HEAD, *TOUCH, "found", "refused", "events", *DRIVE)


class CsvSink:
    """One open file, flushed after each frame."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self._put([COLUMNS])

    def write(self, told: Told) -> None:
        message = told.message
        if message["type"] not in ("frame", "report"):
            return
        shared = {name: message.get(name) for name in (*HEAD, "drive", "refused")}
        if message["type"] == "frame":
            shared["found"] = "; ".join(message["found"])
            shared["events"] = " ".join(event["kind"] for event in message["events"])
        lines = [shared | touch for touch in message["touches"] or [{}]]
        self._put([[line.get(name) for name in COLUMNS] for line in lines])

    def close(self) -> None:
        self._stream.close()

    def _put(self, rows: list[Any]) -> None:
        text = StringIO()
        csv.writer(text, lineterminator="\n").writerows(rows)
        self._stream.write(text.getvalue().encode())
        self._stream.flush()


def new_file(url: str, source: Source) -> Any:
    """The file that ``csv:FILE`` and the like name, open for writing.

    Raises:
        UsageError: it names none.
        FileError: it exists already, or cannot be written.
    """
    scheme, _, name = url.partition(":")
    if not name:
        raise UsageError(f"--to {url}: name a file, as in  {scheme}:touches.{scheme}")
    path = Path(name)
    refuse_unwritable(path)
    try:
        return path.open("wb" if source.overwrite else "xb")
    except FileExistsError:
        raise FileError(
            f"{path}: exists already; name another file, or write over it with  --overwrite"
        ) from None
    except OSError as error:
        raise FileError(f"{path}: cannot write it ({error.strerror})") from None


def open_sink(url: str, source: Source) -> Sink:
    """See the module. Raises as ``new_file``."""
    stream = new_file(url, source)
    try:
        return CsvSink(stream)
    except OSError as error:
        with suppress(OSError):
            stream.close()
        raise FileError(f"--to {url}: cannot write it ({error.strerror})") from None
