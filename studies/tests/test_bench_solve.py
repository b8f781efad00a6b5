"""``eitskin bench solve``: each solver really gets to the level that its time is given for."""

import numpy as np
import pytest

from eitskin.core.options_table import SOLVERS
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.random_touches import random_touches
from eitskin.scene.simulate import Measurement, simulate
from eitskin_studies.benchmarks import solve as bench_solve
from eitskin_studies.benchmarks import solve_peers as bench_solve_peers
from eitskin_studies.benchmarks import suboptimality
from eitskin_studies.benchmarks.solve_problems import Problems, make_problems
from eitskin_studies.harness.sections import fill_marks
from study_pages import page_copy

OWN = {f"eitskin {solver}, {width}" for solver in SOLVERS for width in ("float32", "float64")}


@pytest.fixture(scope="module")
def problems() -> Problems:
    model, blob = load_prebuilt()
    touches = random_touches(model.skin.outline, 3, 2, "test")
    session = simulate(model.skin, model.protocol, touches, measurement=Measurement(snr_db=60.0))
    return make_problems("rank 64", model, blob, session)


def test_suboptimality_is_judged_in_float64(problems):
    zero = np.zeros(problems.s.shape[1])
    assert problems.objective(0, zero) == pytest.approx(
        0.5 * problems.y[0] @ problems.y[0], rel=1e-14
    )
    assert problems.suboptimality(0, zero) > 1
    assert (
        problems.best_signed <= problems.best * (1 + 1e-13)
    ).all()  # where no sign differs, equal but for rounding


@pytest.mark.long("the other tests of the file, with fewer peers")
def test_all_that_is_installed_reaches_its_level(problems, monkeypatch):
    monkeypatch.setattr(bench_solve, "LEVELS", (1e-2,))
    seen = set()
    for candidate in bench_solve_peers.candidates(problems):
        seen.add(candidate.name)
        (plan,) = bench_solve._plan(problems, candidate)
        assert plan.calls is not None and plan.worst <= 1e-2, candidate.name
        bench_solve._round(plan)
        assert plan.median_us > 0
    assert seen >= OWN | {"numpy FISTA, float32", "numpy FISTA, float64"}
    for name, number in bench_solve_peers.versions().items():
        assert (number is not None) == (
            name == "numpy" or any(name.split("-")[0].lower() in s.lower() for s in seen)
        ), name


def test_what_is_absent_is_named():
    result = {
        "machine": "m",
        "versions": {"numpy": "2", "celer": None},
        "seed": 1,
        "rounds": 3,
        "tables": [],
    }
    assert "not installed: celer; run  pip install celer" in bench_solve.text(result)


def test_the_page_has_the_times_and_says_which_aims_are_missed(tmp_path):
    times = {
        bench_solve.BASE: (24.0, 22.0, 20.0),
        "SPAMS, float32, Gram, batch of 240": (62.0, 62.0, 62.0),
        "SPAMS, float32, Cholesky, batch of 240": (61.0, 61.0, 60.0),
        "celer, float64": (628.0, 1796.0, 3390.0),
        "scikit-learn, float64": (2085.0, 12885.0, None),
    }
    rows = [
        {"solver": name, "level": level, "reached": us is not None, "us": us}
        for name, all_us in times.items()
        for level, us in zip(bench_solve.LEVELS, all_us, strict=True)
    ]
    table = {"count": 20, "shape": [64, 812], "nonzeros": 9.5, "rows": rows}
    result = {
        "machine": "m", "versions": {"numpy": "2", "celer": "1", "daqp": None}, "seed": 3,
        "rounds": 11, "tables": [table | {"problems": name} for name in ("rank 64", "rank 104")],
    }  # fmt: skip
    page = page_copy(tmp_path, "benchmarks")
    fill_marks(page, "benchmarks", bench_solve.for_page(result, "the command"))
    text = page.read_text(encoding="utf-8")
    assert "By `the command`" in text and "numpy 2, celer 1." in " ".join(text.split())
    assert "| celer, float64 | 628 | 1796 | 3390 | 3390 |" in text
    assert "| scikit-learn, float64 | 2085 | 12885 | - | - |" in text
    assert "| SPAMS | 5 | **3.0** (missed) | **3.0** (missed) |" in text
    assert "| celer | 100 | 170 | 170 |" in text
    assert "| scikit-learn | 400 | - | - |" in text and "| DAQP |" not in text


def test_the_page_has_the_last_stop_of_each_solver(tmp_path):
    stops = [
        suboptimality.StopPoint(solver, effort, 0.026, 0.862, 0.729, 586_400.0, 0.2)
        for solver, effort in (("fista", 60), ("working-set", 60), ("active-set", 0))
    ]
    filling = suboptimality.for_page(suboptimality.GapCurves(tuple(stops), "some", "others"), "x")
    page = page_copy(tmp_path, "benchmarks")
    fill_marks(page, "benchmarks", filling)
    text = page.read_text(encoding="utf-8")
    assert "| active set, to the optimum | 586 k | 2.6e-02 | .862 | .729 |" in text
