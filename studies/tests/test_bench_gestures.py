"""Gestures drawn, simulated, reported and judged."""

from collections import Counter

import numpy as np
import pytest

from eitskin.core.gestures import Gestures
from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.gestures import bench
from eitskin_studies.gestures.drawn import EACH, KINDS, RIM_MM, DrawnGesture, DrawnSession
from eitskin_studies.gestures.drawn import draw_session as draw
from eitskin_studies.gestures.judged import GestureCount, ReportedGesture, judge, reported_gestures
from eitskin_studies.gestures.simulated import RATE_HZ, Simulator, found_touches


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
