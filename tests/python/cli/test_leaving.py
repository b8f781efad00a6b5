"""Ctrl-C ends every program that follows a board within a second, whatever the port does."""

import os
import pty
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from board_on_a_port import Wire
from eitskin.device.bank import bank_bytes
from eitskin.device.simulated import SimBoard
from line_of_a_board import untouched
from small_models import prebuilt

PROGRAMS = {
    "stream": ["-m", "eitskin", "stream", "--device", "{url}", "--json"],
    "record": ["-m", "eitskin", "record", "--device", "{url}", "-o", "run.eits"],
    "view": ["-m", "eitskin", "view", "--device", "{url}", "--port", "0"],
    "api": ["-c", "import eitskin\nfor frame in eitskin.stream('{url}'): print(1, flush=True)"],
    "device": [
        "-c",
        "import eitskin\nwith eitskin.open_device('{url}') as board:\n board.tare(4)\n"
        " for one in board.stream(): print(1, flush=True)",
    ],
}
CODES = {"stream": 0, "record": 0, "view": 130, "api": -signal.SIGINT, "device": -signal.SIGINT}
State = Literal["well", "silent", "flooding", "half", "deaf", "unplugged"]
STATES: tuple[State, ...] = ("well", "silent", "flooding", "half", "deaf", "unplugged")
LIMIT_S = 1.0
START_SHARE = 0.5  # of the time to start a program, which grows on a busy machine as does its end
LAYOUT = """
[lines]
delimiter = "comma"
cells = 208
[protocol]
electrodes = 16
kind = "adjacent"
"""


class BoardPort(Wire):
    """A board behind a pseudo-terminal, until ``become`` gives the port another state."""

    def __init__(self) -> None:
        board = SimBoard(untouched(), [bank_bytes(prebuilt()[1], 1)] * 2)
        super().__init__(board, frame_s=0.02)
        self.url = f"serial:{self.path}"

    def become(self, state: State) -> threading.Event:
        """The port's new state, until the event is set."""
        end = threading.Event()
        if state == "well":
            return end
        if state == "unplugged":
            self.unplug()
            return end
        self._stop.set()
        self._thread.join(5)
        threading.Thread(target=misbehave, args=(self.master, state, end, b"\1\2\3")).start()
        return end


class LinePort:
    """An instrument that prints lines into a pseudo-terminal."""

    def __init__(self, folder: Path) -> None:
        self.master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        (folder / "layout.toml").write_text(LAYOUT)
        self.url = f"text:{self.path}?layout={folder}/layout.toml"
        volts = untouched().rows(prebuilt()[0].protocol).around(0)[1][0]
        self._line = (",".join(f"{v:.7g}" for v in np.ravel(volts)) + "\n").encode()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with suppress(OSError):
            while not self._end.wait(0.02):
                os.write(self.master, self._line)

    def become(self, state: State) -> threading.Event:
        end = threading.Event()
        if state == "well":
            return self._end
        self._end.set()
        self._thread.join(5)
        if state == "unplugged":
            os.close(self._slave)
            os.close(self.master)
            return end
        half = self._line[:100]
        work = (self.master, state, end, self._line if state == "flooding" else half)
        threading.Thread(target=misbehave, args=work).start()
        return end


def misbehave(master: int, state: State, end: threading.Event, half: bytes) -> None:
    """Behave like a broken device on an existing port: send bytes without end, half a packet, or
    nothing. A deaf one does not even read what is sent."""
    os.set_blocking(master, False)
    if state == "half":
        os.write(master, half)
    while not end.wait(0.0 if state == "flooding" else 0.01):
        with suppress(OSError):
            if state == "flooding":
                os.write(master, half * 20)
        if state != "deaf":
            with suppress(OSError):
                os.read(master, 4096)


@pytest.fixture(params=["board", "lines"])
def port(request, tmp_path) -> Iterator[BoardPort | LinePort]:
    yield BoardPort() if request.param == "board" else LinePort(tmp_path)


def short(program: str, state: State) -> bool:
    """Whether a short run tries this one."""
    return (program, state) == ("view", "silent") or (program == "stream" and state != "well")


@pytest.mark.parametrize(
    ("program", "state"),
    [
        (p, s) if short(p, s) else pytest.param(p, s, marks=pytest.mark.long("other states"))
        for p in PROGRAMS
        for s in STATES
    ],
)
def test_ctrl_c_ends_it(port, program, state, tmp_path):
    began = time.monotonic()
    command = [sys.executable, *(one.replace("{url}", port.url) for one in PROGRAMS[program])]
    child = subprocess.Popen(
        command,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=(tmp_path / "said").open("w"),
        # a background job of a shell ignores Ctrl-C, and so do the programs that it starts
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    end = threading.Event()
    try:
        assert child.stdout is not None
        if program == "record":
            wait_until(lambda: (tmp_path / "run.eits").exists())
            time.sleep(0.7)
        else:
            assert child.stdout.readline(), (tmp_path / "said").read_text()
        if program == "view":
            wait_until(lambda: "touch it" in (tmp_path / "said").read_text())
        slack_s = START_SHARE * (time.monotonic() - began)
        time.sleep(0.3)
        end = port.become(state)
        drain = threading.Thread(target=child.stdout.read, daemon=True)
        drain.start()
        time.sleep(0.6)
        asked = time.monotonic()
        child.send_signal(signal.SIGINT)
        code = child.wait(20)
        took_s = time.monotonic() - asked
    finally:
        child.kill()
        end.set()
    print(f"{port.url[:4]} {program} {state}: code {code} after {took_s:.2f} s")
    assert code == CODES[program], (tmp_path / "said").read_text()
    assert took_s < LIMIT_S + slack_s


def wait_until(there) -> None:
    end = time.monotonic() + 60
    while not there():
        assert time.monotonic() < end
        time.sleep(0.05)
