"""Gestures drawn, simulated, reported and judged."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.core.gestures import Gestures
from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.gestures import bench
from eitskin_studies.gestures.drawn import (
    EACH,
    KINDS,
    RIM_MM,
    DrawnGesture,
    DrawnSession,
    Finger,
)
from eitskin_studies.gestures.drawn import draw_session as draw
from eitskin_studies.gestures.judged import GestureCount, ReportedGesture, judge, reported_gestures
from eitskin_studies.gestures.simulated import RATE_HZ, Simulator, TouchedFrame, found_touches
from eitskin_studies.gestures.stages import STAGES, failed_stage


def test_a_session_has_every_kind_within_the_skin_and_depends_on_its_seed_alone():
    session = draw(97.0, 5, "test", 0)
    assert Counter(one.kind for one in session.gestures) == dict.fromkeys(KINDS, EACH)
    assert repr(session.tracks) == repr(draw(97.0, 5, "test", 0).tracks)
    assert repr(session.tracks) != repr(draw(97.0, 5, "test", 1).tracks)
    starts = [one.start_s for one in session.gestures]
    assert starts == sorted(starts)
    for gesture in session.gestures:
        for finger in gesture.fingers:
            reach = np.hypot(*finger.xy_mm.T).max() + finger.radius_mm
            assert reach <= 97.0 - RIM_MM + 1e-9


def test_simulated_gestures_are_told_and_kept(tmp_path):
    model, blob = load_prebuilt()
    session = draw(97.0, 1, "test", 0, each=1, kinds=("tap", "swipe"))
    simulator = Simulator(model, tmp_path)
    exact_v = simulator.exact_v(session, 1)
    assert exact_v.shape == (1 + int(np.ceil(session.duration_s * RATE_HZ)), 208)
    assert np.array_equal(exact_v, simulator.exact_v(session, 1))  # from the cache
    skin = Reconstructor(model, blob=blob)
    reported = reported_gestures(found_touches(skin, exact_v, 60.0, 1, session.name), Gestures())
    count = judge(session, reported)
    assert (count.gestures, count.right_gestures, count.invented.total()) == (2, 2, 0)
    assert max(max(late) for late in count.late_s.values()) < 0.05
    settings = bench.Settings(1, 1, "judging", (60.0,))
    text = bench.as_text(bench.GestureBench(settings, {60.0: count}))
    assert "100.0 (34.2 to 100.0)" in text


def done(*kinds: str) -> DrawnSession:
    """One gesture a second, each half a second long, swipes to the right."""
    made = tuple(
        DrawnGesture(kind, (), float(k), k + 0.5, 0.0 if kind == "swipe" else None)
        for k, kind in enumerate(kinds)
    )
    return DrawnSession("made", made, float(len(kinds)))


def reported(kind: str, at_s: float, direction_deg: float = 0.0) -> ReportedGesture:
    return ReportedGesture(kind, at_s, at_s, direction_deg)


@pytest.mark.parametrize(
    ("kinds", "what", "right", "invented"),
    [
        (("tap",), [reported("tap", 0.52)], 1, {}),
        (("tap",), [reported("tap", 0.8)], 0, {"tap": 1}),  # too late to be its own
        (("tap",), [reported("tap", 0.5), reported("tap", 0.6)], 0, {"tap": 1}),
        (("double-tap",), [reported("tap", 0.2), reported("double-tap", 0.5)], 1, {}),
        (("double-tap",), [reported("tap", 0.2)], 0, {}),
        (("swipe",), [reported("swipe", 0.5, 350.0)], 1, {}),
        (("swipe",), [reported("swipe", 0.5, 45.0)], 0, {}),
        (("drag", "hold"), [reported("swipe", 0.5), reported("hold", 1.5)], 1, {"swipe": 1}),
        (("pinch",), [reported("rotate", 0.3)], 0, {"rotate": 1}),
    ],
)
def test_what_is_right_and_what_is_invented(kinds, what, right, invented):
    count = GestureCount()
    count.add(judge(done(*kinds), what))
    assert (count.right_gestures, dict(count.invented)) == (right, invented)


@pytest.mark.parametrize(
    ("stage", "shown"),
    [
        (0, []),
        (0, [(k, 60.0, 1) for k in range(48)]),  # elsewhere
        (1, [(k, 1.0, 1) for k in range(6, 48)]),
        (2, [(k, 1.0, 1) for k in range(48) if not 20 <= k < 23]),
        (3, [(k, 1.0, 1 + (k > 20)) for k in range(48)]),
        (4, [(k, 1.0, 1) for k in range(48)] + [(9, 50.0, 2)]),
        (5, [(k, 5.0, 1) for k in range(48)]),
        (6, [(k, 1.0, 1) for k in range(48)]),
    ],
)
def test_the_stage_at_which_a_gesture_failed(stage, shown):
    """A finger rests at 0 for a second; `shown`: frame, error in mm and id of each touch."""
    finger = Finger(np.array([0.0, 1.0]), np.zeros((2, 2)), 7.0, 8.0, 0.02)
    one = DrawnGesture("hold", (finger,), 0.0, 1.0)
    touch = Touch(id=0, x_mm=0.0, y_mm=0.0, radius_mm=7.0, strength_s_per_m_mm2=2.0, explained=1.0)
    frames = [
        TouchedFrame(
            round(k * 1e6 / RATE_HZ),
            tuple(replace(touch, id=i, x_mm=mm) for at, mm, i in shown if at == k),
        )
        for k in range(50)
    ]
    assert failed_stage(one, frames) == STAGES[stage]
    session = DrawnSession("made", (one,), 1.0)
    assert judge(session, [], frames).stages == {STAGES[stage]: 1}
