"""Frames of a scene made by and by: the same values, little work before the first, little kept."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from eitskin.scene import board_frames
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.description import Scene
from eitskin.scene.touch_path import Keyframe, TouchTrack
from eitskin.skin.protocol import adjacent

PROTOCOL = adjacent(16)


def moving(frames: int, **changes: object) -> Scene:
    """A touch that moves through all ``frames``, with noise and a drift of the amplitude."""
    keys = (Keyframe(0.0, -40.0, 0.0, 8.0), Keyframe(frames / 50, 40.0, 10.0, 8.0))
    scene = Scene(
        "moving",
        touches=(TouchTrack(keys),),
        frames=frames,
        rate_hz=50.0,
        quiet_frames=8,
        elements=1500,
        effects={"noise": {"snr_db": 60.0}, "amplitude_drift": {"walk_per_sqrt_min": 0.01}},
    )
    return replace(scene, **changes)


@pytest.mark.parametrize(
    "effects",
    [{}, {"contact_impedance": {"spread": 0.2}}, {"temperature": {"drift_k_per_min": 1.0}}],
    ids=["touch", "contacts", "sheet"],
)
def test_by_and_by_is_as_at_once(effects, monkeypatch):
    scene = moving(40)
    scene = replace(scene, effects={**scene.effects, **effects}, solver="factorise")
    at_once = BoardFrames(scene).voltage_v(PROTOCOL)
    monkeypatch.setattr(board_frames, "WHOLE_FRAMES", 1)
    monkeypatch.setattr(board_frames, "WINDOW_FRAMES", 5)
    rows = BoardFrames(scene).rows(PROTOCOL)
    for frame in (47, 0, 8, 30, 31, 9):
        first, volts = rows.around(frame)
        assert first == frame
        np.testing.assert_array_equal(volts, at_once[frame : frame + 1])


def test_a_long_scene_is_not_simulated_before_its_first_frame():
    few, many = (BoardFrames(moving(n)).rows(PROTOCOL) for n in (2_000, 200_000))
    few.around(8)
    many.around(8)
    assert many.solves == few.solves < 120
    before = many.solves
    many.around(8 + 60_000)
    assert many.solves - before < 120


def test_memory_stays_flat():
    rows = BoardFrames(moving(200_000)).rows(PROTOCOL)
    kept = []
    tracemalloc.start()
    try:
        for frame in range(8, 8 + 768):
            rows.around(frame)
            kept.append(tracemalloc.get_traced_memory()[0])
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert kept[767] < kept[255] + 2e6
    assert peak < 30e6
