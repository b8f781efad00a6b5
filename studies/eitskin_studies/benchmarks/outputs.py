"""The time from a contact to the packet that reports it, split by its parts; and whether
six sinks at once get every frame of a skin that streams for minutes.

Scan, solve and link are an emulated board's: a scene taps the skin at random moments, at 500
samples a second, so that a contact in the middle of a scan shows as it would. The link is what the
packet takes at the port's rate. Host is what this machine takes from bytes to a frame, sink from
the frame to another process that has read it; both by the clock of this machine.
"""

import json
import multiprocessing
import os
import resource
import socket
import tempfile
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.device.ports import BAUD
from eitskin.device.wire.codec import Packet, encode
from eitskin.device.wire.link_table import PacketType, Stream
from eitskin.session.frame import Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.sinks.outputs import Outputs
from eitskin.sinks.sink import TouchSource
from eitskin.truth import observe_scene
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sections import Filling, Tabular

RATE_HZ = 48.0
SCENE_HZ = 500.0  # of the emulated board's scene
APART_S = 0.35  # from tap to tap, at least
HELD_S = 0.12
DRAWS = 20_000
BITS_A_BYTE = 10  # start, eight, stop
SINKS = ("udp", "ws", "osc", "tuio", "csv", "mcap")
HEAD = ("part", "median ms", "p99 ms")
LOAD_HEAD = ("sink", "sent", "dropped", "failed")


@dataclass(frozen=True)
class Load:
    """``seconds`` with all sinks: frames, what each counted, memory in MB after a tenth of the time
    and at the end, and the share of one processor."""

    seconds: float
    frames: int
    sinks: list[dict[str, Any]]
    early_mb: float
    late_mb: float
    processor_share: float


@dataclass(frozen=True)
class OutputTimes:
    """Milliseconds, (median, p99), by part; ``taps`` contacts that were found of ``tapped``."""

    parts_ms: dict[str, tuple[float, float]]
    taps: int
    tapped: int
    sunk: int
    load: Load | None
    machine: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def run(taps: int, seconds: float, load_s: float, seed: int) -> OutputTimes:
    """Measure; ``taps`` on the emulated board, sinks for ``seconds``, the load for ``load_s`` (0:
    none)."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        board = _board(place, taps, seed)
        steady = place / "steady.toml"
        steady.write_text(_scene([(0.1, 1.0)], 1.2, RATE_HZ, seed), encoding="utf-8")
        host = host_times_ms(steady)
        sinks = {name: _sink(name, steady, seconds) for name in ("udp", "tuio")}
        load = _load(place, steady, load_s) if load_s else None
    parts = dict(zip(("scan", "solve", "link"), board.T, strict=True)) | {"host": host}
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(board), DRAWS)
    before = board.sum(axis=1)[drawn] + rng.choice(host, DRAWS)
    for name, times in sinks.items():
        parts[f"sink {name}"] = times
        parts[f"contact to {name}"] = before + rng.choice(times, DRAWS)
    shown = {name: tuple(np.percentile(times, [50, 99])) for name, times in parts.items()}
    found = {name: (float(low), float(high)) for name, (low, high) in shown.items()}
    return OutputTimes(found, len(board), taps, len(sinks["udp"]), load, machine())


def _scene(taps: list[tuple[float, float]], lasts_s: float, rate_hz: float, seed: int) -> str:
    places = ((-40.0, 10.0), (40.0, 20.0), (0.0, -45.0))
    touches = "".join(
        f"[[touch]]\nradius_mm = 8.0\nx_mm = {x}\ny_mm = {y}\nfrom_s = {begin}\nto_s = {end}\n"
        for (begin, end), (x, y) in zip(taps, places * len(taps), strict=False)
    )
    return (
        f'[scene]\nname = "taps"\nskin = "paper"\nseed = {seed}\nrate_hz = {rate_hz}\n'
        f"frames = {int(lasts_s * rate_hz)}\nquiet_frames = 16\n{touches}"
        "[effects.noise]\nsnr_db = 60.0\n"
    )


def _board(place: Path, taps: int, seed: int) -> FloatArray:
    """Scan, solve and link in ms (k, 3) of each contact that was found, on the emulated board."""
    rng = np.random.default_rng(seed)
    begins = 0.1 + np.cumsum(APART_S + 0.05 * rng.random(taps))
    ends = [(round(t, 3), round(t + HELD_S, 3)) for t in begins.tolist()]
    path = place / "taps.toml"
    path.write_text(_scene(ends, ends[-1][1] + 0.2, SCENE_HZ, seed), encoding="utf-8")
    found = []
    with Session(
        f"emu:{path}", SessionSettings(mode=Stream.TOUCHES), observe=observe_scene
    ) as session:
        session.start()
        packets: deque[int] = deque(maxlen=1)  # bytes of the last one with touches

        def tap(packet: Packet) -> None:
            if packet.type == PacketType.TOUCHES:
                packets.append(len(encode(packet.type, packet.sequence, packet.payload)))

        session.device.record(tap)
        board, waiting = session.device.board, [begin for begin, _ in ends]
        scan_us = board.measured_rows * board.slot_us
        began_us = session.began_us
        assert began_us is not None
        for frame in session.messages():
            if not isinstance(frame, Frame) or not frame.touches or not waiting:
                continue
            contact_us = began_us + 1e6 * waiting[0]
            ended_us = frame.board_us + scan_us
            assert frame.info is not None
            if ended_us < contact_us:
                continue
            while waiting and began_us + 1e6 * waiting[0] <= ended_us:
                waiting.pop(0)  # a tap that was never seen counts as none found
            link_us = 1e6 * packets[-1] * BITS_A_BYTE / BAUD
            found.append((ended_us - contact_us, frame.info.age_us, link_us))
    late = np.array(found)
    return late[late[:, 0] < 1e6 * HELD_S] / 1e3


def host_times_ms(scene: Path) -> FloatArray:
    """From bytes of a recording to frames, ms each."""
    run_file = scene.with_suffix(".eits")
    settings = SessionSettings(mode=Stream.TOUCHES, record=run_file)
    with Session(f"sim:{scene}", settings) as session:
        for _ in session.messages():
            pass
    times, last = [], 0
    for _ in range(5):
        with Session(f"file:{run_file}") as session:
            for number, _ in enumerate(session.messages()):
                now = time.perf_counter_ns()
                if number:
                    times.append((now - last) / 1e6)
                last = time.perf_counter_ns()
    return np.array(times)


def _udp_frame(data: bytes) -> int | None:
    message = json.loads(data)
    return message["frame"] if message["type"] == "frame" else None


def _tuio_frame(data: bytes) -> int | None:
    from pythonosc.osc_bundle import OscBundle

    number: int = list(OscBundle(data))[-1].params[1]
    return number


READ: dict[str, Callable[[bytes], int | None]] = {"udp": _udp_frame, "tuio": _tuio_frame}


def _listen(name: str, frames: int, pipe: Connection) -> None:
    """In a process of its own: when each message had been read, by this machine's clock."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(30.0)
        pipe.send(receiver.getsockname()[1])
        came: list[int] = []
        while len(came) < frames:
            if READ[name](receiver.recv(65536)) is not None:
                came.append(time.monotonic_ns())
        pipe.send(came)


def _sink(name: str, scene: Path, seconds: float) -> FloatArray:
    """From each frame to another process that has read it, ms, at 48 frames per second."""
    frames = max(int(seconds * RATE_HZ), 8)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    listener = context.Process(target=_listen, args=(name, frames, theirs), daemon=True)
    listener.start()
    arrived = []
    with Session(f"sim:{scene}?speed=1&loop=1", SessionSettings(frames=frames)) as session:
        assert session.known is not None
        url = f"{name}://127.0.0.1:{ours.recv()}"
        with Outputs([url], TouchSource(session.url, "", session.known.model)) as outputs:
            for frame in session.messages():
                if isinstance(frame, Frame):
                    arrived.append(frame.arrived_ns)
                    outputs.put(frame)
    came = ours.recv()
    listener.join()
    return np.array([(at - sent) / 1e6 for at, sent in zip(came, arrived, strict=True)])


def _load(place: Path, scene: Path, seconds: float) -> Load:
    """All sinks at once at 48 frames per second, touches and images."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drain, socket.socket() as probe:
        for one in (drain, probe):
            one.bind(("127.0.0.1", 0))
        datagrams, port = drain.getsockname()[1], probe.getsockname()[1]
        probe.close()
        where = {"csv": f"csv:{place}/load.csv", "mcap": f"mcap:{place}/load.mcap"}
        where["ws"] = f"ws://127.0.0.1:{port}"
        urls = [where.get(name, f"{name}://127.0.0.1:{datagrams}") for name in SINKS]
        settings = SessionSettings(
            mode=Stream.TOUCHES | Stream.IMAGE, frames=max(int(seconds * RATE_HZ), 10)
        )
        with Session(f"sim:{scene}?speed=1&loop=1", settings) as session:
            assert session.known is not None
            source = TouchSource(session.url, "", session.known.model)
            with Outputs(urls, source) as outputs:
                early, count, used, start = 0.0, 0, time.process_time(), time.perf_counter()
                client = _reading(f"ws://127.0.0.1:{port}")
                for frame in session.messages():
                    outputs.put(frame)
                    count += isinstance(frame, Frame)
                    if count == settings.frames // 10:
                        early = _memory_mb()
                late, lasted = _memory_mb(), time.perf_counter() - start
                share = (time.process_time() - used) / lasted
                counts = outputs.end(session.finish().as_dict() | {"truth": None})
                client.terminate()
    shown = [one | {"url": name} for one, name in zip(counts, SINKS, strict=True)]
    return Load(lasted, count, shown, early, late, share)


def _reading(url: str) -> Any:
    """A process that reads all that a WebSocket server says."""
    reader = multiprocessing.get_context("spawn").Process(target=_read, args=(url,), daemon=True)
    reader.start()
    return reader


def _read(url: str) -> None:
    from websockets.sync.client import connect

    with connect(url, max_size=None) as client:
        for _ in client:
            pass


def _memory_mb() -> float:
    """This process's memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def rows(result: OutputTimes) -> list[list[str]]:
    """A row a part."""
    return [
        [name, f"{median:.2f}", f"{high:.2f}"] for name, (median, high) in result.parts_ms.items()
    ]


def load_rows(load: Load) -> list[list[str]]:
    """A row a sink."""
    return [[str(one[name]) for name in ("url", *LOAD_HEAD[1:])] for one in load.sinks]


def load_text(load: Load) -> str:
    """In a sentence or two."""
    return (
        f"{load.frames} frames in {load.seconds:.0f} s with {len(load.sinks)} sinks: memory"
        f" {load.early_mb:.1f} MB after a tenth, {load.late_mb:.1f} MB at the end;"
        f" {100 * load.processor_share:.0f} % of a processor, the simulated board and its solver"
        " included."
    )


def as_text(result: OutputTimes) -> str:
    """For a terminal."""
    table = [" ".join((f"{HEAD[0]:18}", *(f"{name:>10}" for name in HEAD[1:])))]
    table += [f"{name:18} {low:>10} {high:>10}" for name, low, high in rows(result)]
    table.append(f"{result.taps} of {result.tapped} contacts found; {result.sunk} frames a sink")
    if result.load is not None:
        table.append(load_text(result.load))
        table += [
            f"  {name:10} {sent} sent, {dropped} dropped, {failed} failed"
            for name, sent, dropped, failed in load_rows(result.load)
        ]
    return "\n".join((result.machine, *table))


def for_page(result: OutputTimes, command: str) -> Filling:
    """The marks ``outputs-run``, ``outputs``, ``load-run`` and ``load``."""
    run_text = (
        f"By `{command}`: {result.taps} of {result.tapped} contacts found on the emulated board,"
        f" {result.sunk} frames a sink; {result.machine}, {os.cpu_count()} processors."
    )
    texts = {"outputs-run": run_text}
    tables: dict[str, Tabular] = {"outputs": (HEAD, rows(result))}
    if result.load is not None:
        texts["load-run"] = load_text(result.load)
        tables["load"] = (LOAD_HEAD, load_rows(result.load))
    return texts, tables
