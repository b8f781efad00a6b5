"""The same bits from every build of the kernels: prepared or not, portable or the processor's
own."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Reconstruction
from eitskin.model.options import default_options
from small_models import (
    DATA_KINDS,
    SIGNS,
    STORAGES,
    prebuilt,
    session,
    small,
    small_blob,
    small_model,
)

BUILDS = [(True, False), (False, False), (True, True), (False, True)]


def built(blob: bytes, width: str) -> list[CoreEngine]:
    return [CoreEngine(blob, width, prepared=p, portable=q) for p, q in BUILDS]


def same(results: list[Reconstruction]) -> None:
    first = results[0]
    for other in results[1:]:
        assert (other.solver_image == first.solver_image).all()
        assert (other.coefficients == first.coefficients).all()
        assert other.touches == first.touches
        assert other.info == first.info


@pytest.mark.parametrize("width", ["float32", "float64"])
@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("solver", SOLVERS)
def test_small_models(solver, storage, data_kind, width):
    s, engines = small(), built(small_blob(storage, data_kind), width)
    for sign in SIGNS:
        frames = s.frames(30, 3, sign)
        frames[1, 17:25] = np.nan
        frames[2, (s.protocol.drive_measure == 2).any(axis=1)] = np.nan
        results = []
        for engine in engines:
            chosen = default_options(small_model(storage, data_kind))
            engine.set_options(replace(chosen, solver=solver, sign=sign, warm_start=True))
            engine.set_reference(s.untouched(31, 8))
            engine.forget()
            results.append([engine.reconstruct(frame) for frame in frames])
        for of_builds in zip(*results, strict=True):
            same(list(of_builds))
        assert np.abs(results[0][0].solver_image).max() > 0


@pytest.mark.parametrize("width", ["float32", "float64"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_noisy_tare(solver, width):
    """The regularisation of the whitening is raised."""
    s, engines = small(), built(small_blob("i8"), width)
    for engine in engines:
        engine.set_options(replace(default_options(small_model("i8")), solver=solver))
        engine.set_reference(s.untouched(32, 8, noise=0.01))
    for frame in s.frames(33, 4, noise=0.01):
        results = [engine.reconstruct(frame) for engine in engines]
        same(results)
        assert results[0].info.regularisation == pytest.approx(0.05, rel=0.1)
        assert results[0].solver_image.any()


@pytest.mark.parametrize("width", ["float32", "float64"])
def test_touches_of_simulated_frames(width):
    frames, found, engines = session().as_frames(), 0, built(prebuilt()[1], width)
    for engine in engines:
        engine.set_reference(frames.reference_voltage_v)
    for frame in frames.voltage_v:
        results = [engine.reconstruct(frame) for engine in engines]
        same(results)
        found += len(results[0].touches)
    assert found >= 20


def test_names_and_sizes():
    """The portable kernels report their name. A prepared context is larger by the copies of S and
    of the working set in panels."""
    model, blob = prebuilt()
    portable, bare = CoreEngine(blob, portable=True), CoreEngine(blob, prepared=False)
    assert portable.kernels == "portable"
    to_align = 64 - 16  # panels start at a line of the cache
    assert portable.workspace_bytes - bare.workspace_bytes == 2 * 832 * 64 * 4 + to_align
    wide = CoreEngine(blob, "float64", prepared=False)
    held = 256 * 64 * 4  # held columns are floats in either width
    narrow, wider = bare.workspace_bytes - held, wide.workspace_bytes - held
    assert 1.7 * narrow < wider < 2 * narrow
    assert (bare.n_rows, bare.n_pixels) == (208, model.grid.n_pixels)
