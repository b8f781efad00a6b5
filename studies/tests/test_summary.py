"""Summaries against numbers worked out by hand, and the bootstrap against the normal interval."""

import math

import numpy as np
import pytest

from eitskin_studies.harness.summary import bootstrap_interval, summarise


def test_summary_of_one_to_twenty():
    summary = summarise(range(1, 21))
    found = summary.mean, summary.worst_tenth, summary.median, summary.count
    assert found == (10.5, 1.5, 10.5, 20)
    assert summary.p95 == pytest.approx(19.05)
    assert summarise(range(1, 21), worst="high").worst_tenth == 19.5


def test_worst_tenth_is_at_least_one_value_and_rounds_up():
    assert summarise([3.0, 1.0, 2.0]).worst_tenth == 1.0
    assert summarise(range(11)).worst_tenth == 0.5


def test_interval_is_seeded_and_near_the_normal_one():
    values = np.random.default_rng(1).normal(2.0, 0.5, 400)
    low, high = bootstrap_interval(values, seed=4)
    assert (low, high) == bootstrap_interval(values, seed=4)
    assert (low, high) != bootstrap_interval(values, seed=5)
    half = 1.96 * values.std() / math.sqrt(400)
    assert low == pytest.approx(values.mean() - half, abs=0.15 * half)
    assert high == pytest.approx(values.mean() + half, abs=0.15 * half)
    assert bootstrap_interval([7.0, 7.0, 7.0]) == (7.0, 7.0)


def test_nothing_to_summarise_is_nan():
    summary = summarise([])
    assert summary.count == 0
    assert math.isnan(summary.mean) and math.isnan(summary.low) and math.isnan(summary.median)


def test_unknown_end_is_refused():
    with pytest.raises(ValueError, match="worst"):
        summarise([1.0], worst="left")
