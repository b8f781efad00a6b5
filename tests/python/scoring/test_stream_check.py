"""Frames as text: lines, JSON, and the distance to the scene's truth."""

import json
from dataclasses import replace

import numpy as np
import pytest

from eitskin.cli.frame_line import line
from eitskin.core.diagnostics_table import Touch
from eitskin.device.known_model import KnownModel
from eitskin.device.wire.link_table import Quality
from eitskin.device.wire.packets import RawFrame, Solved
from eitskin.scene.library_scenes import find_scene
from eitskin.scoring.observer import TruthObserver
from eitskin.scoring.scene_truth import SceneTruth
from eitskin.session.frame import Frame
from small_models import prebuilt

SOLVED = Solved(
    7,
    1000,
    900,
    100,
    20,
    0,
    0,
    "iterations",
    "solver",
    0,
    60,
    30,
    1,
    1,
    0.1,
    0.2,
    0.0,
    0.01,
    0.0,
    1.0,
)


def touches(*places: tuple[float, float], status: int = 0, time_us: int = 1000) -> Frame:
    found = tuple(Touch(k + 1, x, y, 8.0, 3.0, 0.5) for k, (x, y) in enumerate(places))
    solved = replace(SOLVED, status=status, count=len(found))
    return Frame(7, 0, time_us, touches=found, has_touches=True, info=solved, known=known())


def image(*places: tuple[float, float], sign: float = 1.0) -> Frame:
    centres = prebuilt()[0].grid.centres_mm()
    near = (np.linalg.norm(centres - place, axis=1) < 10 for place in places)
    values = (0.01 * sign * sum(near, np.zeros(len(centres)))).astype(np.float32)
    return Frame(7, 0, 1000, solver_image=values, info=SOLVED, known=known())


def known() -> KnownModel:
    return KnownModel(*prebuilt())


def observer(scene: str = "two_touch", sign: str = "increase") -> TruthObserver:
    return TruthObserver(SceneTruth(find_scene(scene), sign))


def test_touches_are_paired_with_the_true_ones():
    look = observer()
    seen = look.see(touches((30.0, -24.0), (-40.0, 13.0), (0.0, 0.0)))
    assert seen.errors_mm == {0: pytest.approx(1.0), 1: pytest.approx(3.0)}
    text = line(seen)
    assert text.count("off by") == 2 and "#1 (30.0, -24.0) mm" in text
    assert "3.00 S/m mm2, false; 60 iterations (limit), gap 1.0e-02, " in text
    assert text.endswith(" ms")
    facts = seen.message()
    found = [touch["error_mm"] for touch in facts["touches"]]
    assert found == [pytest.approx(1.0), pytest.approx(3.0), None]
    assert len(facts["true"]) == 2
    assert look.score.as_dict() == {
        "frames": 1, "true": 2, "found": 2, "false": 1, "position_median_mm": pytest.approx(2.0),
        "position_worst_mm": pytest.approx(3.0),
    }  # fmt: skip
    said = "2 of 2 touches found, 1 false; position error median 2.00 mm, worst 3.00 mm"
    assert said in look.score.text()


def test_nothing_found_is_no_error_of_zero():
    look = observer()
    assert " s  no touch; 60 iterations" in line(look.see(touches()))
    assert look.score.as_dict()["position_worst_mm"] is None
    assert "position error" not in look.score.text()
    assert look.score.missed == 2


def test_touches_that_are_not_looked_for_are_not_missed():
    look = observer(sign="decrease")
    look.see(touches())
    assert look.score.missed == 0


def test_a_moving_touch_is_where_it_is_at_the_boards_time():
    truth = SceneTruth(find_scene("swipe"))
    truth.began_us = 2**32 - 500_000
    times = np.linspace(0, 1.95, 40)
    found = [truth.touches(int(2**32 - 500_000 + 1e6 * t) % 2**32) for t in times]
    x = np.array([one[0].x_mm for one in found if one])
    assert len(x) > 30 and (np.diff(x) > 0).all()
    assert truth.touches(int(1e9)) == truth.touches(int(2e9))  # the last frame stays


def test_a_refused_frame_says_why_and_is_not_scored():
    look = observer()
    seen = look.see(touches(status=-5))
    assert "refused: " in line(seen) and seen.message()["refused"]
    assert look.score.frames == 0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_image_in_brief(sign):
    places = [(-40.0, 10.0), (30.0, -25.0)]
    seen = image(*places, sign=sign)
    distance = np.linalg.norm(seen.places_mm[:, None] - np.array(places), axis=2)
    assert (distance.min(axis=0) < 3).all() and len(distance) == 2
    assert seen.peak.value == pytest.approx(0.01 * sign) and seen.errors_mm is None
    assert "off by" not in line(seen)
    assert " s  image: flat; 60 iterations" in line(image())


def test_raw_rows_that_are_missing_become_null():
    volts = np.linspace(1, 2, 5).astype(np.float32)
    volts[2] = np.nan
    quality = np.array([0, 0, Quality.OPEN | Quality.SATURATED, Quality.COPIED, 0], dtype=np.uint8)
    raw = RawFrame(3, 9, 20_800, 0, volts, quality)
    seen = Frame(3, 250_000, 9, raw=raw)
    facts = json.loads(json.dumps(seen.message(), allow_nan=False))
    assert facts["voltage_v"][2] is None and facts["voltage_v"][0] == 1.0
    assert facts["time_s"] == 0.25
    assert "5 rows in 20.80 ms" in line(seen) and "1 not usable" in line(seen)
    assert "nan" not in line(seen)
