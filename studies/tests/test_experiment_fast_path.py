"""The study of the fast path: it fills its page."""

import pytest

from eitskin_studies.experiments import fast_path
from eitskin_studies.experiments.fast_path import beyond
from study_pages import fills_its_page, workspace

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


def test_it_fills_its_page(tmp_path, monkeypatch):
    chosen = ("press, rise 30 ms", "swipe at 600 mm/s", "two fingers at once, rise 0 ms")
    rows = [row for row in fast_path.rows() if row.name in chosen]
    monkeypatch.setattr(fast_path, "ELEMENTS", 3500)
    monkeypatch.setattr(fast_path, "rows", lambda: rows)
    others = [row for row in beyond.rows() if row.name.startswith(("half", "contact"))]
    monkeypatch.setattr(beyond, "rows", lambda: others)
    outcome = fast_path.run(workspace(tmp_path, 0.001))
    found = {one["name"]: one for one in outcome.data["rows"]}
    assert tuple(found) == (chosen[0], chosen[1], chosen[2])
    for one in found.values():
        assert one["scenes"] == 2 and one["missed"] == one["with_false"] == 0
        assert one["frames"]["explained"] < one["frames"]["frames"] <= one["drives"] / 16
    more = {one["name"]: one for one in outcome.data["beyond"]}
    assert len(more) == 3 and all(one["missed"] == one["with_false"] == 0 for one in more.values())
    half, whole = more["half scan, press, rise 0 ms"], found[chosen[0]]
    assert half["drives"] / half["frames"]["frames"] == 8
    assert whole["drives"] / whole["frames"]["frames"] == 16
    fills_its_page(outcome, "fast-path", tmp_path)
