"""The Jacobian benchmark: both sides compute the same, and a message is printed if pyEIT is
absent."""

import importlib.util
import json

import pytest

from eitskin.errors import MissingExtraError, UsageError
from eitskin_studies.benchmarks import jacobian as bench_jacobian


def test_both_compute_the_same_jacobian():
    result = bench_jacobian.run(elements=(800, 1600), rounds=1, model_elements=800)
    assert json.loads(json.dumps(result)) == result
    for case, asked in zip(result["jacobian"], (800, 1600), strict=True):
        assert abs(case["elements"] / asked - 1) < 0.2
        assert case["cosine"] > 0.97  # pyEIT's electrodes are points
        for name in ("first", "again"):
            median, least, most = case["eitskin_s"][name]
            assert 0 < least <= median <= most
            assert case["ratio"][name] == pytest.approx(case["pyeit_s"][name][0] / median)
    shown = bench_jacobian.text(result)
    assert "whole model" in shown
    assert shown.count("the mesh") == shown.count("kept parts") == 2
    assert f"pyeit {result['versions']['pyeit']}" in shown


def test_without_pyeit(monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pyeit" else found(name)
    )
    with pytest.raises(MissingExtraError, match=r"pyeit.*'./studies\[peers\]'"):
        bench_jacobian.run()


def test_refused_rounds():
    with pytest.raises(UsageError, match="at least 1"):
        bench_jacobian.run(rounds=0)
