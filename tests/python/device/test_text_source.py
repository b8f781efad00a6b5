"""Instruments that send lines: from a file, a pipe, a connection and a pseudo-terminal; lines that
are no frames; a port that goes away; sources of packages."""

import os
import pty
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from device_helpers import frames, of

from eitskin.device import source as source_module
from eitskin.device.link import Reconnect
from eitskin.device.open import open_device
from eitskin.device.text_port import FileLines
from eitskin.device.text_source import TextSource
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.codec import LinkCounters
from eitskin.device.wire.link_table import FaultCode, Stream
from eitskin.device.wire.packets import Fault, RawFrame, SolvedTouches
from eitskin.errors import ConfigError, DeviceError, EitskinError, FrameError, UsageError
from eitskin.frames.layout import Layout, load_layout, save_layout
from eitskin.frames.orders import match_rows, source_table
from eitskin.skin.protocol import adjacent
from small_models import prebuilt, small_model

EXAMPLES = Path(__file__).parents[3] / "examples" / "python"
ROTATING = match_rows(adjacent(16).drive_measure, source_table("rotating", adjacent(16))).index
LAYOUT = """
[lines]
cells = 209
columns = "1:209"
time = "0"
time_scale = 0.001
scale = 0.001
[channels]
order = "rotating"
sign = "reversed"
"""


def volts() -> np.ndarray:
    """Untouched frames, then touched ones, (18, 208), in our order."""
    rows = frames(5000).rows(adjacent(16))
    kept = [rows.around(k) for k in range(18)]
    return np.array([v[k - first] for k, (first, v) in enumerate(kept)])


def lines(values: np.ndarray | None = None) -> list[str]:
    """As an instrument would write them: milliseconds, then millivolts in rotating order, V+ and V-
    exchanged."""
    values = volts() if values is None else values
    return [
        ",".join([f"{20 * k}", *(f"{-1e3 * v:.6f}" for v in row[ROTATING])])
        for k, row in enumerate(values)
    ]


@pytest.fixture
def layout(tmp_path) -> Path:
    return layout_file(tmp_path, LAYOUT)


def layout_file(folder: Path, text: str) -> Path:
    (folder / "layout.toml").write_text(text)
    return folder / "layout.toml"


def url_of(folder: Path, layout: Path, text: str | bytes) -> str:
    """The device of these lines."""
    path = folder / "lines.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return f"text:{path}?layout={layout}"


def piped(folder: Path, data: bytes) -> Path:
    """A fifo that someone writes ``data`` to."""
    fifo = folder / "fifo"
    os.mkfifo(fifo)
    threading.Thread(target=fifo.write_bytes, args=(data,), daemon=True).start()
    return fifo


def streamed(url: str, *, tare: int = 8) -> tuple[list[object], LinkCounters]:
    """Return the raw frames and other items of a stream after a tare, and the counters."""
    with open_device(url) as device:
        device.tare(tare)
        return list(device.stream(Stream.RAW)), device.counters


def voltages(items: list[object]) -> np.ndarray:
    return np.array([raw.voltage_v for raw in of(RawFrame, items)])


def test_a_file_of_lines_is_streamed_as_a_board_is(tmp_path, layout):
    with open_device(url_of(tmp_path, layout, "\r\n".join(lines()))) as device:
        assert device.board.board == "text" and device.board.frames_given
        assert device.board.frame_period_us == 20_000
        device.tare(8)
        items = list(device.stream(Stream.RAW | Stream.TOUCHES))
        with pytest.raises(DeviceError, match="its frames are another instrument's"):
            device.scan(samples=40)
    assert np.allclose(voltages(items), volts()[8:], rtol=1e-5, atol=2e-9)
    assert np.diff([one.time_us for one in of(RawFrame, items)]).tolist() == [20_000] * 9
    (touch,) = of(SolvedTouches, items)[-1].touches
    assert np.hypot(touch.x_mm + 40, touch.y_mm - 10) < 3


def test_a_voltage_reaches_the_core_as_it_was_written(tmp_path):
    """No converter stands between: float32 of the line's number, whatever its size."""
    given = volts() * 1e-6
    given[:, 7] = 1.234567e-9
    layout = layout_file(tmp_path, '[lines]\ndelimiter = "space"\n[port]\nrate_hz = 1\n')
    text = "\n".join(" ".join(map(repr, row)) for row in given.tolist())
    items, _ = streamed(url_of(tmp_path, layout, text))
    assert np.array_equal(np.abs(voltages(items)), np.abs(given[8:].astype(np.float32)))


def test_an_offset_is_taken_out_of_a_live_line(tmp_path, layout):
    """A converter that counts from its middle: the layout's offset is in the units of the lines."""
    plain, _ = streamed(url_of(tmp_path, layout, "\n".join(lines())))
    shifted = volts() - 2.048
    layout_file(tmp_path, LAYOUT.replace("scale = 0.001\n[", "scale = 0.001\noffset = -2048\n["))
    moved, _ = streamed(url_of(tmp_path, layout, "\n".join(lines(shifted))))
    assert np.allclose(voltages(moved), voltages(plain), rtol=1e-5, atol=1e-8)


def test_lines_that_are_no_frames_are_counted_told_once_and_skipped(tmp_path, layout):
    good = lines()
    short = [line.rpartition(",")[0] for line in good]
    holes = good[12].split(",")
    holes[3], holes[40], holes[41], holes[42] = "nan", "", "-inf", "7..5"
    bad = ["Board ready", "\xff\xfe\x00 garbage", short[0], short[1], "", "# a comment"]
    text = "\r\n".join([*good[:11], *bad, ",".join(holes), *good[13:]]).encode("latin-1")
    items, counters = streamed(url_of(tmp_path, layout, text))
    events = of(LinkEvent, items)
    assert counters.lines_skipped == 4
    assert [event.kind for event in events] == ["skipped", "skipped"]
    assert "has 1 numbers where 209" in events[0].text
    assert "line 14 has 208 numbers where 209 should be" in events[1].text
    unusable = np.isnan(voltages(items)).sum(axis=1).tolist()
    assert unusable == [0, 0, 0, 4, 0, 0, 0, 0, 0]


def test_a_tare_of_too_few_lines_is_refused_and_does_not_hang(tmp_path, layout):
    with pytest.raises(DeviceError, match="too few frames"):
        streamed(url_of(tmp_path, layout, "\n".join(lines()[:5])), tare=16)


class Board:
    """A board of few lines: writes its lines over and over to a pseudo-terminal, behind ``path``,
    until it is unplugged."""

    def __init__(self, path: Path, text: list[str], *, garbage: bytes = b"") -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        path.unlink(missing_ok=True)
        path.symlink_to(os.ttyname(self._slave))
        self._path, self._stop = path, threading.Event()
        self._data = garbage + "".join(line + "\r\n" for line in text).encode()
        os.set_blocking(self._master, False)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        rest = self._data
        while not self._stop.wait(0.001):
            try:
                rest = rest[os.write(self._master, rest) :] or self._data
            except OSError:
                continue

    def unplug(self) -> None:
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join(5)
        self._path.unlink(missing_ok=True)
        for end in (self._slave, self._master):
            os.close(end)


@pytest.fixture
def boards() -> Iterator[Callable[..., Board]]:
    with ExitStack() as stack:

        def make(*words: object, **more: object) -> Board:
            made = Board(*words, **more)
            stack.callback(made.unplug)
            return made

        yield make


def test_a_board_on_a_port_that_goes_away_and_comes_back(tmp_path, layout, boards):
    port, text = tmp_path / "port", lines()
    first = boards(port, text, garbage=b"\x00\xff half a line,1,2\n")
    url, soon = f"text:{port}?layout={layout}&baud=115200", Reconnect(tries=100, every_s=0.05)
    with open_device(url, reconnect=soon) as device:
        device.tare(1)  # the text is of a scene with touches
        kinds, count = [], 0
        for item in device.stream(Stream.RAW, frames=40):
            if isinstance(item, LinkEvent) and item.kind != "skipped":
                kinds.append(item.kind)
            if isinstance(item, RawFrame):
                count += 1
                assert np.isfinite(item.voltage_v).all()
            if count == 10 and not kinds:
                first.unplug()
                boards(port, text)
        assert kinds == ["unplugged", "reconnected"] and count == 40


def test_a_silent_board_is_a_fault_and_no_hang(tmp_path, layout, monkeypatch):

    monkeypatch.setattr(source_module, "SILENT_S", 0.02)
    monkeypatch.setattr(source_module, "SILENT_PERIODS", 0)
    layout.write_text(LAYOUT + "[port]\nrate_hz = 1000\n")
    fifo, over = tmp_path / "fifo", threading.Event()
    os.mkfifo(fifo)

    def write() -> None:
        with fifo.open("w") as stream:
            stream.write("\n".join([*lines()[:3], ""]))
            stream.flush()
            over.wait(20)

    threading.Thread(target=write, daemon=True).start()
    with open_device(f"text:{fifo}?layout={layout}") as device:
        stream = device.stream(Stream.RAW)
        fault = next(item for item in stream if isinstance(item, Fault))
        assert fault.code == FaultCode.SCAN_STALLED and fault.raised
        stream.close()
        with pytest.raises(DeviceError, match="too few frames"):
            device.tare(8)
    over.set()


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (b"\x80\x81" * 40, "no line is a frame: line 1 has 1 numbers where 209 should be"),
        (b"hello\nhello\n", "no line is a frame: line 1 has 1 numbers where 209 should be"),
        (b"", "nothing came; check the port"),
    ],
    ids=("garbage", "words", "nothing"),
)
def test_nothing_of_use_comes(tmp_path, layout, sent, said):
    fifo, wait_s = piped(tmp_path, sent), 10 if sent else 0.05
    with pytest.raises(DeviceError, match=said) as caught:
        open_device(f"text:{fifo}?layout={layout}&wait={wait_s}")
    assert "\n" not in str(caught.value)


def test_bytes_without_a_line_name_the_baud_rate(tmp_path, layout):
    class Noise(FileLines):
        ended = False

        def read(self, timeout_s: float) -> bytes:
            return b"\x80" * 40

        def __init__(self) -> None:
            self.name = "noise"

    source = TextSource(Noise(), load_layout(layout), "layout")
    with pytest.raises(DeviceError, match="bytes came, but no end of a line; check the baud rate"):
        source.await_frames(1, 0.01)


def test_a_connection_and_a_fifo(tmp_path, layout):
    data = "\n".join([*lines(), ""]).encode()
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = server.accept()
        with connection:
            for _ in range(20):
                try:
                    connection.sendall(data)
                except OSError:
                    return

    threading.Thread(target=serve, daemon=True).start()
    port = server.getsockname()[1]
    with open_device(f"text:socket://127.0.0.1:{port}?layout={layout}") as device:
        assert device.board.tared == 0
    server.close()
    fifo = piped(tmp_path, data)
    items, _ = streamed(f"text:{fifo}?layout={layout}")  # what nobody wanted yet has waited
    assert len(of(RawFrame, items)) == 10
    with pytest.raises(DeviceError, match="no connection"):
        open_device(f"text:socket://127.0.0.1:{port}?layout={layout}")


@pytest.mark.parametrize(
    ("name", "kind", "line"),
    [
        ("openeit_spectra", "opposite", lambda v: "magnitudes: " + "".join(f"{x:.4f}," for x in v)),
        ("eit_kit", "adjacent", lambda v: "framei" + "".join(f"{x:.4f}" for x in v)),
        ("board_of_ten_lines", "adjacent", lambda v: "frame 3: " + ",".join(map(repr, v.tolist()))),
    ],
)
def test_boards_of_others_as_their_sources_print(tmp_path, name, kind, line):
    """A banner, then frames; magnitudes get the model's signs."""
    model = small_model(kind=kind)
    count = model.protocol.n_rows
    given = np.round(np.random.default_rng(1).uniform(0.5, 2.0, (4, count)), 4)
    layout = load_layout(EXAMPLES / f"{name}.toml")
    text = "\r\n".join(["OpenEIT", "mode 3: imaging", *map(line, given), ""])
    path = tmp_path / "lines.txt"
    path.write_text(text, newline="")
    source = TextSource(FileLines(str(path)), layout, name)
    source.use_model(model)
    got = [frame.voltage_v for _ in range(6) for frame in source.read(0.0)]
    scale = layout.options.source.scale or 1.0
    assert np.allclose(np.abs(got), scale * given)
    if layout.options.sign == "magnitude":
        assert np.array_equal(np.sign(got[0]), np.where(model_v(model) < 0, -1, 1))


def model_v(model) -> np.ndarray:
    expected = np.zeros(model.protocol.n_rows)
    expected[model.fold.first] = model.v_ref_v
    second = model.fold.second >= 0
    expected[model.fold.second[second]] = (model.fold.sign * model.v_ref_v)[second]
    return expected


def test_the_example_of_a_source_is_one(monkeypatch):

    monkeypatch.syspath_prepend(EXAMPLES)
    points = [("breathing", "own_source:open_source"), ("broken", "own_source:absent"),
              ("wrong", "builtins:str")]  # fmt: skip

    def found(*, group: str, name: str | None = None) -> list[EntryPoint]:
        assert group == "eitskin.sources"
        return [EntryPoint(key, value, group) for key, value in points if name in (None, key)]

    monkeypatch.setattr(source_module, "entry_points", found)
    with open_device("breathing:500") as device:
        assert (device.board.board, device.board.frame_period_us) == ("breathing", 2000)
        device.tare(8)
        raw = list(device.stream(Stream.RAW, frames=3))
    untouched = prebuilt()[0].golden.reference_v
    assert np.allclose(np.abs(raw[0].voltage_v), np.abs(untouched), rtol=2e-3)
    for url, said in (
        ("breathing:fast", "write frames a second"),
        ("broken:1", "own_source:absent failed"),
        ("wrong:1", "builtins:str gives str; a source gives"),
        ("nowhere:1", "known are|did you mean"),
    ):
        with pytest.raises(UsageError, match=said) as caught:
            open_device(url)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("[lines]\ncolums = 3\n", r"unknown key 'colums'; did you mean 'columns'"),
        ("[lines]\ncells = 0.5\n", "must be a whole number"),
        ('[lines]\ndelimiter = "slash"\n', "use one character or one of comma"),
        ('[lines]\ncells = 208\ncolumns = "1:999"\n', r"columns 1:999: .* there are 0 to 207"),
        ("[lines]\ncells = 200\n", "line 1 has 208 numbers where 200 should be"),
        ('[lines]\ncolumns = "0:200"\ncells = 208\n', "have 200 channels, its protocol 208"),
        ('[lines]\nlabel = "frame"\n', "needs  cells, the numbers of a frame, with a label"),
        ('[channels]\norder = "backwards"\n', "order = 'backwards' is not known"),
        ("[channels]\nswaps = [[1, 2, 3]]\n", "every row must be 2 whole numbers"),
        ("[channels]\nequalise = true\n", "equalise needs a whole file"),
        ("[channels]\nmirror = 1\n", "mirror must be true or false"),
        ("[channels]\ntable = [[0, 1, 2, 99]]\n", "the table names electrodes 0 to 99"),
        ("[channels]\ntable = [[0, 1, 2, 3]]\n", "lack rows of the model's protocol"),
        ('[protocol]\nkind = "opposite"\n', "'electrodes' is required"),
        ("[port]\nrate_hz = 0\n", "out of range"),
        ("lines = 3\n", r"lines must be a table: write \[lines\]"),
    ],
)
def test_a_layout_that_does_not_fit_is_one_line(tmp_path, content, said):
    text = "\n".join(line.partition(",")[2] for line in lines()[:3])
    with pytest.raises((ConfigError, FrameError, UsageError, DeviceError), match=said) as caught:
        open_device(url_of(tmp_path, layout_file(tmp_path, content), text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("text:/dev/ttyACM0", r"write  text:PORT\?layout=FILE"),
        ("text:x.csv?layout=absent.toml", "no such layout"),
        ("text:x.csv?layout={layout}&baud=fast", "baud must be above 0"),
        ("text:x.csv?layout={layout}&speed=2", "'speed=2' after"),
        ("text:absent?layout={layout}", "absent: no such port"),
        ("text:socket://nowhere?layout={layout}", "write  socket://HOST:PORT"),
    ],
)
def test_a_url_that_cannot_be_is_one_line(layout, url, said):
    with pytest.raises(EitskinError, match=said) as caught:
        open_device(url.format(layout=layout))
    assert "\n" not in str(caught.value)


def test_a_layout_comes_back_as_it_was_saved(tmp_path, layout):
    path = tmp_path / "again.toml"
    for given in (load_layout(layout), Layout()):
        save_layout(path, given)
        assert load_layout(path) == given
    for before in map(load_layout, sorted(EXAMPLES.glob("*.toml"))):
        save_layout(path, before)
        again = load_layout(path)
        assert (again.options, again.send, again.baud) == (before.options, before.send, before.baud)


def test_magnitudes_and_phases_are_turned_as_a_board_turns_them(tmp_path):
    """Pairs with a common phase of 40 degrees: the application finds it at the tare."""
    z = volts() * np.exp(1j * np.deg2rad(40.0))
    pairs = np.stack([np.abs(z), np.rad2deg(np.angle(z))], axis=2).reshape(len(z), -1)
    text = '[lines]\ndelimiter = "tab"\ncells = 416\npairs = "magnitude-degrees"\n'
    layout = layout_file(tmp_path, text + 'complex_part = "in-phase"\n')
    content = "\n".join("\t".join(map(repr, row)) for row in pairs.tolist())
    items, _ = streamed(url_of(tmp_path, layout, content))
    assert np.allclose(voltages(items), volts()[8:], rtol=1e-4, atol=1e-7)
