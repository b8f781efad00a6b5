"""``eitskin bench latency``: what counts as reported, as false, as late; the page; a run."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from eitskin.model.eitm import load_model
from eitskin.scene.description import load_scene
from eitskin_studies.benchmarks import latency
from eitskin_studies.benchmarks.latency import Press, Reported, judge
from eitskin_studies.harness.sections import fill_marks
from eitskin_studies.pictures.latency_picture import latency_drawing
from study_pages import page_copy


def reported(number: int, *places: tuple[float, float], named: str = "") -> Reported:
    """By the frame whose scan takes 20 ms from 20 ms times ``number``."""
    return Reported(0.02 * number, 0.02 * (number + 1), np.array(places).reshape(-1, 2),
        (named,) if named else (), 8.0, 1.0, True)  # fmt: skip


def test_what_is_told_of_presses():
    presses = [Press(0.05, 0.0, 0.3, 0.0, 0.0), Press(0.61, 0.0, 0.9, 40.0, 0.0)]
    presses.append(Press(1.25, 0.0, 1.5, 0.0, 0.0))
    frames = [
        reported(0), reported(3, (3.0, 4.0), named="outlier"), reported(4, (0.0, 1.0)),
        reported(19, (0.0, 0.0)),  # 80 ms after the lift
        reported(31, (39.0, 0.0), (41.0, 0.0)), reported(40, (40.0, 0.0), (0.0, 0.0)),
        reported(51, (40.0, 0.0)),  # 120 ms after the lift
    ]  # fmt: skip
    frames.insert(3, replace(reported(5), frame=False))
    one = judge("m", 0, [(presses, frames)])
    assert (one.frames, one.frames_diagnosed) == (7, 1)
    assert one.scan_ms == pytest.approx((30.0, 30.0)) and one.error_mm == pytest.approx((5.0, 1.0))
    assert (one.missed, one.with_false, one.false_touches, one.diagnosed) == (1, 1, 3, 1)
    early = judge("m", 0, [(presses[:1], [reported(0, (0.0, 0.0)), reported(1, (30.0, 0.0))])] * 2)
    assert (early.with_false, early.false_touches, early.missed) == (2, 4, 2)


def test_presses_are_drawn_apart_and_inside(tmp_path):
    presses = latency.draw(20, 0.03, 5)
    scene = load_scene(latency._written(tmp_path, "x", presses, 1))
    assert len(scene.touches) == 20 and scene.rate_hz == pytest.approx(48.077, abs=1e-3)
    assert all(b.contact_s - a.gone_s >= latency.HELD_S for a, b in pairwise(presses))
    phases = np.array([press.contact_s * scene.rate_hz % 1 for press in presses])
    assert phases.min() < 0.2 and phases.max() > 0.8
    (one,) = scene.samples_at(np.array([presses[3].contact_s + 0.015]))[3:4]
    assert one.contrast[0] == pytest.approx(3.0, abs=1e-3)


def test_a_run_fills_the_page(tmp_path, monkeypatch):
    monkeypatch.setattr(latency, "RISES_MS", (30,))
    result = latency.run(1, 0, 1)
    assert [one.method for one in result.judged] == [latency.DRIVES, latency.WHOLE]
    assert all((one.rise_ms, one.missed) == (30, 0) for one in result.judged)
    drives, frames = (one.scan_ms[0] for one in result.judged)
    assert 0 < drives < 20 and drives < frames < 80
    assert list(result.parts_ms) == ["host"]
    page = page_copy(tmp_path, "latency")
    fill_marks(page, "latency", latency.for_page(result, "eitskin bench latency"))
    assert "1 presses a rise on `sim:`" in page.read_text()
    assert latency.DRIVES in latency.as_text(result)
    assert "whole frames" in latency.as_text(result)
    ordered = latency._model(tmp_path, "by 7")
    assert ordered is not None and load_model(ordered)[0].protocol.drive_order[1] == 7
    latency_drawing(result)(tmp_path / "latency.png")
    assert (tmp_path / "latency.png").stat().st_size > 10_000
