"""The reconstructor as users see it: its refusals, the errors after which it still works, and its
messages."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.results import Options
from eitskin.errors import EitskinError, FrameError, ModelError, ProtocolError, UsageError
from eitskin.model.options import default_options
from eitskin.skin.protocol import adjacent, opposite, table
from eitskin.solve.reconstructor import ENGINES, Reconstructor
from small_models import prebuilt, session, small, small_blob, small_model, tiny_blob


def made(engine: str = "c", untouched: bool = True, **options: object) -> Reconstructor:
    """On the prebuilt model, tared on the session's 64 untouched frames."""
    model, blob = prebuilt()
    reconstructor = Reconstructor(model, engine=engine, blob=blob)
    reconstructor.set_options(**options)
    if untouched:
        reconstructor.tare(session().untouched_v)
    return reconstructor


@pytest.fixture(params=ENGINES)
def engine(request) -> str:
    return str(request.param)


def one_line(error: pytest.ExceptionInfo[EitskinError]) -> str:
    assert "\n" not in str(error.value)
    return str(error.value)


# ---- frames and protocols ----


@pytest.mark.parametrize(
    "other", [adjacent(32), opposite(16), table(16, adjacent(16).drive_measure[::-1])]
)
def test_another_protocol_is_refused_by_both_hashes(other):
    with pytest.raises(ProtocolError) as error:
        made().check_protocol(other)
    text = one_line(error)
    assert f"{other.hash:016x}" in text and f"{prebuilt()[0].protocol.hash:016x}" in text
    assert f"{other.n_electrodes} electrodes, {other.n_rows} rows" in text
    made().check_protocol(adjacent(16, current_a=5e-3))


def test_frames_and_references_of_another_shape(engine):
    reconstructor = made(engine)
    neither = np.ones(207), np.ones(209), np.ones(0), 1.0, "volts", [1, [2]]
    for frame in (*neither, np.ones((2, 208))):
        with pytest.raises(FrameError) as error:
            reconstructor.reconstruct(frame)
        assert one_line(error)
    several = (
        np.ones((2, 5)),
        np.ones((0, 208)),
        np.ones((2, 2, 208)),
        [],
        [[1.0] * 208, [1.0] * 207],
    )
    for frames in (*neither, *several):
        with pytest.raises(FrameError) as error:
            reconstructor.tare(frames)
        assert one_line(error).startswith("reference")


def test_no_frame_before_a_reference(engine):
    with pytest.raises(FrameError, match=r"no reference frame has been set; take it .* tare\(\)$"):
        made(engine, untouched=False).reconstruct(session().frames_v[0])


def test_an_all_zero_reference_is_refused(engine):
    for count in (1, 4, 16):
        with pytest.raises(FrameError, match="all voltages are zero; is the skin driven and conn"):
            made(engine, untouched=False).tare(np.zeros((count, 208)))


def test_an_all_zero_frame_is_a_dead_front_end_not_an_untouched_skin(engine):
    reconstructor = made(engine)
    with pytest.raises(FrameError, match="all voltages are zero"):
        reconstructor.reconstruct(np.zeros(208))
    assert len(reconstructor.reconstruct(session().frames_v[0]).touches) > 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_reference_must_be_whole(engine, value):
    for count in (1, 2, 8):
        untouched = session().untouched_v[:count].copy()
        untouched[count // 2, 11] = value
        where = rf"reference frame {count // 2} \(from 0\): row 11 \(from 0\)"
        with pytest.raises(FrameError, match=where):
            made(engine, untouched=False).tare(untouched)
    masked = made(engine, untouched=False)
    masked.mask_rows(np.arange(208) == 11)
    masked.tare(untouched)
    assert masked.reconstruct(session().frames_v[0]).info.masked == 1


def test_a_refused_single_reference_leaves_the_old_one(engine):
    reconstructor, frame = made(engine), session().frames_v[0]
    before = reconstructor.reconstruct(frame).solver_image
    with pytest.raises(FrameError):
        reconstructor.tare(np.zeros(208))
    assert (reconstructor.reconstruct(frame).solver_image == before).all()


def test_a_refused_series_leaves_no_reference(engine):
    reconstructor = made(engine)
    with pytest.raises(FrameError):
        reconstructor.tare(np.zeros((8, 208)))
    with pytest.raises(FrameError, match="no reference"):
        reconstructor.reconstruct(session().frames_v[0])


# ---- rows that cannot be used ----


def test_too_many_bad_channels(engine):
    """Half of the rows are the default limit; max_masked changes it."""
    reconstructor, frame = made(engine), session().frames_v[0].copy()
    frame[:104] = np.nan
    assert reconstructor.reconstruct(frame).info.masked == 104
    frame[104] = np.nan
    with pytest.raises(FrameError, match="too many rows"):
        reconstructor.reconstruct(frame)
    reconstructor.set_options(max_masked=3)
    frame = session().frames_v[0].copy()
    frame[:4] = np.inf
    with pytest.raises(FrameError, match="too many rows"):
        reconstructor.reconstruct(frame)
    with pytest.raises(FrameError, match="too many rows"):
        reconstructor.reconstruct(np.full(208, np.nan))


def test_saturated_channels_are_left_out(engine):
    reconstructor, frame = made(engine), session().frames_v[1]
    whole = reconstructor.reconstruct(frame)
    limit = 1.5 * float(np.abs(session().untouched_v).max())
    damaged = frame.copy()
    damaged[[3, 50, 171]] = [limit, -limit, 3 * limit]
    assert reconstructor.reconstruct(damaged).info.outliers == 3
    reconstructor.set_options(diagnostics=0)
    spoilt = reconstructor.reconstruct(damaged)
    assert np.abs(spoilt.solver_image - whole.solver_image).max() > whole.solver_image.max()
    reconstructor.set_options(saturation_v=limit)
    saved = reconstructor.reconstruct(damaged)
    assert saved.info.masked == 3
    assert np.abs(saved.solver_image - whole.solver_image).max() < 0.1 * whole.solver_image.max()
    for before in (0, 1, 7):
        with pytest.raises(FrameError, match=f"reference frame {before} .* row 3 .* saturated"):
            reconstructor.tare(np.vstack([session().untouched_v[:before], damaged]))


def test_what_a_numpy_mask_hides_is_a_row_that_cannot_be_used(engine):
    reconstructor, frame = made(engine), session().frames_v[1]
    hidden = np.zeros(208, dtype=bool)
    hidden[[3, 50]] = True
    masked = reconstructor.reconstruct(np.ma.masked_array(frame, hidden))
    missing = reconstructor.reconstruct(np.where(hidden, np.nan, frame))
    assert masked.info.masked == missing.info.masked == 2
    assert np.array_equal(masked.solver_image, missing.solver_image)
    none = reconstructor.reconstruct(np.ma.masked_array(frame, False))
    assert none.info.masked == 0
    with pytest.raises(FrameError, match="row 3 "):
        reconstructor.tare(np.ma.masked_array(session().untouched_v[0], hidden))


def test_masks_of_another_shape(engine):
    reconstructor = made(engine)
    for rows in (np.zeros(207, bool), np.zeros(208), [1, 2], np.zeros((208, 1), bool)):
        with pytest.raises(UsageError, match="one truth value for each of 208 rows"):
            reconstructor.mask_rows(rows)


# ---- untouched skins ----


def test_no_change_gives_no_touch(engine):
    reconstructor = made(engine)
    result = reconstructor.reconstruct(session().reference_v)
    # numpy's mean of the untouched frames is this very frame; the core's differs from it by
    # rounding
    assert result.info.stop in ("below-threshold", "zero")
    assert result.touches == () and not result.solver_image.any()
    reconstructor.tare(session().exact_untouched_v)
    result = reconstructor.reconstruct(session().exact_untouched_v)
    assert result.info.stop == "zero" and result.touches == () and not result.solver_image.any()
    assert result.info.nonzeros == result.info.iterations == 0


# ---- options ----


BAD_OPTIONS = [
    ({"iterations": 0}, "iterations = 0 is out of range; use 1 to"),
    ({"iterations": 2**32}, "iterations"),
    ({"iterations": 2.5}, "iterations = 2.5 must be a whole number"),
    ({"iterations": True}, "iterations"),
    ({"iterations": "30"}, "iterations"),
    ({"gap_every": 0}, "gap_every"),
    ({"max_touches": 17}, "max_touches = 17 is out of range; use 0 to 16"),
    ({"max_masked": -1}, "max_masked"),
    ({"mac_limit": -1}, "mac_limit"),
    ({"diagnostics": 512}, "diagnostics = 512 is out of range; use 0 to 511"),
    ({"touch_fit": 8}, "touch_fit = 8 is out of range: it has bits without a meaning"),
    ({"touch_fit": -1}, "touch_fit"),
    ({"second_pass": 2}, "second_pass = 2 must be true or false"),
    ({"sign": "up"}, "sign = 'up' is not known; use one of increase, decrease, both"),
    ({"solver": "newton"}, "solver = 'newton' is not known; use one of fista, working-set"),
    ({"warm_start": 2}, "warm_start"),
    ({"project_reference": "yes"}, "project_reference"),
    ({"lambda_abs": -1.0}, "lambda_abs"),
    ({"lambda_rel": 1.5}, "lambda_rel = 1.5 is out of range; use 0 to 1"),
    ({"lambda_rel": float("nan")}, "lambda_rel"),
    ({"lambda_noise_factor": float("inf")}, "lambda_noise_factor"),
    ({"detection_factor": -0.1}, "detection_factor"),
    ({"gap_rel": 1.01}, "gap_rel"),
    ({"saturation_v": -3.0}, "saturation_v"),
    ({"touch_threshold": 2.0}, "touch_threshold"),
    ({"touch_min_fraction": -1.0}, "touch_min_fraction"),
    ({"touch_min_radius_mm": 0.0}, "touch_min_radius_mm = 0.0 is out of range"),
    ({"touch_max_radius_mm": 5.0}, "touch radii of"),
    ({"touch_seed_radius_mm": 31.0}, "touch radii"),
    ({"touch_change_s_per_m": -1.0}, "touch_change_s_per_m"),
    ({"touch_radius_weight": None}, "touch_radius_weight"),
    ({"touch_sweeps": 1001}, "touch_sweeps"),
    ({"follow_mm": -1.0}, "follow_mm"),
    ({"touch_sweeps": 1001}, "touch_sweeps = 1001 is out of range; use 0 to 1000"),
    ({"regularisation_noise_factor": -0.5}, "regularisation_noise_factor"),
    ({"row_gains": 2}, "row_gains"),
    ({"touch_test": -1}, "touch_test"),
    ({"noise_floor_v": float("nan")}, "noise_floor_v"),
    ({"test_columns": -1}, "test_columns"),
    ({"touch_seek": 2}, "touch_seek"),
    ({"reference_frames": -1}, "reference_frames"),
    ({"iteration": 5}, "'iteration' is unknown; did you mean 'iterations'"),
]


def test_bad_options_are_named_and_the_old_ones_stay(engine):
    reconstructor = made(engine, iterations=7)
    before = reconstructor.options
    for changes, text in BAD_OPTIONS:
        with pytest.raises(UsageError) as error:
            reconstructor.set_options(**changes)
        assert text in one_line(error)
        assert reconstructor.options == before, changes
        if engine == "c":  # there the core has options of its own
            assert reconstructor.reconstruct(session().frames_v[0]).info.iterations == 7, changes
    assert reconstructor.reconstruct(session().frames_v[0]).info.iterations == 7


def test_the_core_refuses_them_by_itself():
    """Python's check and the core's have the same bounds: what passes here would run on a board."""
    engine = CoreEngine(prebuilt()[1])
    for changes in (one for one, _ in BAD_OPTIONS[:-1] if one.get("iterations") is not True):
        with pytest.raises(UsageError):
            engine.set_options(replace(default_options(prebuilt()[0]), **changes))
            pytest.fail(f"{changes} passed")


EDGES = {
    "iterations": 1, "gap_every": 2**32 - 1, "max_touches": 16, "max_masked": 0, "lambda_rel": 1.0,
    "gap_rel": 1.0,
    "lambda_noise_factor": 1e29, "detection_factor": 0.0,
    "saturation_v": 1e29, "touch_threshold": 1.0,
    "touch_min_fraction": 1.0,
    "touch_min_radius_mm": 2e-6, "touch_max_radius_mm": 1e29, "touch_sweeps": 1000,
    "follow_mm": 0.0, "lambda_abs": 1e29,
    "regularisation_noise_factor": 0.0,
    "touch_fit": 7, "second_pass": True,
}  # fmt: skip


def test_the_edges_of_the_ranges_are_inside_for_all(engine):
    reconstructor = made(engine, untouched=False)
    before = reconstructor.options
    for name, edge in EDGES.items():
        reconstructor.set_options(**{name: edge})
        reconstructor.set_options(**{name: getattr(before, name)})


def test_every_option_has_a_range():
    tried = {name for changes, _ in BAD_OPTIONS[:-1] for name in changes}
    assert tried == set(Options.__dataclass_fields__)


def test_what_options_do(engine):
    frame = session().frames_v[2]
    base = made(engine).reconstruct(frame)
    assert base.info.lambda_ == pytest.approx(0.03 * base.info.lambda_max, rel=1e-6)
    sparse = made(engine, lambda_rel=0.5).reconstruct(frame)
    assert sparse.info.nonzeros < base.info.nonzeros
    assert made(engine, lambda_rel=1.0).reconstruct(frame).info.stop == "zero"
    assert made(engine, detection_factor=1e6).reconstruct(frame).info.stop == "below-threshold"
    assert made(engine, lambda_abs=base.info.lambda_max * 2).reconstruct(frame).info.stop == "zero"
    assert len(made(engine, max_touches=1).reconstruct(frame).touches) == 1
    assert made(engine, max_touches=0).reconstruct(frame).touches == ()
    assert made(engine).reconstruct(frame, touches=False).touches == ()
    gap = made(engine, iterations=10_000, gap_rel=1e-3).reconstruct(frame).info
    assert gap.stop == "gap" and gap.gap_rel <= 1e-3 and gap.iterations % 10 == 0


# ---- files and engines ----


def test_from_a_file(engine, tmp_path):
    path = tmp_path / "small.eitm"
    path.write_bytes(small_blob())
    reconstructor = Reconstructor.from_file(path, engine=engine)
    reconstructor.tare(small().linear.v0_v)
    image = reconstructor.reconstruct(small().frames(1, 1)[0]).solver_image
    assert image.shape == (small_model().grid.n_pixels,)
    path.write_bytes(small_blob()[:-1])
    with pytest.raises(ModelError, match="truncated"):
        Reconstructor.from_file(path)


def test_unknown_engines_and_refused_models():
    with pytest.raises(UsageError, match="engine 'gpu' is not known; use one of c, c64, numpy"):
        Reconstructor(prebuilt()[0], engine="gpu")
    with pytest.raises(ModelError, match="checksum does not fit"):
        CoreEngine(tiny_blob()[:-1] + b"x")


def test_results_do_not_change_afterwards():
    """Images are copies: the next frame does not write into them."""
    reconstructor = made()
    first = reconstructor.reconstruct(session().frames_v[0])
    kept = first.solver_image.copy()
    reconstructor.reconstruct(session().frames_v[1])
    assert (first.solver_image == kept).all()
    assert first.solver_image.dtype == np.float32
    assert made("c64").reconstruct(session().frames_v[0]).solver_image.dtype == np.float64


def test_two_reconstructors_share_nothing():
    a, b = made(), made()
    a.set_options(sign="both", iterations=3)
    assert b.options.iterations == 60
    alone = b.reconstruct(session().frames_v[0]).solver_image
    a.reconstruct(session().frames_v[1])
    assert (b.reconstruct(session().frames_v[0]).solver_image == alone).all()


def test_the_reference_counts_no_macs():
    with pytest.raises(UsageError, match="counts no multiply-accumulates"):
        made("numpy", untouched=False).set_options(mac_limit=5)
