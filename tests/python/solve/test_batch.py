"""Batches over threads: the results of one frame after another, to the bit and to the id."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.results import Reconstruction
from eitskin.errors import FrameError, UsageError
from eitskin.model.options import default_options
from eitskin.solve import Batch, Reconstructor, reconstruct_many
from eitskin.solve.batch import check_threads
from small_models import small, small_blob, small_model

COUNT = 70


def one_by_one(
    engine: str, frames: np.ndarray, untouched: np.ndarray
) -> list[Reconstruction | str]:
    solver = Reconstructor(small_model(), engine=engine)
    solver.tare(untouched)
    found: list[Reconstruction | str] = []
    for frame in frames:
        solver.forget()
        try:
            found.append(solver.reconstruct(frame))
        except FrameError as error:
            found.append(str(error))
    return found


@pytest.mark.parametrize("engine", ["c", "c64"])
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_the_same_as_one_after_another(engine, threads):
    frames, untouched = small().frames(41, COUNT), small().untouched(42, 8)
    frames[3, 5:9] = np.nan  # left out; the basis is made again, and once more for the next frame
    frames[11] = np.nan  # refused
    frames[20] = 0.0
    frames[30] = untouched.mean(axis=0)  # no touch
    batch = Batch(small_model(), threads=threads, engine=engine)
    batch.tare(untouched)
    expected = one_by_one(engine, frames, untouched)
    results = list(batch.each(frames))
    assert len(results) == COUNT and sum(isinstance(result, FrameError) for result in results) == 2
    for one, other in zip(expected, results, strict=True):
        if isinstance(one, str):
            assert one == str(other)
            continue
        assert isinstance(other, Reconstruction)
        assert (
            one.solver_image.tobytes() == other.solver_image.tobytes()
            and one.solver_image.dtype == other.solver_image.dtype
        )
        assert one.coefficients.tobytes() == other.coefficients.tobytes()
        assert one.touches == other.touches  # ids too
        assert one.info == other.info
    touches = sum(len(one.touches) for one in results if isinstance(one, Reconstruction))
    assert touches > COUNT // 2


def test_a_second_batch_and_no_touches():
    frames, untouched = small().frames(43, 9), small().untouched(42, 8)
    batch = Batch(small_model(), threads=2, blob=small_blob())
    assert batch.tare(untouched[0]).frames == 1
    first = [r for r in batch.each(frames) if isinstance(r, Reconstruction)]
    again = [r for r in batch.each(frames, touches=False) if isinstance(r, Reconstruction)]
    assert [r.solver_image.tobytes() for r in first] == [r.solver_image.tobytes() for r in again]
    assert any(r.touches for r in first) and not any(r.touches or r.info.touch_macs for r in again)
    assert list(batch.each(frames[:0])) == []


def test_options_masks_and_engines_reach_every_thread():
    frames, untouched = small().frames(44, 12), small().untouched(42, 8)
    options = replace(default_options(small_model()), iterations=7, sign="both", diagnostics=0)
    mask = np.zeros(frames.shape[1], dtype=np.bool_)
    mask[:6] = True
    batch = Batch(small_model(), threads=3, options=options)
    batch.mask_rows(mask)
    batch.tare(untouched)
    for result in batch.each(frames):
        assert isinstance(result, Reconstruction)
        assert result.info.iterations in (0, 7) and result.info.masked == 6


def test_reconstruct_many_names_the_frame():
    frames, untouched = small().frames(45, 5), small().untouched(42, 8)
    results = reconstruct_many(small_model(), frames, untouched, threads=2)
    expected = one_by_one("c", frames, untouched)
    assert [one.info.macs for one in results] == [one.info.macs for one in expected]
    frames[4] = np.nan
    with pytest.raises(FrameError, match=r"^frame 4 \(from 0\): "):
        reconstruct_many(small_model(), frames, untouched, threads=2)


def test_c_runs_without_pythons_lock():
    """While one thread is in C, this one counts: it would stand still for as long if the lock were
    held."""
    frames, untouched = small().frames(46, 4), small().untouched(42, 8)
    options = replace(default_options(small_model()), iterations=60_000, solver="fista")
    batch = Batch(small_model(), threads=1, options=options)
    batch.tare(untouched)
    counted, done = [0], threading.Event()

    def work() -> None:
        list(batch.each(frames))
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        counted[0] += 1
    thread.join()
    assert counted[0] > 10_000


def test_refusals():
    for threads in (0, -1, 257):
        with pytest.raises(UsageError, match="1 to 256"):
            Batch(small_model(), threads=threads)
    assert check_threads(None) >= 1
    with pytest.raises(UsageError, match="numpy"):
        Batch(small_model(), engine="numpy")
    batch = Batch(small_model(), threads=1)
    for use in (batch.tare, lambda frames: list(batch.each(frames))):
        with pytest.raises(FrameError, match="protocol has 208 rows"):
            use(np.zeros((4, 7)))
    unready = list(batch.each(small().frames(47, 2)))
    assert all(isinstance(result, FrameError) for result in unready)
