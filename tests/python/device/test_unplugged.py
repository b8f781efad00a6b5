"""A board that is pulled out for seconds or a minute is waited for and goes on, on a port and a
clock of the test's own."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest
from device_helpers import UNTOUCHED, of, scene, sim_board

from eitskin.device.client import Device
from eitskin.device.link import Reconnect, ThreadedLink
from eitskin.device.simulated import SimTransport
from eitskin.device.transport import LinkEvent, Transport
from eitskin.device.wire.codec import encode
from eitskin.device.wire.link_table import Drive, Keepalive, PacketType, Stream
from eitskin.device.wire.packets import RawFrame, SolvedTouches
from eitskin.errors import DeviceError
from eitskin.session.notices import link_text

FRAME_S = 1 / scene().rate_hz
WANTED = 10 + round(2 / FRAME_S)  # more than the board sends before it misses its host


class Port(Transport):
    """A simulated board behind a port that is pulled out for ``away_s`` after so many more reads;
    ``Clock`` counts. The board keeps its power, and scans until it misses its host."""

    url = name = "/dev/ttyFAKE"

    def __init__(self) -> None:
        self.board = sim_board()
        self._line = SimTransport("behind a port", self.board)
        self._away_s = self.waited_s = 0.0
        self._one = threading.Lock()  # reads and writes come from two threads
        self._plan: tuple[int, float, bool] | None = None

    def pull_out(self, reads: int, away_s: float, *, restarts: bool = False) -> None:
        self._plan = reads, away_s, restarts

    def pass_by(self, time_s: float) -> None:
        self._away_s -= time_s
        self.waited_s += time_s
        with self._one:
            for _ in range(round(time_s / FRAME_S)):
                self._line.read(0)
            if self.waited_s > 0.9:  # simulated boards do not miss their host by themselves
                self._line.write(encode(PacketType.KEEPALIVE, 0, Keepalive(0).payload(0)))

    def _check(self) -> None:
        if self._away_s > 0:
            raise DeviceError(f"{self.name}: the port is gone (pulled out)")

    def read(self, timeout_s: float) -> bytes:
        self._check()
        with self._one:
            data = self._line.read(0)
        if not data:
            time.sleep(0.001)
        elif self._plan is not None:
            reads, away_s, restarts = self._plan
            self._plan = reads - 1, away_s, restarts
            if reads == 1:
                self._plan, self._away_s = None, away_s
                if restarts:
                    self.board.restart()
        return data

    def write(self, data: bytes) -> None:
        self._check()
        with self._one:
            self._line.write(data)

    def reopen(self) -> bool:
        return self._away_s <= 0

    def begin_scene(self) -> None:
        self._line.begin_scene()

    def close(self) -> None:
        pass


class Clock(threading.Event):
    """Whoever waits on it for a time has waited, as far as the port is concerned."""

    def __init__(self, port: Port) -> None:
        super().__init__()
        self._port = port

    def wait(self, timeout: float | None = None) -> bool:
        time.sleep(0.002)  # the reader of the stream gets impatient meanwhile
        self._port.pass_by(timeout or 0)
        return self.is_set()


@contextmanager
def plugged() -> Iterator[tuple[Device, Port]]:
    port = Port()
    with Device(port) as device:
        assert isinstance(device.link, ThreadedLink)
        device.link._stopping = Clock(port)
        next_item = device.next_item
        device.next_item = lambda timeout_s: next_item(min(timeout_s, 0.001))
        device.tare(UNTOUCHED)
        yield device, port


@pytest.mark.parametrize("away_s", [2, 8, 60, 119])
def test_it_is_waited_for_and_goes_on(away_s):
    with plugged() as (device, port):
        port.pull_out(10, away_s)
        items = list(device.stream(Stream.RAW | Stream.TOUCHES, frames=WANTED))
        said = [link_text(event) for event in of(LinkEvent, items)]
        frames = [raw.frame for raw in of(RawFrame, items)]
        assert said[0] == f"link: unplugged: {port.name}: the port is gone (pulled out)"
        assert said[1] == f"link: reconnected: {port.name}"
        assert away_s <= port.waited_s < away_s + 1 and device.counters.reconnects == 1
        assert len(frames) >= WANTED - 2 and frames == sorted(set(frames))
        assert {one.frame for one in of(SolvedTouches, items)} <= set(frames)
        lost = max(b - a for a, b in pairwise(frames))
        assert 0.9 < lost * FRAME_S < 1.2  # then it missed its host, and scanned no more
        assert device.info().tared and device.board.drive == Drive.ON


@pytest.mark.parametrize("what", [Stream.RAW, Stream.TOUCHES])
def test_one_that_lost_its_power_meanwhile_has_no_reference(what):
    with plugged() as (device, port):
        port.pull_out(5, 8, restarts=True)
        kinds = []
        try:
            kinds += [type(item) for item in device.stream(what, frames=20)]
        except DeviceError as error:
            assert "restarted and has no reference frame; leave the skin" in str(error)
            assert what == Stream.TOUCHES
        else:
            assert what == Stream.RAW and kinds.count(RawFrame) >= 18


def test_after_two_minutes_it_is_given_up():
    waited_s = Reconnect().tries * Reconnect().every_s
    with plugged() as (device, port):
        port.pull_out(5, waited_s + 1)
        with pytest.raises(DeviceError, match="the port is gone") as error:
            list(device.stream(Stream.RAW))
        assert f"did not come back within {waited_s:g} s: plug it in" in str(error.value)
        assert "flash" not in str(error.value)
