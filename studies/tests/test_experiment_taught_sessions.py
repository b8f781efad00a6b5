"""The study of streams of a taught skin: what it counts, and measured presses that it streams."""

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.errors import UsageError
from eitskin.teaching.presses import load_presses
from eitskin.teaching.teach import teach
from eitskin_studies.experiments import taught_sessions
from eitskin_studies.experiments.experiment import ExperimentSettings, workspace_in
from eitskin_studies.experiments.teaching import FILE, SKIN


def touch(number: int, x_mm: float) -> Touch:
    return Touch(number, x_mm, 0.0, 7.0, 1.0, 0.5, confirmed=True)


@pytest.mark.parametrize(
    ("reported", "once", "false_frames"),
    [
        ({}, False, 0),
        ({0.1: [touch(1, 3)], 0.3: [touch(1, 2)], 0.5: [touch(1, 1)]}, True, 0),
        ({0.1: [touch(1, 3)], 0.5: [touch(1, 1)]}, False, 0),  # a gap
        ({0.1: [touch(1, 3)], 0.3: [touch(2, 2)], 0.5: [touch(2, 1)]}, False, 0),
        (
            {0.5: [touch(1, 3), touch(2, 4)], 2.0: [touch(1, 3)]},
            True,
            2,
        ),  # a second, and a late one
        ({0.5: [touch(1, 50)]}, False, 1),
    ],
)
def test_what_is_once_and_what_is_false(reported, once, false_frames):
    class Result:
        def __init__(self, volts: np.ndarray) -> None:
            self.touches = reported.get(float(volts[0]), [])

    scans = [taught_sessions.Scan(np.array([t]), t) for t in (0.1, 0.3, 0.5, 1.0, 2.0)]
    seen = taught_sessions._see(Result, iter(scans), np.zeros(2))
    assert (seen.once, seen.false_frames, seen.frames) == (once, false_frames, 5)
    assert seen.false_confirmed == false_frames


@pytest.mark.long("nothing; most checkouts lack the data and skip it")
def test_measured_presses_have_one_id_each(shared_data, monkeypatch):
    monkeypatch.setattr(taught_sessions, "JUDGED", 12)
    monkeypatch.setattr(taught_sessions, "PERIOD_S", 2.0)
    every = load_presses(shared_data / FILE)
    model = teach(every.take(np.arange(0, 480, 8)), SKIN).model
    found = taught_sessions.facts(taught_sessions.watch(model, every, True))
    assert found["presses"] == 12
    assert found["found"] >= 9
    assert found["once"] >= 6
    assert found["median_mm"] < 6


def test_without_the_presses_it_says_what_it_needs(tmp_path):
    with pytest.raises(UsageError, match="needs --data"):
        taught_sessions.run(workspace_in(tmp_path, ExperimentSettings(), lambda items, what: items))
