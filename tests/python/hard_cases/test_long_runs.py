"""Many iterations, and many frames that each start where the last one ended."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from made_models import made_blob, plain_options
from random_problems import gaussian
from soundness import check_sound, judged

from eitskin.core.options_table import SIGNS, SOLVERS
from eitskin.model.options import default_options
from eitskin_studies.harness.emulated_steps import Choose, Load, Play, Solve, Step, TareStep
from everywhere import on_host
from small_models import small, small_blob, small_model

ITERATIONS_CASE, WARM_CASE = "time/iterations", "time/warm-frames"
COUNTS = (100, 1_000, 10_000, 100_000)
HELD, FEW = 3_000, 100


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_hundred_thousand_iterations(same_everywhere, margins, solver):
    """Rounding does not gather: what is lost between 100 iterations and 100,000 is never more than
    the rounding of one objective each."""
    problem = gaussian(91, 8, 12)
    steps: list[Step] = [Load(made_blob(problem.s))]
    for sign in SIGNS:
        for count in COUNTS:
            options = plain_options(
                problem.s, solver=solver, sign=sign, iterations=count, lambda_rel=0.01
            )
            steps += [Choose(options), Solve(problem.y[None])]
    _, outcomes = same_everywhere.steps(steps)
    for k, sign in enumerate(SIGNS):
        points = [
            judged(problem.s, problem.y, sign, one)
            for one in outcomes[k * len(COUNTS) : (k + 1) * len(COUNTS)]
        ]
        for point, one in zip(points, outcomes[k * len(COUNTS) :], strict=False):
            check_sound(margins, ITERATIONS_CASE, point, one)
            assert one.info.stop in ("iterations", "optimum")
        half = points[0].at_zero().objective
        for before, after in pairwise(points):
            rise = max(0.0, after.objective - before.objective)
            slack = before.objective_rounding + after.objective_rounding
            what = f"objective risen since a tenth of the iterations, {solver}"
            margins.everywhere(ITERATIONS_CASE, what, rise / half, slack / half, "|y|^2/2")


@pytest.mark.parametrize("solver", SOLVERS)
def test_warm_frames(same_everywhere, margins, solver):
    """A touch held for thousands of frames: the gap after each warm frame is at most that of a cold
    one, but for rounding, and the last image is as near to the optimum as the first warm ones.
    Lifted off, it is gone in the next frame: no ghost.
    """
    s, model, blob = small(), small_model(), small_blob()
    quiet, (touched,) = s.quiet(93, 16), s.frames(92, 1)
    options = replace(default_options(model), solver=solver, warm_start=True, iterations=20)
    after = s.quiet(94, 3)
    head: list[Step] = [Load(blob), Choose(options), TareStep(quiet)]
    _, few = same_everywhere.steps([*head, Play(np.vstack([np.tile(touched, (FEW, 1)), after]))])
    _, many = on_host([*head, Play(np.vstack([np.tile(touched, (HELD, 1)), after]))])
    assert all(
        (one.image == other.image).all() for one, other in zip(few[:FEW], many, strict=False)
    )
    assert all(one.status == 0 and one.finite() for one in [*few, *many])
    gaps = np.array([one.info.gap_rel for one in many[:HELD]])
    bound = gaps[0] + 1e-6
    margins.record(
        WARM_CASE,
        f"gap of any of {HELD} warm frames, {solver}",
        "host f32",
        gaps[1:].max(),
        bound,
        "|y|^2/2",
    )
    margins.everywhere(
        WARM_CASE, f"gap of any of {FEW} warm frames, {solver}", gaps[1:FEW].max(), bound, "|y|^2/2"
    )
    late = float(
        np.abs(many[HELD - 1].image - many[HELD // 2].image).max() / np.abs(many[0].image).max()
    )
    margins.record(
        WARM_CASE,
        f"image moved over the last {HELD // 2} frames, {solver}",
        "host f32",
        late,
        0.02,
        "of its peak",
    )
    for outcomes in (few[FEW:], many[HELD:]):
        ghost = max(float(np.abs(one.image).max()) for one in outcomes) / float(
            np.abs(many[0].image).max()
        )
        margins.everywhere(WARM_CASE, f"ghost after lift-off, {solver}", ghost, 0, "of the peak")
