"""Property-based: any matrix, data, lambda, sign, solver and storage give a sound result, and the
same bits everywhere."""

from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_models import made_model, plain_options
from random_problems import rounded
from soundness import check_sound, judged

from eitskin.core.options_table import SIGNS, SOLVERS
from eitskin.model.eitm import encode_model
from eitskin.model.storage import STORAGES
from eitskin_emulator.core_steps import Choose, Load, Solve, Step
from everywhere import on_host

CASE = "problem/any"
EXAMPLES = 150


@st.composite
def matrices(draw: st.DrawFn) -> np.ndarray:
    """1 to 20 rows, 1 to 64 columns: random, then spoilt in any of the ways that matrices are."""
    rank, columns = draw(st.integers(1, 20)), draw(st.integers(1, 64))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    inner = draw(st.integers(1, max(rank, 1)))
    s = rng.standard_normal((rank, inner)) @ rng.standard_normal((inner, columns)) / np.sqrt(inner)
    if draw(st.booleans()):
        s *= 10.0 ** rng.uniform(-3, 3, columns)
    if draw(st.booleans()):
        s[:, rng.random(columns) < 0.3] = 0
    if draw(st.booleans()):
        s[:, rng.random(columns) < 0.5] = s[:, :1] * draw(st.sampled_from([1.0, -1.0, 0.5]))
    if draw(st.booleans()):
        s[rng.random(rank) < 0.3] = 0
    return rounded(s)


@st.composite
def problems(draw: st.DrawFn) -> dict[str, Any]:
    """Draw a problem for a solve."""
    s = draw(matrices())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kind = draw(st.sampled_from(["random", "of a column", "sparse", "zero"]))
    y = rng.standard_normal(len(s)) * 10.0 ** draw(st.integers(-6, 6))
    if kind == "of a column":
        y = s[:, rng.integers(s.shape[1])] * float(y[0])
    if kind == "sparse":
        y[rng.random(len(y)) < 0.8] = 0
    return {
        "s": s,
        "y": rounded(np.zeros(len(s)) if kind == "zero" else y),
        "storage": draw(st.sampled_from(STORAGES)),
        "sign": draw(st.sampled_from(SIGNS)),
        "solver": draw(st.sampled_from(SOLVERS)),
        "iterations": draw(st.sampled_from([1, 2, 7, 10, 11, 60, 200])),
        "lambda_rel": draw(st.sampled_from([0.0, 1e-4, 0.01, 0.1, 0.5, 0.99, 1.0])),
        "gap_rel": draw(st.sampled_from([0.0, 1e-6, 1e-2])),
        "mac_limit": draw(st.sampled_from([0, 0, 0, 100, 5_000, 50_000])),
        "warm_start": draw(st.booleans()),
    }


def steps_of(given_problem: dict[str, Any]) -> tuple[np.ndarray, list[Step]]:
    """S as stored, and the steps: the data twice, which a warm start takes up."""
    model = made_model(
        given_problem["s"],
        storage=given_problem["storage"],
        lipschitz=None if given_problem["s"].any() else 1.0,
    )
    names = ("sign", "solver", "iterations", "lambda_rel", "gap_rel", "mac_limit", "warm_start")
    options = plain_options(given_problem["s"], **{name: given_problem[name] for name in names})
    return model.sensitivity, [
        Load(encode_model(model)),
        Choose(options),
        Solve(np.array([given_problem["y"]] * 2)),
    ]


def test_any_problem(same_everywhere, margins):
    """On this host example by example; then all of them at once on the others."""
    steps: list[Step] = []

    @settings(
        max_examples=EXAMPLES,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(problems())
    def sound(given_problem: dict[str, Any]) -> None:
        s, own = steps_of(given_problem)
        statuses, outcomes = on_host(own, same_everywhere.width)
        assert statuses == [0, 0]
        for one in outcomes:
            check_sound(
                margins, CASE, judged(s, given_problem["y"], given_problem["sign"], one), one
            )
        steps.extend(own)

    sound()
    _, outcomes = same_everywhere.steps(steps)
    assert len(outcomes) >= 2 * EXAMPLES
    assert len({one.info.stop for one in outcomes}) >= 5
