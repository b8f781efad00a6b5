"""Objects that threads share, as docs/reference/python-api.md, "Threads", describes: each call is
complete, or the other thread gets a clear error. Also what can be pickled."""

import copy
import pickle
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import islice

import numpy as np
import pytest

import eitskin
from board_on_a_port import behind_a_port
from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore
from eitskin.core.gestures import Gestures
from eitskin.core.results import Reconstruction
from eitskin.device.bank import bank_bytes
from eitskin.device.client import Device
from eitskin.device.open import open_device
from eitskin.device.simulated import SimBoard
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import BoardInfo, BoardStats
from eitskin.errors import DeviceError, EitskinError, UsageError
from eitskin.session.frame import Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.solve.batch import Batch
from eitskin.solve.reconstructor import ENGINES, Reconstructor
from eitskin.threads import FairLock
from line_of_a_board import untouched
from small_models import prebuilt, session, small, small_blob, small_model

SHORT_S = 0.5
TEN_MINUTES = pytest.param(600.0, marks=pytest.mark.long("a second of each"))
LOOP = "sim:swipe?loop=1"


@pytest.fixture(autouse=True)
def switch_often() -> Iterator[None]:
    """Threads change places a hundred times as often as they do."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(5e-5)
    yield
    sys.setswitchinterval(before)


def quiet() -> np.ndarray:
    return small().untouched(3, 16)


def together(seconds: float, *works: Callable[[], object]) -> list[int]:
    """Repeat each of ``works`` in a thread of its own for so long; how often each was done. The
    first error of any is raised."""
    end = time.monotonic() + seconds

    def repeat(work: Callable[[], object]) -> int:
        done = 0
        while time.monotonic() < end:
            work()
            done += 1
        return done

    with ThreadPoolExecutor(len(works)) as pool:
        return [one.result() for one in [pool.submit(repeat, work) for work in works]]


def key(result: Reconstruction) -> bytes:
    places = [(t.x_mm, t.y_mm, t.radius_mm, t.strength_s_per_m_mm2) for t in result.touches]
    arrays = result.solver_image, result.coefficients, np.array(places)
    return b"".join(one.tobytes() for one in arrays)


# ---- objects that reach the C core ----


@pytest.mark.parametrize("seconds", [SHORT_S, TEN_MINUTES])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_reconstructor_in_three_threads_gives_each_its_own_frame(engine, seconds):
    skin = Reconstructor(small_model(), engine=engine, blob=small_blob())
    skin.tare(quiet())
    frames = small().frames(5, 12)
    alone = [key(skin.reconstruct(frame)) for frame in frames]
    places = [iter(range(10**9)) for _ in range(2)]

    def one(place: Iterator[int]) -> None:
        k = next(place) % len(frames)
        assert key(skin.reconstruct(frames[k])) == alone[k]

    def others() -> None:
        skin.set_options(iterations=skin.options.iterations)
        assert pickle.loads(pickle.dumps(skin)).options == skin.options
        time.sleep(0.05)

    assert min(together(seconds, lambda: one(places[0]), lambda: one(places[1]), others)) > 0


def test_a_tare_in_another_thread_is_before_or_after_a_frame():
    skin = Reconstructor(small_model(), blob=small_blob())
    references = [quiet(), quiet()[:8] * 1.001]
    frame, found = small().frames(5, 1)[0], set()
    for reference in references:
        skin.tare(reference)
        found.add(key(skin.reconstruct(frame)))
    turns = iter(range(10**9))

    def use() -> None:
        assert key(skin.reconstruct(frame)) in found

    assert min(together(SHORT_S, use, lambda: skin.tare(references[next(turns) % 2]))) > 10


def test_a_second_stream_of_a_reconstructor_is_refused_in_another_thread():
    skin = Reconstructor(small_model(), blob=small_blob())
    skin.tare(quiet())
    frames = small().frames(5, 3)
    first = skin.stream(frames)
    next(first)
    with ThreadPoolExecutor(1, thread_name_prefix="other") as pool:
        error = pool.submit(lambda: next(skin.stream(frames))).exception()
    assert isinstance(error, UsageError)
    text = "already go to thread 'MainThread'; use a Reconstructor per stream"
    assert text in str(error)
    assert len(list(first)) == 2 and len(list(skin.stream(frames))) == 3


def test_a_batch_belongs_to_the_thread_that_goes_through_it():
    batch = Batch(small_model(), threads=2, blob=small_blob())
    batch.tare(quiet())
    frames = small().frames(5, 40)
    alone = [key(one) for one in batch.each(frames) if isinstance(one, Reconstruction)]
    begun = batch.each(frames)
    next(begun)
    with ThreadPoolExecutor(1) as pool:
        for use in (
            lambda: list(batch.each(frames)),
            lambda: batch.tare(quiet()),
            lambda: batch.mask_rows(np.zeros(frames.shape[1], dtype=bool)),
        ):
            error = pool.submit(use).exception()
            assert isinstance(error, UsageError) and "thread 'MainThread'; make" in str(error)
    again = [key(one) for one in batch.each(frames) if isinstance(one, Reconstruction)]
    assert again == alone
    with pytest.raises(UsageError, match="taken over by a later reader"):
        list(begun)


@pytest.mark.parametrize("seconds", [SHORT_S, TEN_MINUTES])
def test_gestures_take_each_frame_as_a_whole(seconds):
    """Two fingers rest at places of their own in each of two threads."""
    skin = Reconstructor(prebuilt()[0], blob=prebuilt()[1])
    skin.tare(session().untouched_v)
    touches = next(r.touches for r in map(skin.reconstruct, session().frames_v) if r.touches)
    gestures, clock = Gestures(), iter(range(0, 2**40, 20_000))
    known = {(one.x_mm, one.y_mm) for one in touches}

    def one() -> None:
        for event in gestures.update(touches, next(clock)):
            assert (event.x_mm, event.y_mm) in known

    assert min(together(seconds, one, one)) > 10 and gestures.dropped == 0


def test_the_fast_path_shares_its_engines_lock():
    engine = CoreEngine(prebuilt()[1])
    fast = FastCore(engine)
    assert fast.lock is engine.lock
    engine.set_reference(session().untouched_v)
    fast.begin()
    volts = session().untouched_v[0]
    drives = iter(range(10**9))

    def drive() -> None:
        k = next(drives) % len(fast.rows)
        fast.drive(k, volts[fast.rows[k]], 1e-3 * k)

    assert min(together(SHORT_S, drive, lambda: engine.reconstruct(volts))) > 5


# ---- devices ----


@contextmanager
def opened(kind: str) -> Iterator[Device]:
    if kind == "pumped":
        with open_device(LOOP) as board:
            yield board
        return
    board = SimBoard(untouched(), [bank_bytes(prebuilt()[1], 1)] * 2)
    with behind_a_port(board) as path, open_device(f"serial:{path}") as device:
        yield device


@pytest.mark.parametrize("seconds", [2.0, TEN_MINUTES])
@pytest.mark.parametrize("kind", ["pumped", "on a port"])
def test_buttons_beside_a_stream_get_their_own_answers(kind, seconds):
    with opened(kind) as board:
        board.tare(4)
        frames = iter(board.stream(Stream.RAW))
        numbers: list[int] = []

        def follow() -> None:
            item = next(frames)
            if hasattr(item, "frame"):
                numbers.append(item.frame)

        def ask() -> None:
            assert isinstance(board.stats(), BoardStats)
            assert isinstance(board.info(), BoardInfo)
            time.sleep(0.005)

        def tare() -> None:
            board.tare(4)
            time.sleep(0.02)

        done = together(seconds, follow, ask, ask, tare)
        assert min(done) >= 3, done
        assert numbers == sorted(set(numbers)) and len(numbers) > 5
        assert board.counters.malformed == board.counters.crc_errors == 0


@pytest.mark.parametrize("kind", ["pumped", "on a port"])
def test_a_second_reader_of_a_board_is_refused_by_the_name_of_the_first(kind):
    with opened(kind) as board, ThreadPoolExecutor(1, thread_name_prefix="window") as pool:
        begun = board.stream(Stream.RAW)
        first = pool.submit(lambda: next(begun))
        first.result(10)
        for read in (lambda: next(board.stream(Stream.RAW)), lambda: board.next_item(0.1)):
            with pytest.raises(UsageError) as error:
                read()
            assert "already go to thread 'window_0'; a board has one stream" in str(error.value)
        pool.submit(begun.close).result(10)  # type: ignore[attr-defined]
        assert list(islice(board.stream(Stream.RAW), 2))


def test_one_iterator_in_two_threads():
    with opened("on a port") as board, ThreadPoolExecutor(1, thread_name_prefix="reader") as pool:
        frames = board.stream(Stream.RAW)
        came: list[object] = [next(frames)]
        refused, held = threading.Event(), threading.Event()
        board.record(lambda packet: (held.set(), refused.wait(30)))  # nothing comes meanwhile

        def read() -> None:
            while not refused.is_set():
                came.append(next(frames))

        waits = pool.submit(read)
        assert held.wait(30)
        count = 0
        while count < len(came):  # until it has read what came before, and is inside of  next
            count = len(came)
            time.sleep(0.1)
        for use in (frames.__next__, frames.close):  # type: ignore[attr-defined]
            with pytest.raises(UsageError, match="read by thread 'reader_0'; end the loop"):
                use()
        refused.set()
        waits.result(30)
        assert len(came) > count
        board.record(None)


@pytest.mark.parametrize("kind", ["pumped", "on a port"])
def test_a_device_that_another_thread_closes_ends_the_stream(kind):
    with opened(kind) as board, ThreadPoolExecutor(1) as pool:
        came = threading.Event()
        following = pool.submit(lambda: [came.set() for _ in board.stream(Stream.RAW)])
        came.wait()
        board.close()
        error = following.exception(20)
        assert isinstance(error, DeviceError)
        assert "it was closed, in thread 'MainThread'; open it again" in str(error)
        with pytest.raises(DeviceError, match="it was closed"):
            board.stats()


def test_a_second_thread_cannot_read_a_session():
    with (
        Session(LOOP, SessionSettings(mode=Stream.TOUCHES)) as one,
        ThreadPoolExecutor(1, thread_name_prefix="page") as pool,
    ):
        messages = one.messages()
        pool.submit(lambda: next(messages)).result(20)
        with pytest.raises(UsageError, match="already go to thread 'page_0'"):
            next(one.messages())
        answers = [one.ask(lambda device: device.stats()) for _ in range(3)]
        seen = pool.submit(lambda: [type(m) for m in islice(messages, 50)]).result(20)
        assert Frame in seen and all(isinstance(a.result(5), BoardStats) for a in answers)
        one.stop()
        assert pool.submit(lambda: sum(1 for _ in messages)).result(20) <= 1


def test_two_threads_may_start_a_session():
    with (
        Session("sim:swipe", SessionSettings(mode=Stream.TOUCHES, tare=4)) as one,
        ThreadPoolExecutor(2) as pool,
    ):
        asked: list[int] = []
        tare = one.device.tare
        one.device.tare = lambda frames, **how: (asked.append(frames), tare(frames, **how))  # type: ignore
        list(pool.map(lambda _: one.start(), range(2)))
        tares = len(asked)
    assert tares == 1


def test_a_fair_lock_starves_nobody():
    lock, turns = FairLock(), [0, 0]

    def hog() -> None:
        with lock:
            turns[0] += 1
            time.sleep(0.001)

    def other() -> None:
        with lock, lock:
            turns[1] += 1

    together(0.5, hog, other)
    assert turns[1] > turns[0] / 3
    holding = threading.Event()
    release = threading.Event()

    def hold() -> None:
        with lock:
            holding.set()
            release.wait(10)

    thread = threading.Thread(target=hold)
    thread.start()
    holding.wait(5)
    assert not lock.acquire(0.05)
    release.set()
    thread.join()
    assert lock.acquire(1.0)
    lock.release()


# ---- pickles and copies ----


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("again", [lambda one: pickle.loads(pickle.dumps(one)), copy.deepcopy])
def test_a_pickled_reconstructor_goes_on(engine, again):
    skin = Reconstructor(small_model(), engine=engine, blob=small_blob())
    rows = np.zeros(small_model().protocol.n_rows, dtype=bool)
    rows[7] = True
    skin.set_options(iterations=17)
    skin.mask_rows(rows)
    skin.tare(quiet())
    other, frame = again(skin), small().frames(5, 1)[0]
    assert (other.engine, other.options) == (engine, skin.options)
    mine, theirs = skin.reconstruct(frame), other.reconstruct(frame)
    assert key(mine) == key(theirs) and theirs.info.masked == mine.info.masked >= 1
    assert key(pickle.loads(pickle.dumps(theirs))) == key(mine)
    with pytest.raises(EitskinError, match="reference"):
        again(Reconstructor(small_model(), engine=engine)).reconstruct(frame)


def test_a_pickled_batch_goes_on():
    batch = Batch(small_model(), threads=2, blob=small_blob())
    batch.tare(quiet())
    frames = small().frames(5, 3)
    results = [[key(r) for r in b.each(frames)] for b in (batch, pickle.loads(pickle.dumps(batch)))]  # type: ignore[arg-type]
    assert results[0] == results[1]


def test_what_cannot_be_pickled_says_what_to_do():
    engine = CoreEngine(prebuilt()[1])
    with open_device("sim:swipe") as board, Session("sim:swipe") as one:
        for thing, advice in (
            (engine, "pickle the Reconstructor"),
            (FastCore(engine), "make one beside"),
            (Gestures(), "make others of the same zones"),
            (board, "open its URL in the other process"),
            (one, "open another one in the other process"),
        ):
            for use in (pickle.dumps, copy.copy, copy.deepcopy):
                with pytest.raises(UsageError, match=advice):
                    use(thing)


def test_the_public_stream_in_two_threads():
    frames = eitskin.stream(LOOP, speed=0.1)
    numbers = [next(frames).number]
    refused = threading.Event()

    def read() -> None:
        while not refused.is_set() or len(numbers) < 5:
            numbers.append(next(frames).number)

    with ThreadPoolExecutor(1, thread_name_prefix="reader") as pool:
        reading = pool.submit(read)
        while len(numbers) < 2:
            time.sleep(0.01)
        with pytest.raises(UsageError, match="read by thread 'reader_0'"):
            next(frames)
        refused.set()
        reading.result(20)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    frames.close()  # type: ignore[attr-defined]
