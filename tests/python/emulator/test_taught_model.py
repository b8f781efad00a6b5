"""A taught model on the emulated board: its results have the bits of this host.
teaching/test_teach.py compares with numpy."""

import zlib

import numpy as np
import pytest

from eitskin.model.build import BuildSettings, linearise, make_model
from eitskin.model.eitm import encode_model
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch
from eitskin.scene.simulate import simulate
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import opposite
from eitskin.skin.skin import Skin
from eitskin.teaching.plan import plan_places
from eitskin.teaching.presses import Presses
from eitskin.teaching.teach import teach
from emulated import board_of, clean, connect, power_up, restarted, twin_check
from small_models import EIGHT_OPPOSITE_TOML

SKIN = Skin("small", disk(100.0), Electrodes(count=8, width_mm=5.0), 0.1, 5.0)
PLACE_MM = (21.0, -12.0)
SCENE = f"""
[scene]
name = "one press"
frames = 400
elements = 900
skin = "skin.toml"
[[touch]]
radius_mm = 4.0
x_mm = {PLACE_MM[0]}
y_mm = {PLACE_MM[1]}
"""


def simulated_presses(count: int) -> Presses:
    place = plan_places(SKIN, opposite(8), count).place_mm
    scenes = tuple(
        TouchScene(str(k), (TrueTouch(float(x), float(y), 4.0, 5.0),))
        for k, (x, y) in enumerate(place)
    )
    made = simulate(SKIN, opposite(8), TouchSet("presses", 1, scenes))
    return Presses(
        opposite(8), np.repeat(made.untouched_v[:1], count, axis=0), made.frames_v, place
    )


def test_a_taught_model_is_uploaded_and_streamed(image, tmp_path):
    protocol = opposite(8)
    linear = linearise(SKIN, protocol, pixels_across=14, elements=900)
    physics = encode_model(make_model(SKIN, protocol, linear, BuildSettings(rank=14, samples=0)))
    taught = teach(simulated_presses(12), SKIN).model
    blob = encode_model(taught)
    (tmp_path / "skin.toml").write_text(EIGHT_OPPOSITE_TOML, encoding="utf-8")
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    device = connect(power_up(image, scene=str(tmp_path / "scene.toml"), model=physics))
    board = board_of(device)
    before, info = board.bank(0), device.upload_model(blob)
    assert (info.model_crc, info.bank, info.tared) == (zlib.crc32(blob), 1, 0)
    assert board.bank(1)[: len(blob)] == blob and board.bank(0) == before
    assert board.flash.words_programmed == -(-len(blob) // 4) + 8
    device.self_test()
    assert device.reset().bank == 1
    check, _, results = twin_check(device, blob, 6)
    assert check.as_dict()["same_bits"] and check.compared == 6
    last = results[-1]
    assert last is not None
    assert [(one.x_mm, one.y_mm) for one in last.touches] == [pytest.approx(PLACE_MM, abs=3)]
    clean(board)
    again = restarted(device)
    assert (again.board.model_crc, again.board.bank) == (zlib.crc32(blob), 1)
    clean(board)
