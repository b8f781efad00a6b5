"""Units of model, data and frames from 1e-30 to 1e30: the same image in other units, zero, or a
clean refusal; never rubbish."""

from dataclasses import replace

import numpy as np
import pytest
from made_models import made_blob, made_model
from random_problems import gaussian, rounded
from soundness import Judged, U, check_sound, judged

from eitskin.core.engine import CoreEngine
from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Options
from eitskin.errors import EitskinError, ModelError
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Load, Play, Solve, Step, TareStep
from everywhere import as_float32
from margins import Margins
from small_models import DATA_KINDS, small, small_blob, small_model

CASE, FRAMES_CASE = "problem/units", "problem/units-of-frames"
EXPONENTS = tuple(range(-30, 31, 5))
# the smallest |y| whose square float32 holds with 24 bits to spare, and the largest whose square
# is within its range
MIN_DATA, MAX_DATA = 2.0**-51, 2.0**63
NOT_FINITE = -15


def refused(s: np.ndarray) -> bool:
    """Whether a model of S is refused, in one line."""
    try:
        made_blob(s)
    except ModelError as error:
        assert "\n" not in str(error)
        return True
    return False


def check_scaled(
    margins: Margins, case: str, base: Judged, one: Judged, data_off: float, to_base: float
) -> None:
    """Compare S x of both, in the base's units. At the optimum S x changes by at most the change of
    y, because r = y - S x is the projection of y onto the dual set, and a projection does not
    expand. It changes by the same amount again because lambda follows y. The rounding of S adds u
    |S|_F |x|. With a gap g, S x is within sqrt(2 g) of the optimum's."""
    off = float(np.linalg.norm(base.s @ (one.x * to_base - base.x)))
    size = float(np.linalg.norm(base.y))
    stored = 2 * U * float(np.linalg.norm(base.s)) * float(np.linalg.norm(base.x))
    gaps = sum(
        np.sqrt(2 * (j.gap + j.gap_rounding)) / float(np.linalg.norm(j.y)) * size
        for j in (base, one)
    )
    room = (2 * data_off + stored + gaps) / size
    margins.everywhere(case, "S x in other units", off / size, room, "|y|")


@pytest.mark.parametrize("same_everywhere", ["float32"], indirect=True)
@pytest.mark.parametrize("solver", SOLVERS)
def test_units_of_model_and_data(same_everywhere, margins, solver):
    """S times a, y times b, each alone and both together: x times b / a, while squares are
    numbers."""
    problem = gaussian(1)
    options = problem.options(
        solver=solver, sign="both", iterations=20_000, gap_rel=1e-4, lambda_rel=0.2
    )
    chosen = [(0, 0), *((0, e) for e in EXPONENTS), *((e, 0) for e in EXPONENTS)]
    chosen += [(e, e) for e in EXPONENTS]
    chosen += [(-15, 15), (15, -15), (0, -44), (0, -40), (-18, 0), (18, 0)]
    steps: list[Step] = []
    kept: list[tuple[int, int]] = []
    for a, b in chosen:
        s = rounded(problem.s * 10.0**a)
        assert refused(s) == (abs(a) > 18)
        if abs(a) <= 18:
            steps += [Load(made_blob(s)), Choose(options), Solve(problem.y[None] * 10.0**b)]
            kept.append((a, b))
    _, outcomes = same_everywhere.steps(steps)
    size = float(np.linalg.norm(problem.y))
    base = problem.judged("both", outcomes[0])
    ends = set()
    for (a, b), one in zip(kept, outcomes, strict=True):
        norm = size * 10.0**b
        end = "zero" if norm < MIN_DATA else "solved" if norm < MAX_DATA else "refused"
        ends.add(end)
        assert one.finite()
        if end == "solved":
            s = rounded(problem.s * 10.0**a)
            point = judged(s, problem.y * 10.0**b, "both", one)
            check_sound(margins, CASE, point, one)
            check_scaled(margins, CASE, base, point, U * size, 10.0 ** (a - b))
            continue
        left = np.count_nonzero(one.image)
        margins.everywhere(CASE, "pixels of refused or vanishing data", left, 0, "pixels")
        assert one.status == (NOT_FINITE if end == "refused" else 0)
        assert one.info.stop == ("diverged" if end == "refused" else "zero") and one.touches == ()
    assert ends == {"zero", "solved", "refused"}


def reduced(
    model: Model,
    blob: bytes,
    options: Options,
    untouched: np.ndarray,
    frame: np.ndarray,
    width: str,
) -> np.ndarray:
    """y (r,) as the solver sees it."""
    engine = CoreEngine(blob, width)
    engine.set_options(options)
    engine.set_reference(as_float32(untouched).astype(np.float64))
    engine.solve_frame(as_float32(frame))
    return engine.reduced_data()[: model.rank].astype(np.float64)


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_units_of_frames(same_everywhere, margins, data_kind):
    """Frames and untouched frames in other volts: the gain brings them to the model's, from 1e-38
    to 1e37. Every voltage is rounded again, by u of itself, and so is every mean of 8 untouched
    ones, 8 times; their difference, times the gain, is so off by at most (1 + 8 + 3) u of the
    model's own voltage a row, and y by |P| times the norm of that; as a ratio by as much of 1.
    Denormal voltages of 1e-38 have 2^-149 / 1e-38 = 2^-23 in place of u."""
    s, model, blob = small(), small_model("f32", data_kind), small_blob("f32", data_kind)
    untouched, frames = s.untouched(31, 8), s.frames(30, 2)
    options = replace(default_options(model), solver="active-set", iterations=1000, gap_rel=1e-5)
    exponents = [0, -38, -37, *EXPONENTS, 37]
    steps: list[Step] = []
    for e in exponents:
        steps += [Load(blob), Choose(options)]
        steps += [TareStep(as_float32(untouched * 10.0**e)), Play(as_float32(frames * 10.0**e))]
    statuses, outcomes = same_everywhere.steps(steps)
    assert set(statuses) == {0}
    per_row = np.ones(len(model.v_ref_v)) if data_kind == "normalised" else np.abs(model.v_ref_v)
    norm = float(np.linalg.norm(model.projection.astype(np.float64), 2))
    data_off = 12 * U * norm * float(np.linalg.norm(per_row))
    points = [
        [
            reduced(
                model, blob, options, untouched * 10.0**e, frame * 10.0**e, same_everywhere.width
            )
            for frame in frames
        ]
        for e in exponents
    ]
    what = f"y, frames in other volts, {data_kind}"
    for k, e in enumerate(exponents):
        for frame, one in enumerate(outcomes[2 * k : 2 * k + 2]):
            assert one.status == 0 and one.finite()
            assert len(one.touches) == len(outcomes[frame].touches)
            worst = (20 if e == -38 else 1) * data_off
            size = float(np.linalg.norm(points[0][frame]))
            off = float(np.linalg.norm(points[k][frame] - points[0][frame]))
            margins.everywhere(FRAMES_CASE, what, off / size, 2 * worst / size, "|y|")
            both = [
                judged(model.sensitivity, points[j][frame], "increase", outcomes[2 * j + frame])
                for j in (0, k)
            ]
            check_scaled(margins, FRAMES_CASE, *both, off, 1.0)


@pytest.mark.parametrize("width", ["float32", "float64"])
def test_the_noise_has_the_units_of_the_frames(margins, width):
    """rms over rows of the deviation: a square of volts would leave float32 at 1e-23 and 1e19."""
    s = small()
    untouched = s.untouched(31, 8)
    truth = float(np.sqrt(untouched.var(axis=0, ddof=1).mean()))
    for e in EXPONENTS:
        engine = CoreEngine(small_blob(), width)
        baseline = engine.set_reference(untouched * 10.0**e)
        off = abs(baseline.noise_v / (truth * 10.0**e) - 1)
        target = "host f32" if width == "float32" else "host f64"
        # an untouched voltage is rounded by u |v0|, 1e3 u of a deviation of 1e-3 |v0|; at worst
        # 8 frames' errors add up
        margins.record(
            FRAMES_CASE, "noise learned, frames in other volts", target, off, 8 * 1e3 * U, "of it"
        )


def test_a_model_that_float32_cannot_hold_is_refused_in_one_line():
    good = made_model(gaussian(1).s)
    for value in (1e39, float("inf"), float("nan"), 1e-39, 0.0, -1.0):
        with pytest.raises(EitskinError) as error:
            encode_model(replace(good, lipschitz=value))
        assert "\n" not in str(error.value)
