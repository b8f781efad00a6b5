"""The one path of a frame: the owner of the board, requests to it, and modules that are not
imported."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NoAnswer
from itertools import pairwise

import pytest

from eitskin.device.client import Device
from eitskin.device.link import ThreadedLink
from eitskin.device.transport import Capabilities, Transport
from eitskin.device.wire.link_table import Stream
from eitskin.errors import DeviceError
from eitskin.session import session as session_module
from eitskin.session.frame import Frame, Notice
from eitskin.session.requests import Requests
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from line_of_a_board import Line

RAW = SessionSettings(mode=Stream.RAW)
SOON_S = 30.0


@pytest.fixture
def line(monkeypatch) -> Line:
    made = Line()
    monkeypatch.setattr(session_module, "open_with_files", lambda *files, **how: Device(made))
    return made


class Reading(threading.Thread):
    """The thread that iterates a session."""

    def __init__(self, settings: SessionSettings = RAW) -> None:
        super().__init__(daemon=True)
        self.session = Session("serial:fake", settings)
        self.frames, self.notices = 0, list[str]()
        self.error: Exception | None = None
        self.start()

    def run(self) -> None:
        try:
            with self.session as session:
                for message in session.messages():
                    self.frames += isinstance(message, Frame)
                    if isinstance(message, Notice):
                        self.notices.append(message.text)
        except Exception as error:
            self.error = error


def until(what: Callable[[], object]) -> None:
    end = time.monotonic() + SOON_S
    while not what():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.01)


@pytest.fixture
def reading(line) -> Iterator[Reading]:
    thread = Reading()
    until(lambda: thread.frames > 3)
    yield thread
    line.gone = line.silent = False
    thread.session.stop()
    thread.join(SOON_S)
    assert not thread.is_alive()


def refused(answer: Future[object], words: str) -> None:
    """The answer comes soon, and is a DeviceError with ``words``."""
    with pytest.raises(DeviceError, match=words):
        answer.result(SOON_S)


# ---- every command gets an answer ----


def test_a_command_before_the_session_starts_is_answered_once_it_has_started(line):
    session = Session("serial:fake", SessionSettings(mode=Stream.RAW, frames=5))
    answer = session.ask(lambda device: device.info().board)
    with session:
        assert sum(isinstance(one, Frame) for one in session.messages()) == 5
    assert answer.result(0) == "simulated"


def test_a_command_before_a_session_that_cannot_be_opened_is_refused(monkeypatch):
    def broken(*files: object, **how: object) -> Device:
        raise DeviceError("/dev/ttyNONE: no such port")

    monkeypatch.setattr(session_module, "open_with_files", broken)
    session = Session("serial:/dev/ttyNONE")
    answer = session.tare()
    with pytest.raises(DeviceError), session:
        pass
    refused(answer, "no such port")


def test_a_command_before_a_session_fails_is_answered(line, reading):
    """The board falls silent, and tares are asked: before the session fails, and after."""
    line.silent = True
    answers = [reading.session.tare() for _ in range(3)]
    reading.join(60)
    assert isinstance(reading.error, DeviceError)
    for answer in (*answers, reading.session.tare()):
        refused(answer, "has fallen silent")


def test_a_command_after_a_session_is_refused_at_once(line):
    with Session("serial:fake", SessionSettings(mode=Stream.RAW, frames=2)) as session:
        list(session.messages())
        refused(session.tare(), "the session is over; start again")
    refused(session.tare(), "the session is over; start again")


def test_a_command_while_the_board_is_unplugged_is_refused_and_the_session_goes_on(line, reading):
    line.gone = True
    until(lambda: any("unplugged" in text for text in reading.notices))
    refused(reading.session.tare(), "the board is unplugged; plug it in, then ask again")
    line.gone = False
    until(lambda: any("reconnected" in text for text in reading.notices))
    count = reading.frames
    until(lambda: reading.frames > count + 3)
    assert reading.session.ask(lambda device: device.info().serial).result(SOON_S)


def test_stop_ends_a_session_whose_board_says_nothing(line, reading):
    line.gone = True
    until(lambda: any("unplugged" in text for text in reading.notices))
    reading.session.stop()
    reading.join(SOON_S)
    assert not reading.is_alive()


@pytest.mark.parametrize("how", ["refuse", "close"])
def test_no_request_is_lost_between_threads(how):
    """Eight threads ask while the requests are closed: each gets its answer."""
    requests, answers = Requests(), list[Future[object]]()

    def ask() -> None:
        for _ in range(200):
            answers.append(requests.ask(lambda device: None))

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    if how == "close":
        requests.close("over")
    for thread in threads:
        thread.join()
    requests.refuse("over")
    assert len(answers) == 1600
    for answer in answers:
        try:
            assert isinstance(answer.exception(0), DeviceError)
        except NoAnswer:
            pytest.fail("a request was never answered")


# ---- one queue ----


def test_two_threads_may_ask_a_board_that_streams(line):
    """Answers go to whoever asked; no frame is lost to a command, and none is mixed."""
    with Device(line) as device:
        assert isinstance(device.link, ThreadedLink)
        stop, serials, failed = threading.Event(), [0], list[Exception]()

        def ask() -> None:
            try:
                while not stop.is_set():
                    assert device.info().serial == device.board.serial
                    assert device.stats().request
                    serials[0] += 1
            except Exception as error:
                failed.append(error)

        threads = [threading.Thread(target=ask) for _ in range(2)]
        for thread in threads:
            thread.start()
        numbers = [one.frame for one in device.stream(Stream.RAW, frames=60)]
        stop.set()
        for thread in threads:
            thread.join(SOON_S)
    assert not failed and serials[0] > 2
    assert len(numbers) == 60 and all(b - a == 1 for a, b in pairwise(numbers))


def test_a_consumer_gets_every_message_in_its_order():
    seen = []
    with Session("sim:swipe", SessionSettings(frames=12)) as session:
        session.consumers.append(seen.append)
        given = list(session.messages())
    assert seen == given and sum(isinstance(one, Frame) for one in given) == 12


# ---- what is not imported, and not probed ----

PATH_OF_A_REAL_BOARD = """
import sys
import eitskin.device.ports, eitskin.device.text_source, eitskin.session.session, eitskin.truth
import eitskin.page.server, eitskin.page.commands
import eitskin
eitskin.stream
print([name for name in sys.modules if name.startswith(("eitskin.scoring", "eitskin.scene"))])
"""


def test_the_path_of_a_real_board_imports_neither_scenes_nor_scores():
    command = [sys.executable, "-c", PATH_OF_A_REAL_BOARD]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout == "[]\n"


def test_what_a_transport_can_do_is_declared():
    assert Line().capabilities == Capabilities()
    assert Line().board_s is None and Line().known_hashes is None and Line().take_events() == []
    with pytest.raises(TypeError, match="abstract"):
        Transport()
