"""Many iterations, and many frames that each start where the last one ended."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from made_models import made_blob
from random_problems import gaussian
from soundness import check_sound

from eitskin.core.options_table import SIGNS, SOLVERS
from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Load, Play, Solve, Step, TareStep
from everywhere import on_host
from small_models import small, small_blob, small_model

ITERATIONS_CASE, WARM_CASE = "time/iterations", "time/warm-frames"
COUNTS = (100, 1_000, 10_000, 100_000)
HELD, FEW = 3_000, 100


@pytest.mark.parametrize(
    "solver",
    [s if s == "fista" else pytest.param(s, marks=pytest.mark.long("FISTA")) for s in SOLVERS],
)
def test_a_hundred_thousand_iterations(same_everywhere, margins, solver):
    """Rounding does not gather: what is lost between 100 iterations and 100,000 is never more than
    the rounding of one objective each."""
    problem, within = gaussian(91, 8, 12), margins.of(ITERATIONS_CASE)
    steps: list[Step] = [Load(made_blob(problem.s))]
    for sign, count in product(SIGNS, COUNTS):
        options = problem.options(solver=solver, sign=sign, iterations=count, lambda_rel=0.01)
        steps += [Choose(options), Solve(problem.y[None])]
    _, outcomes = same_everywhere.steps(steps)
    for k, sign in enumerate(SIGNS):
        of_sign = outcomes[k * len(COUNTS) : (k + 1) * len(COUNTS)]
        points = [problem.judged(sign, one) for one in of_sign]
        for point, one in zip(points, of_sign, strict=True):
            check_sound(margins, ITERATIONS_CASE, point, one)
            assert one.info.stop in ("iterations", "optimum")
        half = points[0].at_zero().objective
        for before, after in pairwise(points):
            rise = max(0.0, after.objective - before.objective) / half
            slack = (before.objective_rounding + after.objective_rounding) / half
            what = f"objective risen since a tenth of the iterations, {solver}"
            within(what, rise, slack, "|y|^2/2")


@pytest.mark.parametrize("solver", SOLVERS)
def test_warm_frames(same_everywhere, margins, solver):
    """A touch held for thousands of frames: the gap after each warm frame is at most that of a cold
    one, but for rounding, and the last image is as near to the optimum as the first warm ones.
    Lifted off, it is gone in the next frame: no ghost.
    """
    s, within = small(), margins.of(WARM_CASE)
    untouched, (touched,), after = s.untouched(93, 16), s.frames(92, 1), s.untouched(94, 3)
    options = replace(default_options(small_model()), solver=solver, warm_start=True, iterations=20)
    head: list[Step] = [Load(small_blob()), Choose(options), TareStep(untouched)]
    streams = [
        [*head, Play(np.vstack([np.tile(touched, (held, 1)), after]))] for held in (FEW, HELD)
    ]
    _, few = same_everywhere.steps(streams[0])
    _, many = on_host(streams[1], same_everywhere.width)
    assert all((one.image == many[k].image).all() for k, one in enumerate(few[:FEW]))
    assert all(one.status == 0 and one.finite() for one in [*few, *many])
    gaps = np.array([one.info.gap_rel for one in many[:HELD]])
    bound, peak = gaps[0] + 1e-6, float(np.abs(many[0].image).max())
    late = float(np.abs(many[HELD - 1].image - many[HELD // 2].image).max()) / peak
    for what, worst, most, unit in (
        (f"gap of any of {HELD} warm frames, {solver}", gaps[1:].max(), bound, "|y|^2/2"),
        (f"image moved over the last {HELD // 2} frames, {solver}", late, 0.02, "of its peak"),
    ):
        margins.record(WARM_CASE, what, margins.host, worst, most, unit)
    within(f"gap of any of {FEW} warm frames, {solver}", gaps[1:FEW].max(), bound, "|y|^2/2")
    for outcomes in (few[FEW:], many[HELD:]):
        ghost = max(float(np.abs(one.image).max()) for one in outcomes) / peak
        within(f"ghost after lift-off, {solver}", ghost, 0, "of the peak")
