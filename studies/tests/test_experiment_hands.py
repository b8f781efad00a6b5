"""The study of hands in time: it judges streams at their own instants, and fills its page."""

import numpy as np

from eitskin_studies.experiments import hands
from eitskin_studies.experiments.hands import scenes
from eitskin_studies.experiments.hands.judged import _matched
from study_pages import fills_its_page, workspace


def test_it_fills_its_page(tmp_path, monkeypatch):
    chosen = ("one finger, rise 0 ms", "swipe at 1 m/s")
    listed = [kind for kind in hands.kinds() if kind.name in chosen]
    monkeypatch.setattr(hands, "ELEMENTS", 2500)
    monkeypatch.setattr(hands, "kinds", lambda: listed)
    monkeypatch.setattr(hands, "library", lambda: {"tap": None})
    outcome = hands.run(workspace(tmp_path, 0.001))
    found = {one["name"]: one for one in outcome.data["kinds"]}
    assert tuple(found) == chosen
    for one in found.values():
        assert one["scenes"] == 2 and one["missed"] == 0
        assert one["first_ms"][0] < 30
    fills_its_page(outcome, "hands", tmp_path)


def test_a_touch_is_judged_by_the_fingers_of_its_instant():
    at = np.array([10.0, 0.0])
    finger = scenes.Finger(0.1, 0.03, 0.5, at, at + np.array([40.0, 0.0]))
    assert tuple(finger.place(0.0)) == (10, 0)
    assert tuple(finger.place(0.6)) == (50, 0)
    hits, false, missing = _matched([finger], np.array([[10.0, 3.0], [-60.0, 0.0]]), 0.13)
    assert hits == {0: 3.0} and false == [1] and missing == []
    assert _matched([finger], np.zeros((0, 2)), 0.2) == ({}, [], [0])
    assert _matched([finger], np.zeros((0, 2)), 0.15) == ({}, [], [])  # it has just landed
    assert _matched([finger], np.array([[50.0, 0.0]]), 0.7)[1] == [0]  # it is gone


def test_every_kind_draws_scenes_that_fit_the_skin():
    for number, kind in enumerate(hands.kinds()):
        for k in range(6):
            fingers = kind.draw(np.random.default_rng([5, number, k]))
            assert 1 <= len(fingers) <= 6
            made = scenes.scene(fingers, k, kind.snr_db, 2500)
            assert made.frames > 10 and len(made.touches) == len(fingers)
