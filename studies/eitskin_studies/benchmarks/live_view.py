"""The cost of the live page: the server's share of a core, and the time from a frame to its pixels
in a browser, with no page, one, and several."""

import json
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin_studies.harness.live_page import browser, need_browser, served_page
from eitskin_studies.harness.sections import Filling, text_table

PAGES = (0, 1, 8)
UNREAD_PORT = 47_808
WARM_S = 3.0
SCENE = """[scene]
frames = 384
rate_hz = 48.0
quiet_frames = 16
[[touch]]
radius_mm = 9.0
path = [{t_s = 0.0, x_mm = -40.0, y_mm = 10.0}, {t_s = 8.0, x_mm = 40.0, y_mm = -10.0}]
[[touch]]
radius_mm = 8.0
path = [{t_s = 0.0, x_mm = 20.0, y_mm = 60.0}, {t_s = 8.0, x_mm = -30.0, y_mm = 50.0}]
[effects.noise]
snr_db = 60.0
"""
# When each frame was complete, by the clock that the page and the server share, and when the
# screen's next frame began after it was drawn.
WATCH = """
window.seen = [];
const complete = new Map(), send = WebSocket.prototype.send;
WebSocket.prototype.send = function (data) {
  const said = JSON.parse(data);
  if (said.type === "hello") this.addEventListener("message", ({ data }) => {
    if (typeof data === "string") return;
    const head = new DataView(data);
    const at = 16 + 4 * (head.getUint32(8, true) + head.getUint32(12, true));
    const message = JSON.parse(new TextDecoder().decode(new Uint8Array(data, at)));
    complete.set(head.getUint32(4, true), 1e3 * message.time_unix_s);
  });
  if (said.type === "drawn") requestAnimationFrame(() => {
    window.seen.push(performance.timeOrigin + performance.now() - complete.get(said.number));
    for (const one of [...complete.keys()]) if (one <= said.number) complete.delete(one);
  });
  return send.call(this, data);
};
"""


@dataclass(frozen=True)
class LiveView:
    """With ``pages`` looking on: frames per second that were sent to each, the server's share of a
    core (all of it: simulated board, solver, page), frames that were dropped, and the times from a
    frame that is complete to its pixels, in ms (the first page, in Chromium); the server's memory
    when the measurement began and at its end."""

    pages: int
    rate_hz: float
    core_fraction: float
    dropped: int
    median_ms: float
    p99_ms: float
    memory_mb: tuple[float, float]


@dataclass(frozen=True)
class LiveViews:
    """One for each number of pages."""

    measured: tuple[LiveView, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON; null where no page looked on."""
        return {
            "measured": [
                {key: None if value != value else value for key, value in asdict(one).items()}
                for one in self.measured
            ]
        }


def run(
    seconds: float,
    pages: tuple[int, ...] = PAGES,
    progress: Callable[[str], None] = print,
    *,
    sinks: bool = False,
) -> LiveViews:
    """Each number of ``pages`` for ``seconds``; with ``sinks`` six of them beside.

    Raises:
        MissingExtraError: selenium is not installed.
        DeviceError: the server did not start.
    """
    need_browser()
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "moving.toml"
        scene.write_text(SCENE)
        results = []
        for count in pages:
            progress(f"{count} pages for {seconds:g} s")
            results.append(_measured(scene, count, seconds, _sinks(folder) if sinks else []))
        return LiveViews(tuple(results))


def _sinks(folder: str) -> list[str]:
    """Six that are fast: nobody reads the datagrams."""
    files = [f"csv:{folder}/touches.csv", f"mcap:{folder}/touches.mcap"]
    udp = [f"{name}://127.0.0.1:{UNREAD_PORT}" for name in ("udp", "osc", "tuio")]
    return [*udp, f"ws://127.0.0.1:{UNREAD_PORT}", *files]


def _measured(scene: Path, count: int, seconds: float, sinks: list[str]) -> LiveView:
    with ExitStack() as stack:
        process, address = stack.enter_context(served_page(f"sim:{scene}?loop=1", sinks))
        page = stack.enter_context(browser(address, WATCH)) if count else None
        others = [stack.enter_context(_other(address)) for _ in range(count - 1)]
        time.sleep(WARM_S)
        if page is not None:
            page.execute_script("window.seen.length = 0")
        for other in others:
            other["frames"] = 0
        begin, busy = time.monotonic(), _cpu_s(process.pid)
        early_mb = _memory_mb(process.pid)
        time.sleep(seconds)
        passed = time.monotonic() - begin
        share = (_cpu_s(process.pid) - busy) / passed
        memory_mb = (early_mb, _memory_mb(process.pid))
        if page is None:
            return LiveView(0, 0.0, share, 0, float("nan"), float("nan"), memory_mb)
        seen = np.array(page.execute_script("return window.seen"), dtype=np.float64)
        rates = [len(seen) / passed, *(other["frames"] / passed for other in others)]
        dropped = int(page.find_element("id", "n-dropped").text) + sum(
            other["dropped"] for other in others
        )
        median, p99 = np.percentile(seen, [50, 99])
        return LiveView(count, min(rates), share, dropped, float(median), float(p99), memory_mb)


@contextmanager
def _other(address: str) -> Iterator[dict[str, int]]:
    """A page without a screen: it reads all, and says at once that it has drawn it."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect
    from websockets.typing import Origin

    origin, _, token = address.partition("/#token=")
    counts = {"frames": 0, "dropped": 0}
    url = f"{origin.replace('http', 'ws')}/live"
    with connect(url, origin=Origin(origin), compression=None) as line:
        line.send(json.dumps({"type": "hello", "token": token}))

        def read() -> None:
            with suppress(ConnectionClosed):
                for said in line:
                    if isinstance(said, bytes):
                        counts["frames"] += 1
                        number = int.from_bytes(said[4:8], "little")
                        line.send(json.dumps({"type": "drawn", "number": number}))
                    elif '"type":"page"' in said:
                        counts["dropped"] = json.loads(said)["dropped"]

        thread = threading.Thread(target=read, daemon=True)
        thread.start()
        yield counts
    thread.join(5.0)


def _cpu_s(pid: int) -> float:
    """Seconds of processor time of a process so far, all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory_mb(pid: int) -> float:
    """Return the resident memory of a process in MB."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def as_text(result: LiveViews) -> str:
    """For reading."""
    return text_table(*_table(result))


def for_page(result: LiveViews, command: str, mark: str) -> Filling:
    """The texts and tables between the marks of studies/results/outputs.md."""
    return {f"{mark}-run": f"By `{command}`."}, {mark: _table(result)}


def _table(result: LiveViews) -> tuple[list[str], list[list[str]]]:
    head = ["pages", "frames a second", "server, % of a core", "not shown"]
    head += ["frame to pixel, median", "99th percentile", "memory of the server, MB"]
    rows = []
    for one in result.measured:
        shown = bool(one.pages)
        rows.append(
            [
                str(one.pages),
                f"{one.rate_hz:.1f}" if shown else "",
                f"{100 * one.core_fraction:.1f}",
                str(one.dropped) if shown else "",
                f"{one.median_ms:.1f} ms" if shown else "",
                f"{one.p99_ms:.1f} ms" if shown else "",
                "{:.0f}, {:.0f} at the end".format(*one.memory_mb),
            ]
        )
    return head, rows
