"""Read files as instruments for medical and laboratory EIT write them.

- Sciospec ``.eit`` (text): a header whose first line is its number of lines, then for every drive a
  line with its two electrodes and, for each frequency, a line with the real and imaginary parts of
  the potential of every channel against ground. One frame per file.
- Goe-MF II (Viasys) ``.get``: frames of 256 float32, of which the first 208 are voltages of 16
  electrodes, adjacent, rotating. Draeger's ``.get`` before 2006 is the same below a text header.
- Draeger PulmoVista ``.eit``: a text header, then frames of 600 float64, from which the voltages
  are computed with two factors that EIDORS estimated.
- Carefusion ``.eit``: an XML header in UTF-16, then frames of 262 float32.

The formats are those that EIDORS and pyEIT read.
"""

import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from eitskin.arrays import AnyArray, FloatArray, IntArray
from eitskin.errors import FrameError
from eitskin.fileio import read_bytes
from eitskin.frames.orders import GROUND, source_table
from eitskin.skin.protocol import adjacent

MAX_BYTES = 1_000_000_000
RECORD, VOLTAGES = 256, 208  # float32 in a frame of Goe-MF, and how many are voltages
CAREFUSION_RECORD, CAREFUSION_FIRST = 262, 36
DRAEGER_BYTES = {31: 4112, 32: 3200, 51: 5495}  # in a frame, by the format in the header
DRAEGER_SECOND = 322  # where the second 208 numbers of a frame begin
DRAEGER_FACTORS = (0.00098242, 0.00019607)
SCIOSPEC_HEADERS = {9: 2, 11: 3, 18: 3}  # its lines, and the line (from 1) of the name


@dataclass(frozen=True, eq=False)
class InstrumentFile:
    """The frames (n, rows) of a file, real or complex, and the ``table`` (rows, 4) of its rows;
    V- is GROUND for potentials. ``time_s`` (n,) and ``current_a`` are given if the file has them;
    ``in_volts`` says whether its numbers are volts."""

    voltage: AnyArray
    table: IntArray
    notes: tuple[str, ...] = ()
    time_s: FloatArray | None = None
    current_a: float | None = None
    in_volts: bool = False


def read_instrument_file(path: Path) -> InstrumentFile:
    """Read ``path``, an .eit or .get file.

    Raises:
        FileError: it cannot be read.
        FrameError: it is not of a known instrument, or it is damaged.
    """
    content = read_bytes(path, "file of an instrument", MAX_BYTES)
    if path.suffix.lower() == ".get":
        return _goe_mf(content, str(path))
    if content[:2] == b"\xff\xfe":
        return _carefusion(content, str(path))
    if b"Framerate [Hz]" in content[:8192] or b"Draeger" in content[:256]:
        return _draeger(content, str(path))
    return _sciospec(content, str(path))


def _goe_mf(content: bytes, where: str) -> InstrumentFile:
    if content.startswith(b"---Draeger EIT-Software---"):
        end = re.search(rb"\n\r?\n\r?\n", content)
        if end is None:
            raise FrameError(f"{where}: Draeger's header has no end; the file is damaged")
        content = content[end.end() :]
    values = _records(content, "<f4", 4 * RECORD, where)[:, :VOLTAGES]
    return InstrumentFile(values, _rotating())


def _carefusion(content: bytes, where: str) -> InstrumentFile:
    stated = re.search(
        r"<Header>(\d+) bytes</Header>", content[2:4096].decode("utf-16-le", "replace")
    )
    if stated is None:
        raise FrameError(f"{where}: not a Carefusion file: its header does not state its length")
    rest = content[int(stated[1]) :]
    values = _records(rest, "<f4", 4 * CAREFUSION_RECORD, where)
    return InstrumentFile(values[:, CAREFUSION_FIRST : CAREFUSION_FIRST + VOLTAGES], _rotating())


def _draeger(content: bytes, where: str) -> InstrumentFile:
    stated = re.search(rb"Format:\s*(\d+)", content[:8192])
    kind = 51 if stated is None else int(stated[1])
    if kind not in DRAEGER_BYTES or len(content) < 16:
        known = ", ".join(map(str, DRAEGER_BYTES))
        raise FrameError(f"{where}: Draeger's format {kind} is not known; known are {known}")
    size = DRAEGER_BYTES[kind]
    rest = content[int.from_bytes(content[4:6], "little") + 16 :]
    if size < 8 * (DRAEGER_SECOND + VOLTAGES):
        raise FrameError(f"{where}: Draeger's format {kind} holds no voltages; export format 51")
    values = _records(rest, "<f8", size, where, DRAEGER_SECOND + VOLTAGES)
    first, second = values[:, :VOLTAGES], values[:, DRAEGER_SECOND:]
    rate = re.search(rb"Framerate \[Hz\]:\s*([\d.]+)", content[:8192])
    time_s = None if rate is None or not float(rate[1]) else np.arange(len(values)) / float(rate[1])
    volts = DRAEGER_FACTORS[0] * first - DRAEGER_FACTORS[1] * second
    return InstrumentFile(volts, _rotating(), time_s=time_s)


def _records(
    content: bytes, kind: str, size: int, where: str, count: int | None = None
) -> FloatArray:
    """Return the numbers of all whole records of ``size`` bytes, (n, ``count``)."""
    n, width = len(content) // size, np.dtype(kind).itemsize
    if not n:
        raise FrameError(f"{where}: {len(content)} bytes are no frame of {size}; the file is cut")
    count = size // width if count is None else count
    raw = np.frombuffer(content[: n * size], dtype=np.uint8).reshape(n, size)[:, : count * width]
    return np.ascontiguousarray(raw).view(kind).astype(np.float64)


def _rotating() -> IntArray:
    return source_table("rotating", adjacent(16))


def _sciospec(content: bytes, where: str) -> InstrumentFile:
    lines = [line.strip() for line in content.decode("latin-1").splitlines()]
    size = int(lines[0]) if lines and lines[0].isdecimal() else 0
    if size not in SCIOSPEC_HEADERS or len(lines) <= size:
        raise FrameError(
            f"{where}: not a file of Sciospec (whose first line is the number of header lines),"
            " Draeger or Carefusion"
        )
    head = lines[SCIOSPEC_HEADERS[size] - 1 : size]  # from the name on
    body = [line for line in lines[size:] if line]
    try:
        frequencies, current_a = int(float(head[5])), float(head[6])
    except (ValueError, IndexError):
        raise FrameError(f"{where}: the header of Sciospec's file is damaged") from None
    step = 1 + frequencies
    if frequencies < 1 or not body or len(body) % step:
        raise FrameError(
            f"{where}: {len(body)} lines after the header are no drives with {frequencies}"
            " frequencies each; the file is cut"
        )
    channels = _channels(head)
    rows: list[tuple[int, int, int, int]] = []
    values: list[complex] = []
    for k in range(0, len(body), step):
        drive = _whole_numbers(body[k])
        numbers = _numbers(body[k + 1], where)
        potentials = numbers[0::2] + 1j * numbers[1::2]
        if len(drive) != 2 or min(drive) < 1 or len(potentials) < 2:
            raise FrameError(f"{where}: line {size + 1 + k}: no drive of two electrodes; damaged")
        for channel, potential in zip(
            channels or range(1, 1 + len(potentials)), potentials, strict=False
        ):
            rows.append((drive[0] - 1, drive[1] - 1, channel - 1, GROUND))
            values.append(complex(potential))
    table = np.array(rows, dtype=np.int64)
    used = table[:, 2] <= table[:, :2].max()  # the other channels have no electrode
    notes: tuple[str, ...] = ()
    if frequencies > 1:
        notes = (f"of {frequencies} frequencies the first, {head[2]} Hz, is taken",)
    return InstrumentFile(
        np.array(values)[None, used], table[used], notes, _time_of(head[1]), current_a, True
    )


def _channels(head: list[str]) -> list[int]:
    for line in head:
        if line.startswith("MeasurementChannels:"):
            return _whole_numbers(line.partition(":")[2])
    return []


def _whole_numbers(text: str) -> list[int]:
    return [int(word) for word in re.findall(r"\d+", text)]


def _numbers(line: str, where: str) -> FloatArray:
    try:
        values = np.array([float(word) for word in re.split(r"[\s,;]+", line)])
    except ValueError:
        raise FrameError(f"{where}: {line[:40]!r} ... is not a line of numbers; damaged") from None
    if len(values) % 2:
        raise FrameError(f"{where}: a line has {len(values)} numbers, which form no pairs; cut")
    return values


def _time_of(text: str) -> FloatArray | None:
    """Return the time of recording in s."""
    for form in ("%Y.%m.%d. %H:%M:%S.%f", "%Y.%m.%d. %H:%M:%S", "%Y.%m.%d %H:%M:%S.%f"):
        try:
            return np.array(
                [(datetime.strptime(text, form) - datetime(1970, 1, 1)).total_seconds()]
            )
        except ValueError:
            pass
    return None
