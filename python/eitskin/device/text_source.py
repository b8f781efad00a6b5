"""``text:PORT?layout=FILE``: an instrument that sends its frames as lines of text."""

import time
from collections import Counter, deque
from contextlib import suppress
from urllib.parse import unquote

from eitskin.config import plain_number
from eitskin.device.source import MAX_GAP_S, GivenFrame, Source, SourceTransport
from eitskin.device.text_port import LinePort, open_port
from eitskin.device.transport import LinkEvent
from eitskin.errors import DeviceError, FrameError, UsageError
from eitskin.frames.layout import BadLine, Layout, LineFrame, LineParser, has_number, load_layout
from eitskin.frames.lines import LineReader, Row
from eitskin.frames.placement import RowPlacement, place
from eitskin.model.model import Model

BAUD = 115_200
MAX_BAUD = 20_000_000
WAIT_S, MAX_WAIT_S = 10.0, 600.0  # for the first two frames
MAX_LINE = 1 << 20
MAX_UNDECIDED = 16  # lines until one length is taken, although no two are as long
MAX_REPORTED = 8  # kinds of bad lines
HELP = "text:PORT?layout=FILE&baud=115200"


class TextSource(Source):
    """Frames out of lines. ``name`` is the port's.

    Lines that are not frames are skipped and counted; the first of each kind is reported.
    """

    def __init__(self, port: LinePort, layout: Layout, where: str) -> None:
        self._port, self._where = port, where
        self._parser = LineParser(layout)
        if self._parser.cells is None and layout.form.label is not None:
            raise UsageError(f"{where}: [lines] needs  cells, the numbers of a frame, with a label")
        self._layout, self._form = layout, layout.form
        numbers = layout.options.source
        self.offset, self.scale = numbers.offset, 1.0 if numbers.scale is None else numbers.scale
        self._reader = LineReader(self._form, self._parser.cells)
        self._placement: RowPlacement | None = None
        self._rest, self._lines = b"", 0
        self._cut = port.cut
        self._parsed: deque[tuple[LineFrame, float]] = deque()  # and when it came
        self._undecided: list[Row] = []
        self._events: list[LinkEvent] = []
        self._reported: set[str] = set()
        self._first_bad = ""
        self._drained = False
        headed = layout.options.source.header_rows or 0
        self._header = 0 if port.waits else headed  # rows of it that are still to come
        self.synchronous, self.keeps = not port.waits, port.keeps
        rate_hz = layout.rate_hz
        self.period_s = None if rate_hz is None else 1 / rate_hz
        if layout.send is not None:
            port.send(layout.send.encode())

    @property
    def name(self) -> str:  # type: ignore[override]
        return self._port.name

    @property
    def ended(self) -> bool:  # type: ignore[override]
        return self._drained and not self._parsed

    def use_model(self, model: Model) -> None:
        self._placement = place(self._layout.options, self._layout.protocol, model, self._where)
        channels = self._parser.channels
        if channels is not None and channels != self._placement.channels:
            raise FrameError(
                f"{self._where}: its lines have {channels} channels, its protocol"
                f" {self._placement.channels}; repair columns, order or protocol"
            )

    def read(self, timeout_s: float) -> list[GivenFrame]:
        placement = self._placement
        assert placement is not None
        if not self._parsed:
            self._take(timeout_s)
        found: list[GivenFrame] = []
        while self._parsed and not (self.keeps and found):
            line, came_s = self._parsed.popleft()
            if len(line.values) != placement.channels:
                self._skip(
                    "channels",
                    f"a line has {len(line.values)} channels where {placement.channels} should be",
                )
                continue
            found.append(GivenFrame(placement.frame(line.values), line.time_s, came_s))
        return found

    def await_frames(self, count: int, wait_s: float) -> None:
        """Wait until ``count`` frames have come; they are passed on later."""
        end = time.monotonic() + wait_s
        came = 0
        while len(self._parsed) < count and not self._drained:
            rest = end - time.monotonic()
            if rest <= 0:
                break
            came += self._take(min(rest, 0.1))
        if self._parsed:
            self._find_period()
            return
        if not came:
            reason = (
                "nothing came; check the port, and whether the instrument sends by itself (else"
                " name what starts it as  send  in the layout)"
            )
        elif not self._lines:
            reason = f"{came} bytes came, but no end of a line; check the baud rate"
        else:
            first = self._first_bad or "lines came, but none with the layout's label"
            reason = f"no line is a frame: {first}; repair the layout {self._where}"
        waited = "" if self._drained else f" ({wait_s:g} s waited)"
        raise DeviceError(f"{self.name}: {reason}{waited}")

    def _find_period(self) -> None:
        """Take a file's frame period from the times of its first two frames."""
        if self.period_s is not None or not self.synchronous or len(self._parsed) < 2:
            return
        first, second = (line.time_s for line, _ in (self._parsed[0], self._parsed[1]))
        if first is not None and second is not None and 0 < second - first < MAX_GAP_S:
            self.period_s = second - first

    def take_events(self) -> list[LinkEvent]:
        events, self._events = self._events, []
        return events

    def reopen(self) -> bool:
        if not self._port.reopen():
            return False
        self._rest, self._cut = b"", self._port.cut
        self._reader = LineReader(self._form, self._parser.cells)
        if self._layout.send is not None:
            self._port.send(self._layout.send.encode())
        return True

    def close(self) -> None:
        self._port.close()

    def _take(self, timeout_s: float) -> int:
        """Read once; returns how many bytes came."""
        data = self._port.read(timeout_s)
        self._rest += data
        lines = self._rest.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        if self._rest.endswith(b"\r"):
            lines[-2:] = [lines[-2] + b"\r"]  # its line feed may come yet
        self._rest = lines.pop()
        for line in lines:
            self._line(line)
        if len(self._rest) > MAX_LINE:
            self._rest = b""
            self._skip("long", f"{MAX_LINE} bytes without the end of a line")
        if self._port.ended and not self._drained:
            if self._rest:
                self._line(self._rest)
            self._rows(self._reader.finish())
            self._drained = True
        return len(data)

    def _line(self, line: bytes) -> None:
        self._lines += 1
        if self._cut:
            self._cut = False
            return
        if self._lines == 1:
            line = line.removeprefix(b"\xef\xbb\xbf")
        before = self._reader.passed_over
        self._rows(self._reader.feed(self._lines, line.decode("latin-1")))
        if self._reader.passed_over > before:
            self._skip("", "")

    def _rows(self, rows: list[Row]) -> None:
        if self._parser.cells is None:
            rows = self._decided(rows)
        for row in rows:
            if self._header:
                self._header -= 1
                continue
            try:
                self._parsed.append((self._parser.frame(row), time.monotonic()))
            except BadLine as error:
                self._skip(str(len(row.cells)), str(error))
            except UsageError as error:
                raise UsageError(f"{self._where}: {error}") from None

    def _decided(self, rows: list[Row]) -> list[Row]:
        """Decide the length of a line if the layout does not state it: the length that two lines
        have, so that a first line that was cut is skipped. Return the rows so far, once the length
        is known."""
        self._undecided += rows
        lengths = Counter(
            len(row.cells) for row in self._undecided[self._header :] if has_number(row)
        )
        common, times = next(iter(lengths.most_common(1)), (0, 0))
        if times < 2 and not self._port.ended and len(self._undecided) < MAX_UNDECIDED:
            return []
        found, self._undecided = self._undecided, []
        with suppress(BadLine):  # each line says so
            if common:
                self._parser.choose(common)
        return found

    def _skip(self, kind: str, text: str) -> None:
        """Count a line; the first of a ``kind`` is reported."""
        new = bool(text) and kind not in self._reported and len(self._reported) < MAX_REPORTED
        if new:
            self._reported.add(kind)
            self._first_bad = self._first_bad or text
        line = f"{text}; others like it are only counted" if new else ""
        self._events.append(LinkEvent("skipped", 1, line))


def open_text(url: str, *, model: bytes | None = None) -> SourceTransport:
    """The instrument behind ``url``, "text:PORT?layout=FILE&baud=115200&wait=10".

    Raises:
        UsageError: the URL cannot be read, or the layout's columns cannot be.
        DeviceError: the port cannot be opened, or no frames come from it.
        FileError, ConfigError, ProtocolError, FrameError: of the layout.
    """
    rest = url.partition(":")[2]
    path, asks, query = rest.rpartition("?")
    named: dict[str, str] = {}
    for pair in query.split("&") if asks else ():
        key, mark, value = pair.partition("=")
        if key not in ("layout", "baud", "wait") or not mark or not value or key in named:
            raise UsageError(f"device {url!r}: {pair!r} after '?'; write  {HELP}")
        named[key] = unquote(value)
    if not path or "layout" not in named:
        raise UsageError(f"device {url!r}: write  {HELP} ; eitskin import --save-layout makes one")
    layout = load_layout(named["layout"])
    baud = int(_number(url, "baud", named.get("baud", layout.baud or BAUD), MAX_BAUD))
    wait_s = _number(url, "wait", named.get("wait", WAIT_S), MAX_WAIT_S)
    port = open_port(unquote(path), baud)
    try:
        source = TextSource(port, layout, named["layout"])
        source.await_frames(2, wait_s)
        transport = SourceTransport(url, source, model)
        transport.begin()
        return transport
    except BaseException:
        port.close()
        raise


def _number(url: str, key: str, given: object, high: float) -> float:
    try:
        value = plain_number(str(given))
    except ValueError:
        value = 0.0
    if not 0 < value <= high:
        raise UsageError(f"device {url!r}: {key} must be above 0 and at most {high:g}")
    return value
