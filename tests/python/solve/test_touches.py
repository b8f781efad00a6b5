"""Touches: one width of the C core against the other, and all engines against the truth of
simulated frames. tests/python/oracle/test_touches_cost.py judges the fit."""

import numpy as np
import pytest

from all_engines import AllEngines
from eitskin.core.diagnostics_table import Touch
from eitskin.model.model import Model
from eitskin.scene.random_touches import TouchScene, TouchSet
from eitskin.scene.random_touches import TrueTouch as Put
from eitskin.scene.simulate import Measurement, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import ENGINES, Reconstructor
from small_models import DATA_KINDS, STORAGES, prebuilt, session, small, small_model

BOUND_MM = 0.05


def sizes_mm(touches: tuple[Touch, ...]) -> np.ndarray:
    """x, y and radius, (k, 3)."""
    return np.array([(t.x_mm, t.y_mm, t.radius_mm) for t in touches]).reshape(-1, 3)


def compare(model: Model, untouched: np.ndarray, frames: np.ndarray, **options: object) -> int:
    """Compare the widths over ``frames``; returns how many touches were found."""
    made, count = AllEngines(model, engines=("c", "c64"), **options), 0
    made.tare(untouched)
    for frame in frames:
        found = {name: result.touches for name, result in made.reconstruct(frame).items()}
        narrow, wide = found["c"], found["c64"]
        count += len(wide)
        assert len(narrow) == len(wide)
        assert np.abs(sizes_mm(narrow) - sizes_mm(wide)).max(initial=0) <= BOUND_MM
        assert [t.id for t in narrow] == [t.id for t in wide]
        for ours, expected in zip(narrow, wide, strict=True):
            for field, rel, least in (
                ("strength_s_per_m_mm2", 0.01, None),
                ("explained", 0.01, 1e-4),
                ("confidence", 0.05, None),
                ("x_variance_mm2", 0.05, None),
                ("y_variance_mm2", 0.05, None),
            ):
                known, here = getattr(expected, field), getattr(ours, field)
                if known is not None:
                    known = pytest.approx(known, rel=rel, abs=least)
                assert here == known, field
    return count


def test_simulated_frames_of_the_paper_skin():
    frames = session(scenes=40).as_frames()
    assert compare(prebuilt()[0], frames.reference_voltage_v, frames.voltage_v) >= 60


@pytest.mark.parametrize("data_kind", DATA_KINDS)
@pytest.mark.parametrize("storage", STORAGES)
def test_small_models(storage, data_kind):
    s = small()
    assert compare(small_model(storage, data_kind), s.untouched(2, 32), s.frames(7, 10)) >= 10


def test_both_signs_and_dropouts():
    s = small()
    frames = s.frames(17, 12, "both")
    frames[3, 20:26] = np.nan
    assert compare(small_model(), s.untouched(2, 32), frames, sign="both") >= 12


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("touch_sweeps", 0),
        ("touch_change_s_per_m", 0.0),
        ("max_touches", 1),
        ("detection_factor", 0.0),
    ],
)
def test_other_options(name, value):
    frames = session(scenes=40).as_frames()
    compare(prebuilt()[0], frames.reference_voltage_v, frames.voltage_v[:10], **{name: value})


@pytest.mark.parametrize("engine", ENGINES)
def test_touches_are_where_they_were_put(engine):
    """One touch of 9 mm and contrast 5 at several places, simulated without noise on another
    mesh."""
    places = [(0.0, 0.0), (40.0, 10.0), (-20.0, -60.0), (55.0, -45.0), (-70.0, 20.0)]
    scenes = tuple(TouchScene(str(k), (Put(x, y, 9.0, 5.0),)) for k, (x, y) in enumerate(places))
    ideal = Measurement(snr_db=None, adc_bits=None, contact_spread=0.0, quiet_frames=1)
    frames = simulate(
        paper_skin(), adjacent(16), TouchSet("places", 1, scenes), measurement=ideal
    ).as_frames()
    made = Reconstructor(prebuilt()[0], engine=engine)
    made.tare(frames.reference_voltage_v)
    for frame, (x, y) in zip(frames.voltage_v, places, strict=True):
        made.forget()
        touches = made.reconstruct(frame).touches
        assert len(touches) == 1
        assert np.hypot(touches[0].x_mm - x, touches[0].y_mm - y) < 1.0
        assert touches[0].radius_mm == pytest.approx(9.0, rel=0.12)
        # a disc of contrast c answers as a linear change of 2 (c - 1) / (c + 1) times the sheet's
        # conductivity, to first order in its size: higher orders add some 10 % at this one
        expected = 2 * 4 / 6 * 0.01 * np.pi * 9.0**2
        assert touches[0].strength_s_per_m_mm2 == pytest.approx(expected, rel=0.15)
        assert touches[0].explained > 0.85


def test_touches_come_strongest_first_with_ids_of_their_own():
    frames = session(scenes=40).as_frames()
    made = Reconstructor(prebuilt()[0])
    made.tare(frames.reference_voltage_v)
    most = 0
    for frame in frames.voltage_v:
        touches = made.reconstruct(frame).touches
        strength = [t.strength_s_per_m_mm2 for t in touches]
        assert strength == sorted(strength, reverse=True)
        assert len({t.id for t in touches}) == len(touches)
        assert all(0 < t.explained <= 1 and 3.0 <= t.radius_mm <= 30.0 for t in touches)
        most = max(most, len(touches))
    assert most == 3


def test_a_resistive_change_is_a_touch_of_negative_strength():
    s, model = small(), small_model()
    near = np.linalg.norm(s.linear.grid.centres_mm() - (10, 15), axis=1) <= 8
    x, y = s.linear.grid.centres_mm()[near].mean(axis=0)
    frame = s.linear.v0_v - s.linear.jacobian @ (0.01 * near)
    for sign, expected in (("decrease", -1), ("both", -1), ("increase", 0)):
        made = Reconstructor(model)
        made.set_options(sign=sign)
        made.tare(s.untouched(1, 16, 1e-5))
        touches = made.reconstruct(frame).touches
        if expected:
            assert np.sign(touches[0].strength_s_per_m_mm2) == expected
            assert np.hypot(touches[0].x_mm - x, touches[0].y_mm - y) < 0.5
            assert made.reconstruct(frame).solver_image.min() < 0
        else:
            assert all(t.strength_s_per_m_mm2 > 0 for t in touches)
            assert made.reconstruct(frame).solver_image.min() == 0
