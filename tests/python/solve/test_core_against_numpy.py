"""The C core in both widths against the numpy reference: the same options, the same lambda, after
exactly 60 iterations."""

import struct

import numpy as np
import pytest

from all_engines import AllEngines
from eitm_bytes import sealed, sections_of
from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Reconstruction
from eitskin.errors import FrameError
from eitskin.model.eitm import decode_model
from eitskin.solve.reconstructor import ENGINES, Reconstructor
from small_models import DATA_KINDS, SIGNS, STORAGES, small, small_blob, small_model

FRAMES = 20
F64_BOUND = 1e-12
# relative to a frame's own peak; the worst, .8e-4 and 1.1e-4, is a frame that is noise, its peak a
# tenth of the others'
F32_BOUND = {"fista": 1e-4, "working-set": 1.2e-4, "active-set": 1.5e-4}
FISTAS = ("fista", "working-set")
SOLVED = ("iterations", "optimum")


@pytest.fixture(params=SOLVERS)
def solver(request) -> str:
    return str(request.param)


def engines(storage: str, data_kind: str, solver: str, **options: object) -> AllEngines:
    """Without a gate."""
    options = {"iterations": 60, "detection_factor": 0.0, "solver": solver, **options}
    return AllEngines(small_model(storage, data_kind), **options)


def share_lambda(made: AllEngines, frame: np.ndarray) -> None:
    """Give all engines the lambda that is a twentieth of numpy's lambda_max for ``frame``."""
    made["numpy"].set_options(lambda_abs=1e30)
    greatest = made["numpy"].reconstruct(frame, touches=False).info.lambda_max
    made.set_options(lambda_abs=0.05 * greatest)


def narrow(frames: np.ndarray) -> np.ndarray:
    """Voltages that float32 holds exactly, so that all widths get the same: rounding them is not
    the core's arithmetic, and a weak touch is a small difference of large voltages."""
    return frames.astype(np.float32).astype(np.float64)


def difference(result: Reconstruction, expected: Reconstruction) -> float:
    """The greatest difference of the images over the expected peak; a zero image must be zero in
    both."""
    peak = float(np.abs(expected.image).max())
    assert (peak > 0) == bool(np.abs(result.image).max() > 0) == (expected.info.stop in SOLVED)
    # rounding ends at the optimum, a little sooner or later
    if "optimum" not in (result.info.stop, expected.info.stop):
        assert result.info.iterations == expected.info.iterations
        assert result.info.stop == expected.info.stop
    assert (result.info.stop in SOLVED) == (expected.info.stop in SOLVED)
    assert result.info.masked == expected.info.masked
    return float(np.abs(result.image - expected.image).max()) / (peak or 1.0)


def agree(made: AllEngines, frames: np.ndarray, *, keep: bool = False) -> dict[str, float]:
    """The worst difference of each width over ``frames``; ``keep`` what an engine remembers from
    frame to frame."""
    worst = {"c64": 0.0, "c": 0.0}
    for frame in frames:
        if not keep:
            share_lambda(made, frame)
            made.forget()
        results = made.reconstruct(frame, touches=False)
        solver, info = made["numpy"].options.solver, results["numpy"].info
        assert info.iterations == 60 or info.stop == "optimum" or (keep and info.stop == "zero")
        assert info.stop != "optimum" or solver not in FISTAS
        for name in worst:
            worst[name] = max(worst[name], difference(results[name], results["numpy"]))
    return worst


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("drift", [True, False], ids=["project", "keep"])
def test_same_images(storage, data_kind, drift, solver):
    made = engines(storage, data_kind, solver, project_reference=drift)
    for seed, sign in enumerate(SIGNS):
        made.set_options(sign=sign, lambda_abs=0.0)
        made.tare(narrow(small().quiet(1, 8) if drift else small().linear.v0_v))
        worst = agree(made, narrow(small().frames(5 + seed, FRAMES, sign)))
        assert worst["c64"] <= F64_BOUND and worst["c"] <= F32_BOUND[solver], (sign, worst)


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", ["f32", "i8"])
def test_same_images_with_rows_left_out(storage, data_kind, solver):
    """Rows masked from the start, one of a reciprocal pair or both, and others that drop out in
    single frames."""
    s, generator = small(), np.random.default_rng(8)
    made = engines(storage, data_kind, solver)
    mask = np.zeros(208, dtype=bool)
    mask[generator.choice(208, 12, replace=False)] = True
    fold = s.protocol.reciprocal_pairs()
    mask[[fold.first[10], fold.second[10]]] = True
    frames = s.frames(9, FRAMES)
    for k, frame in enumerate(frames):
        frame[generator.choice(208, k % 6, replace=False)] = (np.nan, np.inf)[k % 2]
    made.mask_rows(mask)
    made.tare(s.quiet(1, 8))
    worst = agree(made, frames)
    assert worst["c64"] <= F64_BOUND and worst["c"] <= F32_BOUND[solver], worst


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", STORAGES)
def test_same_images_without_electrodes(storage, data_kind, solver):
    """One, two, three electrodes out, of each sign: what is left is whitened again. In float32 its
    factors lose what the low regularisation does not hold, and noise in the data's last figure is
    raised as all noise is; float64 has the reference's answer.
    """
    s = small()
    made = engines(storage, data_kind, solver, max_masked=208)
    worst = {"c64": 0.0, "c": 0.0}
    for seed, sign in enumerate(SIGNS):
        made.set_options(sign=sign, lambda_abs=0.0)
        made.tare(narrow(s.quiet(1, 8)))
        frames = narrow(s.frames(15 + seed, 6, sign))
        for k, frame in enumerate(frames):
            lost = np.arange(3, 4 + k % 3) * 5 % 16
            frame[np.isin(s.protocol.drive_measure, lost).any(axis=1)] = np.nan
        found = agree(made, frames)
        worst = {name: max(worst[name], found[name]) for name in worst}
    most = 1e-2 if data_kind == "log-ratio" else 3e-3
    assert worst["c64"] <= 1e-10 and worst["c"] <= most, worst


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", ["f32", "i8"])
def test_same_images_after_a_noisy_tare(storage, data_kind, solver):
    """The regularisation is raised tenfold; also with an electrode out."""
    s, made = small(), engines(storage, data_kind, solver)
    made.tare(narrow(s.quiet(1, 8, noise=0.02)))
    frames = narrow(s.frames(5, 8, noise=0.02))
    frames[5:, (s.protocol.drive_measure == 3).any(axis=1)] = np.nan
    worst = agree(made, frames)
    assert worst["c64"] <= 1e-11 and worst["c"] <= 4 * F32_BOUND[solver], worst
    for k in (0, 6):
        found = [one.info.regularisation for one in made.reconstruct(frames[k]).values()]
        assert min(found) > 0.06 and found == pytest.approx([found[0]] * len(found), rel=1e-4)


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_same_facts_without_an_electrode(data_kind, solver):
    """Also where it was out when the reference was learned."""
    s, made = small(), engines("f32", data_kind, solver)
    out = (s.protocol.drive_measure == 9).any(axis=1)
    frame = s.frames(4, 1)[0]
    frame[(s.protocol.drive_measure == 4).any(axis=1)] = np.nan
    for masked in (np.zeros(208, dtype=bool), out):
        made.mask_rows(masked)
        made.tare(s.quiet(3, 21))
        made.set_options(lambda_abs=0.0, lambda_rel=0.05, detection_factor=1.2)
        results = made.reconstruct(frame)
        expected, wide = results["numpy"], results["c64"]
        assert expected.touches and expected.info.stop in SOLVED
        for field in ("lambda_", "lambda_max", "lambda_noise", "residual", "data_norm"):
            known = getattr(expected.info, field)
            assert getattr(wide.info, field) == pytest.approx(known, rel=1e-8), field
        for one, other in zip(wide.touches, expected.touches, strict=True):
            size = other.x_mm, other.y_mm, other.radius_mm
            assert (one.x_mm, one.y_mm, one.radius_mm) == pytest.approx(size, abs=1e-6)


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_same_images_from_a_warm_start(data_kind, solver):
    """A touch that moves, jumps, lifts; a frame that is refused and one with dropouts in
    between."""
    s = small()
    made = engines("f32", data_kind, solver, warm_start=True)
    grid = s.linear.grid
    frames = []
    for k in range(FRAMES):
        place = (-30 + 3 * k, 10) if k < 13 else (0, -35)
        near = np.linalg.norm(grid.centres_mm() - place, axis=1) <= 9
        change = 0.03 * near if k < 16 else np.zeros(len(near))
        frames.append(s.linear.v0_v + s.linear.jacobian @ change)
    noisy = np.array(frames) + s.quiet(4, FRAMES) - s.linear.v0_v
    noisy[7, :40] = np.nan
    for reconstructor in made.values():
        reconstructor.tare(s.quiet(1, 8))
    share_lambda(made, noisy[0])
    made.tare(s.quiet(1, 8))
    share_lambda(made, noisy[0])
    made.forget()
    first = agree(made, noisy[:10], keep=True)
    for reconstructor in made.values():
        with pytest.raises(FrameError):
            reconstructor.reconstruct(np.zeros(208))
    second = agree(made, noisy[10:], keep=True)
    assert max(first["c64"], second["c64"]) <= F64_BOUND
    assert max(first["c"], second["c"]) <= F32_BOUND[solver]


@pytest.mark.parametrize(("factor", "halvings"), [(1 / 3, 1), (1 / 16, 4), (1e-9, 8)])
@pytest.mark.parametrize("solver", FISTAS)
def test_same_recovery_from_a_step_too_long(factor, halvings, solver):
    """A model that understates its Lipschitz constant: the step is halved and the run starts over,
    or is given up as zero."""
    blob = bytearray(small_blob())
    place = sections_of(blob)["DIMS"].offset + 56
    struct.pack_into("<f", blob, place, factor * struct.unpack_from("<f", blob, place)[0])
    sealed_blob = sealed(blob)
    options = {"iterations": 300, "gap_every": 5, "detection_factor": 0.0, "solver": solver}
    made = AllEngines(decode_model(sealed_blob, "x"), sealed_blob, **options)
    made.tare(small().linear.v0_v)
    results = made.reconstruct(small().frames(9, 1)[0])
    expected = results["numpy"]
    assert expected.info.step_halvings == halvings
    assert expected.info.stop == ("iterations" if factor > 1e-6 else "diverged")
    for name, bound in (("c64", 1e-10), ("c", 1e-3)):
        found = results[name].info.step_halvings, results[name].info.stop
        assert found == (halvings, expected.info.stop)
        off = np.abs(results[name].image - expected.image).max()
        assert off <= bound * np.abs(expected.image).max()


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_same_facts(data_kind, solver):
    """LearnedReference and info of float64 C are the reference's."""
    made = engines("f16", data_kind, solver)
    baselines = made.tare(small().quiet(3, 21))
    made.set_options(lambda_abs=0.0, lambda_rel=0.05, detection_factor=1.2)
    results = made.reconstruct(small().frames(4, 1)[0])
    infos = {name: result.info for name, result in results.items()}
    for name, bound in (("c64", 1e-10), ("c", 1e-4)):
        for field in ("correlation", "gain", "v0_rms_v", "noise_v", "lambda_noise"):
            expected = getattr(baselines["numpy"], field)
            assert expected != 0
            # what is a small difference of voltages keeps fewer figures in float32
            loose = 20 if name == "c" and field in ("noise_v", "lambda_noise") else 1
            tolerance = loose * bound
            assert getattr(baselines[name], field) == pytest.approx(expected, rel=tolerance), field
        # at the optimum the gap is rounding
        nothing = {"gap": bound**1.5 * infos["numpy"].data_norm ** 2, "gap_rel": bound**1.5}
        for field in ("lambda_", "lambda_max", "gap", "gap_rel", "residual", "data_norm"):
            known, least = getattr(infos["numpy"], field), nothing.get(field, 0.0)
            assert getattr(infos[name], field) == pytest.approx(known, rel=30 * bound, abs=least)
        assert infos[name].nonzeros == infos["numpy"].nonzeros
        assert infos[name].touches == infos["numpy"].touches


@pytest.mark.parametrize("engine", ENGINES)
def test_a_frame_does_not_depend_on_those_before(engine):
    """Without a warm start the order of frames is nothing to an image, dropouts or not."""
    s = small()
    frames = s.frames(12, 4)
    fold = s.protocol.reciprocal_pairs()
    frames[1, fold.first[20:60]] = np.nan
    frames[2, fold.second[20:60]] = np.nan
    frames[3, [fold.first[5], fold.second[5]]] = np.nan
    made = Reconstructor(small_model(), engine=engine)
    made.tare(s.quiet(1, 8))
    images = {}
    for order in ((0, 1, 2, 3), (3, 2, 1, 0), (3, 1, 0, 2)):
        for k in order:
            image = made.reconstruct(frames[k]).image
            assert (images.setdefault(k, image) == image).all(), (order, k)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_row_masked_at_the_reference_stays_out_until_the_next(engine):
    s = small()
    made = Reconstructor(small_model(), engine=engine)
    mask = np.zeros(208, dtype=bool)
    mask[3:9] = True
    made.mask_rows(mask)
    made.tare(s.quiet(1, 8))
    frame = s.frames(6, 1)[0]
    masked = made.reconstruct(frame)
    made.mask_rows(np.zeros(208, dtype=bool))
    still = made.reconstruct(frame)
    assert masked.info.masked == still.info.masked == 6
    assert (masked.image == still.image).all()
    made.tare(s.quiet(1, 8))
    assert made.reconstruct(frame).info.masked == 0
