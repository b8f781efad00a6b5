"""``eitskin bench peers``: what each program answers to spoilt frames."""

import numpy as np
import pytest

from eitskin.skin.protocol import adjacent
from eitskin_studies.benchmarks import peers


def case(what: str) -> peers.Spoilt:
    return next(one for one in peers.CASES if one.what == what)


def test_cases_spoil_what_they_say_and_leave_the_rest():
    untouched, frames = np.ones((4, 208)), np.full((3, 208), 2.0)
    for one in peers.CASES:
        reference, spoilt = one.spoil(untouched, frames, np.random.default_rng(1))
        assert (frames == 2).all() and (untouched == 1).all(), one.what
        changed = spoilt.shape != frames.shape or not np.array_equal(spoilt, frames)
        assert changed or not np.array_equal(reference, untouched), one.what
    _, off = case("an electrode comes off (52 rows)").spoil(
        untouched, frames, np.random.default_rng(1)
    )
    rows = (adjacent(16).drive_measure == peers.ELECTRODE).any(axis=1)
    assert rows.sum() == 52 and (off[:, ~rows] == 2).all() and np.abs(off[:, rows]).max() < 0.01


@pytest.mark.long("test_cases_spoil_what_they_say_and_leave_the_rest")
def test_the_core_names_or_refuses_what_spoils_others():
    result = peers.run(4, 3)
    ours = dict(zip(result.cases, result.answers["eitskin"], strict=True))
    assert not any(answer.startswith(("worse", "not finite")) for answer in ours.values()), ours
    assert ours["one row is five times too large"].startswith("named (1 row left out")
    assert ours["the frame is all zero"].startswith("refused")
    numpy = dict(zip(result.cases, result.answers["numpy, one Gauss-Newton step"], strict=True))
    assert numpy["one row is NaN"] == "not finite"
    assert numpy["an electrode comes off (52 rows)"].startswith("worse")
    assert "what is wrong" in peers.as_text(result)
