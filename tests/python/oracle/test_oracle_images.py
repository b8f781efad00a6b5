"""Whitened data and images of the C core in both widths beside the oracle's: the same FISTA, the
same lambda, so that what differs is rounding.

S'y, the data as every pixel sees them, is compared by the first step of FISTA from zero: with a
lambda of nothing its coefficients are S'y / L.
"""

import struct
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from all_engines import AllEngines
from eitm_bytes import sealed, sections_of
from eitskin.core.results import Reconstruction
from eitskin.errors import FrameError
from eitskin.model.build import BuildSettings, linearise, make_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.model.model import Model
from eitskin.oracle.engine import OracleEngine
from eitskin.oracle.lasso import Lasso
from eitskin.skin.protocol import adjacent, table
from eitskin.solve.reconstructor import ENGINES, Reconstructor
from small_models import (
    DATA_KINDS,
    ELEMENTS,
    PIXELS,
    SIGNS,
    STORAGES,
    Small,
    prebuilt,
    session,
    small,
    small_blob,
    small_model,
)

FRAMES = 10
DATA = {"iterations": 1, "lambda_abs": 1e-30, "sign": "both"}
# Bounds of the errors: of S'y relative to its greatest value, and of images relative to their
# peaks. The stored U is orthogonal only within float32's rounding, and the two programs sum
# differently: C sums over the rows left out or over those in use, whichever are fewer, and the
# oracle over those in use. The bounds of images are for 60 iterations, which enlarge differences.
EXACT = {"c64": (1e-12, 1e-11), "c": (4e-6, 2e-4)}
STORED = {"c64": (4e-6, 4e-5), "c": (4e-6, 5e-4)}  # of a raised regularisation
WHITENED = {"c64": (5e-5, 5e-3), "c": (1e-4, 1e-2)}


def narrow(frames: np.ndarray) -> np.ndarray:
    """Voltages that float32 holds exactly: what rounds them is not the core's arithmetic."""
    return frames.astype(np.float32).astype(float)


def without(electrodes: list[int], frame: np.ndarray) -> np.ndarray:
    """Rows of these electrodes are no numbers."""
    out = frame.copy()
    out[np.isin(small().protocol.drive_measure, electrodes).any(axis=1)] = np.nan
    return out


def off(results: dict[str, Reconstruction], name: str) -> float:
    """The greatest difference to the oracle's image over its peak."""
    mine, expected = results[name].solver_image, results["numpy"].solver_image
    assert np.abs(expected).max() > 0
    return float(np.abs(mine - expected).max() / np.abs(expected).max())


def agree(
    made: AllEngines, frames: np.ndarray, bounds: dict[str, tuple[float, float]], sign: str
) -> None:
    """S'y and images of ``frames`` are within ``bounds``; lambda is a twentieth of lambda_max."""
    worst = {name: [0.0, 0.0] for name in bounds}
    for frame in frames:
        made.set_options(**{**DATA, "solver": "fista", "detection_factor": 0.0})
        data = made.reconstruct(frame, touches=False)
        top = data["numpy"].info.lambda_max
        made.set_options(iterations=60, lambda_abs=0.05 * top, sign=sign)
        images = made.reconstruct(frame, touches=False)
        for name, found in worst.items():
            assert data[name].info.masked == data["numpy"].info.masked
            found[0], found[1] = max(found[0], off(data, name)), max(found[1], off(images, name))
    assert all(worst[name][k] <= bounds[name][k] for name in bounds for k in (0, 1)), worst


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("drift", [True, False], ids=["project", "keep"])
def test_whole_frames(storage, data_kind, drift):
    made = AllEngines(small_model(storage, data_kind), project_reference=drift)
    for seed, sign in enumerate(SIGNS):
        made.tare(narrow(small().untouched(1, 8) if drift else small().linear.v0_v))
        agree(made, narrow(small().frames(5 + seed, FRAMES // 3, sign)), EXACT, sign)


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", ["f32", "i8"])
def test_one_row_of_a_pair_stands_for_both(storage, data_kind):
    """Masked from the start or missing in a frame: the fold is there, and nothing is whitened."""
    fold, rng = small().protocol.reciprocal_pairs(), np.random.default_rng(8)
    made = AllEngines(small_model(storage, data_kind), diagnostics=0)
    mask = np.zeros(208, dtype=bool)
    mask[fold.first[rng.choice(104, 6, replace=False)]] = True
    frames = narrow(small().frames(9, FRAMES))
    for k, frame in enumerate(frames):
        frame[fold.second[[k, 2 * k + 1]][~mask[fold.first[[k, 2 * k + 1]]]]] = np.nan
    made.mask_rows(mask)
    made.tare(narrow(small().untouched(1, 8)))
    agree(made, frames, EXACT, "increase")


@cache
def turned(data_kind: str) -> tuple[Small, Model]:
    """A skin whose every third row measures the other way round than its reciprocal."""
    rows = adjacent(16).drive_measure.astype(int)
    rows[::3] = rows[::3][:, [0, 1, 3, 2]]
    skin, protocol = small().skin, table(16, rows)
    linear = linearise(skin, protocol, pixels_across=PIXELS, elements=ELEMENTS)
    settings = BuildSettings(rank=37, data_kind=data_kind)
    model = make_model(skin, protocol, linear, settings)
    return Small(skin, protocol, linear), decode_model(encode_model(model), "turned")


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_reciprocals_that_are_measured_the_other_way_round(data_kind):
    """Differences turn with them, ratios do not: one row stands for both as before."""
    s, model = turned(data_kind)
    assert (model.fold.sign < 0).any() and (model.fold.sign > 0).any()
    made = AllEngines(model, diagnostics=0)
    made.tare(narrow(s.untouched(1, 8)))
    frames = narrow(s.frames(5, 3))
    frames[1, model.fold.first[::2]] = np.nan
    frames[2, model.fold.second[1::2]] = np.nan
    agree(made, frames, EXACT, "increase")
    whole, first, second = (
        made["numpy"].reconstruct(f, touches=False).solver_image for f in frames
    )
    assert whole.any() and first.any() and second.any()


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", STORAGES)
def test_rows_left_out_are_whitened_as_if_they_had_never_been_there(storage, data_kind):
    """A pair, then one, two, three electrodes."""
    fold = small().protocol.reciprocal_pairs()
    made = AllEngines(small_model(storage, data_kind), max_masked=208)
    made.tare(narrow(small().untouched(1, 8)))
    frames = narrow(small().frames(15, 4))
    frames[0, [fold.first[10], fold.second[10]]] = np.nan
    for k in (1, 2, 3):
        frames[k] = without([3, 8, 13][:k], frames[k])
    agree(made, frames, WHITENED, "increase")


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", ["f32", "i8"])
def test_a_noisy_tare_raises_the_regularisation(storage, data_kind):
    """Tenfold, and another with an electrode out."""
    made = AllEngines(small_model(storage, data_kind), diagnostics=0)
    made.tare(narrow(small().untouched(1, 8, noise=0.02)))
    frames = narrow(small().frames(5, 4, noise=0.02))
    agree(made, frames, STORED, "increase")
    agree(made, np.array([without([3], frames[3])]), WHITENED, "increase")
    for frame in (frames[0], without([3], frames[3])):
        found = [one.info.regularisation for one in made.reconstruct(frame).values()]
        assert min(found) > 0.06 and found == pytest.approx([found[0]] * 3, rel=1e-6)


def row_factors(log_sd: float) -> np.ndarray:
    """A factor for each row (208,) of the paper's skin, the same for a row and its reciprocal;
    their logarithms have the rms ``log_sd``, and leave the norm of the reference."""
    fold, factors = prebuilt()[0].fold, np.ones(208)
    logs, norm = np.random.default_rng(8).normal(size=104), prebuilt()[0].v_ref_v.astype(float)
    for _ in range(50):
        logs = logs * log_sd / np.sqrt(np.mean(logs**2))
        logs -= np.log(np.linalg.norm(norm * np.exp(logs)) / np.linalg.norm(norm))
    factors[fold.first] = np.exp(logs)
    factors[fold.second] = factors[fold.first]
    return factors


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("as it is", lambda v: v),
        ("an uneven skin", lambda v: v * row_factors(0.12)),
        ("an uneven skin at the limit", lambda v: v * row_factors(0.27)),
        ("another beyond the limit", lambda v: v * row_factors(0.29)),
        ("another instrument", lambda v: v * row_factors(0.4)),
        ("turned wires, another unit", lambda v: -1000 * v),
    ],
)
@pytest.mark.parametrize("row_gains", [0, 1])
def test_row_gains(name: str, spoil: Callable[[np.ndarray], np.ndarray], row_gains):
    """Row gains are used if the skin differs, and not if the instrument does."""
    made = AllEngines(*prebuilt(), row_gains=row_gains)
    made.tare(narrow(spoil(session().untouched_v)))
    frames = narrow(spoil(session().frames_v[:3]))
    agree(made, frames, STORED, "increase")
    for result in made.reconstruct(frames[0], touches=False).values():
        assert ("unlike the model" in result.info.diagnostics_by_name) == (name[:7] == "another")


# ---- what is learned and what is said ----


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("count", [1, 3, 4, 5, 21])
def test_what_is_learned_of_a_reference(data_kind, count):
    made = AllEngines(small_model("f16", data_kind))
    learned = made.tare(narrow(small().untouched(3, count)))
    for name, bound in (("c64", 1e-7), ("c", 1e-3)):
        for field in ("correlation", "gain", "v0_rms_v", "noise_v", "lambda_noise"):
            expected = getattr(learned["numpy"], field)
            assert (expected == 0) == (count < 4 and "noise" in field)
            assert getattr(learned[name], field) == pytest.approx(expected, rel=bound), field


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_noise_of_rows_left_out(data_kind):
    """C estimates by eight sign vectors how rows left out raise lambda_noise, and takes the factor
    that keeps a lost direction regular for data. On electrodes left out, one to three of every
    kind, that is within 15 % of the definition, and within 6 % in three of four."""
    made, ratios = AllEngines(small_model("f32", data_kind), engines=("c64", "numpy")), []
    made.set_options(max_masked=208)
    made.tare(small().untouched(1, 8))
    frame = small().frames(4, 1)[0]
    for count in (1, 2, 3):
        for first in range(0, 16, 3):
            lost = [(first + 5 * k) % 16 for k in range(count)]
            info = [r.info for r in made.reconstruct(without(lost, frame), touches=False).values()]
            ratios.append(info[0].lambda_noise / info[1].lambda_noise - 1)
    far = np.abs(ratios)
    assert far.max() < 0.15 and np.quantile(far, 0.75) < 0.06, np.round(far, 3)


@pytest.mark.parametrize("lost", [[], [3], [3, 8, 13]], ids=str)
def test_a_touch_must_stand_out_of_the_noise_of_the_rows_in_use(lost):
    """With a factor that puts the threshold a fifth below or above lambda_max, by the definition's
    lambda_noise: within the 15 % by which C's may differ."""
    made = AllEngines(small_model(), max_masked=208, lambda_noise_factor=0.0)
    made.tare(narrow(small().untouched(1, 8)))
    frame = without(lost, narrow(small().frames(4, 1)[0]))
    made.set_options(detection_factor=0.0)
    info = made["numpy"].reconstruct(frame, touches=False).info
    for share in (0.8, 1.2):
        made.set_options(detection_factor=share * info.lambda_max / info.lambda_noise)
        stops = {one.info.stop for one in made.reconstruct(frame, touches=False).values()}
        assert stops == {"iterations" if share < 1 else "below-threshold"}


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_what_is_said_of_a_frame(data_kind):
    made = AllEngines(small_model("f16", data_kind), solver="fista", detection_factor=1.2)
    made.tare(narrow(small().untouched(3, 21)))
    made.set_options(lambda_rel=0.05)
    infos = {n: r.info for n, r in made.reconstruct(narrow(small().frames(4, 1)[0])).items()}
    expected = infos["numpy"]
    for name, bound in (("c64", 1e-5), ("c", 3e-3)):
        for field in ("lambda_", "lambda_max", "residual", "data_norm", "gap", "gap_rel"):
            known = pytest.approx(
                getattr(expected, field), rel=bound * (30 if "gap" in field else 1)
            )
            assert getattr(infos[name], field) == known, field
        assert (infos[name].nonzeros, infos[name].stop) == (expected.nonzeros, expected.stop)


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_images_from_a_warm_start(data_kind):
    """A touch that moves, jumps, lifts; a frame with dropouts and one that is refused in
    between."""
    made, frames = AllEngines(small_model("f32", data_kind), warm_start=True, solver="fista"), []
    s = small()
    for k in range(16):
        place = (-30 + 3 * k, 10) if k < 10 else (0, -35)
        near = np.linalg.norm(s.linear.grid.centres_mm() - place, axis=1) <= 9
        frames.append(s.linear.v0_v + s.linear.jacobian @ (0.03 * near * (k < 13)))
    noisy = narrow(np.array(frames) + s.untouched(4, 16) - s.linear.v0_v)
    noisy[7, s.protocol.reciprocal_pairs().first[:40]] = np.nan
    made.tare(narrow(s.untouched(1, 8)))
    made.set_options(iterations=60, lambda_abs=1e30)
    top = made["numpy"].reconstruct(noisy[0], touches=False).info.lambda_max
    made.set_options(lambda_abs=0.05 * top)
    for k, frame in enumerate(noisy):
        if k == 9:
            for one in made.values():
                with pytest.raises(FrameError):
                    one.reconstruct(np.zeros(208))
        results = made.reconstruct(frame, touches=False)
        if results["numpy"].solver_image.any():
            assert off(results, "c64") <= 1e-10 and off(results, "c") <= 3e-4
        assert len({one.info.stop for one in results.values()}) == 1


@pytest.mark.parametrize(("factor", "halvings"), [(1 / 3, 1), (1 / 16, 4), (1e-9, 8)])
@pytest.mark.parametrize("solver", ["fista", "working-set"])
@pytest.mark.parametrize("engine", ["c", "c64"])
def test_recovery_from_a_step_too_long(factor, halvings, solver, engine):
    """A model that understates its Lipschitz constant: the step is halved until the run converges,
    as the oracle's gap says, or it is given up as zero."""
    blob = bytearray(small_blob())
    place = sections_of(blob)["DIMS"].offset + 56
    struct.pack_into("<f", blob, place, factor * struct.unpack_from("<f", blob, place)[0])
    wrong = decode_model(sealed(blob), "x")
    made = Reconstructor(wrong, engine=engine, blob=sealed(blob))
    made.set_options(iterations=300, gap_every=5, detection_factor=0.0, solver=solver)
    made.tare(small().linear.v0_v)
    result, oracle = made.reconstruct(small().frames(9, 1)[0], touches=False), OracleEngine(wrong)
    oracle.set_reference(small().linear.v0_v[None])
    seen = oracle.explain(small().frames(9, 1)[0])
    p = Lasso(seen.s, seen.y, result.info.lambda_, "increase")
    assert result.info.step_halvings == halvings
    if factor > 1e-6:
        assert result.info.stop == "iterations"
        assert p.gap(result.coefficients.astype(float)) < 0.01 * p.gap(np.zeros(p.s.shape[1]))
    else:
        assert result.info.stop == "diverged" and not result.solver_image.any()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_frame_does_not_depend_on_those_before(engine):
    """Without a warm start the order of frames is nothing to an image, dropouts or not."""
    s = small()
    frames, fold = s.frames(12, 4), s.protocol.reciprocal_pairs()
    frames[1, fold.first[20:60]] = np.nan
    frames[2, fold.second[20:60]] = np.nan
    frames[3, [fold.first[5], fold.second[5]]] = np.nan
    made = Reconstructor(small_model(), engine=engine)
    made.tare(s.untouched(1, 8))
    images: dict[int, np.ndarray] = {}
    for order in ((0, 1, 2, 3), (3, 2, 1, 0), (3, 1, 0, 2)):
        for k in order:
            image = made.reconstruct(frames[k], touches=False).solver_image
            assert (images.setdefault(k, image) == image).all(), (order, k)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_row_masked_at_the_reference_stays_out_until_the_next(engine):
    s, made = small(), Reconstructor(small_model(), engine=engine)
    mask = np.zeros(208, dtype=bool)
    mask[3:9] = True
    made.mask_rows(mask)
    made.tare(s.untouched(1, 8))
    frame = s.frames(6, 1)[0]
    masked = made.reconstruct(frame, touches=False)
    made.mask_rows(np.zeros(208, dtype=bool))
    still = made.reconstruct(frame, touches=False)
    assert masked.info.masked == still.info.masked == 6
    assert (masked.solver_image == still.solver_image).all()
    made.tare(s.untouched(1, 8))
    assert made.reconstruct(frame, touches=False).info.masked == 0


def test_the_engine_numpy_has_no_memory_and_counts_no_work():
    """Options of the reference tracking change nothing; a limit of
    multiply-accumulates is refused (test_reconstructor)."""
    frames = session().frames_v[:2]
    plain, tracked = (Reconstructor(prebuilt()[0], engine="numpy") for _ in range(2))
    tracked.set_options(reference_frames=2)
    for one in (plain, tracked):
        one.tare(session().untouched_v)
    for frame in frames:
        ours, theirs = plain.reconstruct(frame), tracked.reconstruct(frame)
        assert ours.touches == theirs.touches and (ours.solver_image == theirs.solver_image).all()
        assert [touch.id for touch in ours.touches] == [*range(1, 1 + len(ours.touches))]
        assert replace(ours.info, macs=0, touch_macs=0) == ours.info
