"""Pictures of a stream: one frame, many, and more than are kept."""

import numpy as np
import pytest

from eitskin.device.wire.packets import Solved
from eitskin.scene.random_touches import TrueTouch
from eitskin.session.frame import Frame
from eitskin.view.stream_picture import MAX_KEPT, MAX_PANELS, Album, draw_stream
from small_models import prebuilt

PNG = b"\x89PNG\r\n\x1a\n"
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


def seen(number: int) -> Frame:
    values = np.zeros(812, dtype=np.float32)
    values[number % 812] = 1.0
    true = (TrueTouch(0.0, 0.0, 9.0, 5.0),)
    return Frame(number, 1000 * number, 0, solver_image=values, info=SOLVED, true=true)


def album(count: int) -> Album:
    kept = Album()
    for number in range(count):
        kept.add(seen(number))
    return kept


@pytest.mark.parametrize(
    "count", [1, 2, pytest.param(50, marks=pytest.mark.long("streams of 1 and 2 frames"))]
)
def test_pictures(count, tmp_path):
    path = tmp_path / "picture.png"
    draw_stream(path, prebuilt()[0], album(count), title="a board")
    assert path.read_bytes()[:8] == PNG and path.stat().st_size > 5000


def test_panels_are_spread_evenly_with_both_ends():
    kept = album(100)
    numbers = [one.number for one in kept.spread()]
    assert len(numbers) == MAX_PANELS and (numbers[0], numbers[-1]) == (0, 99)
    assert [one.number for one in album(3).spread()] == [0, 1, 2]


def test_a_long_stream_is_thinned_and_its_last_frame_kept():
    long = album(5 * MAX_KEPT + 3)
    numbers = [one.number for one in long.spread()]
    assert len(numbers) == MAX_PANELS and numbers[0] == 0 and numbers[-1] == 5 * MAX_KEPT + 2
    assert len(long._kept) < MAX_KEPT and long.count == 5 * MAX_KEPT + 3
    steps = np.diff(numbers)
    assert steps.max() < 2 * steps.min() + 20
