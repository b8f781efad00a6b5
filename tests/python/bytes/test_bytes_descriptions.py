"""Any text as a scene's or a skin's description: a scene, or a refusal of one line."""

import pytest
from bytes_damage import ODD_BYTES, ODD_WORDS, any_bytes, bounded, read_or_refuse, written
from hypothesis import given

from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import load_scene
from eitskin.scene.library_scenes import library
from eitskin.skin.skin import load_skin, skin_from_table, skin_to_table

SKIN = b"""[skin]
name = "mat"
polygon_mm = [[0, 0], [100, 0], [100, 50.5], [0, 50]]
thickness_mm = 5.0
conductivity_s_per_m = 0.02
[electrodes]
count = 8
width_mm = 3
positions_mm = [1, 30, 60, 90, 120, 150, 200, 250]
direction = "clockwise"
contact_impedance_ohm_m2 = 1e-3
[protocol]
kind = "adjacent"
"""
DISK = (
    b"[skin]\ndiameter_mm = 194\n[electrodes]\ncount = 16\nstart_angle_deg = 12.5\n[protocol]\nkind"
    b' = "skip"\nskip = 2\n'
)
SCENE = b"""[scene]
name = "two"
skin = "skin.toml"
frames = 3
quiet_frames = 4
rate_hz = 20
seed = 5
elements = 400
[[touch]]
path = [{ t_s = 0, x_mm = 40, y_mm = 25, radius_mm = 5, press = 0.3 },
        { t_s = 0.1, x_mm = 45, y_mm = 25, radius_mm = 6, press = 1 }]
hold = true
[[touch]]
x_mm = 80
y_mm = 20
radius_mm = 6.5
press = 0.9
from_s = 0.05
to_s = 0.1
[effects.noise]
snr_db = 60
"""
WORDS = ODD_BYTES + ODD_WORDS


SCENES = [SCENE, *(path.read_bytes() for path in library().values())]


@given(content=any_bytes([SKIN, DISK], WORDS))
@bounded(300)
def test_any_skin_is_read_or_refused_in_a_line(tmp_path, content):
    path = written(tmp_path, "skin.toml", content)
    read = read_or_refuse(load_skin, path)
    if read is not None:
        skin, protocol = read
        assert protocol.n_electrodes == skin.electrodes.count
        assert skin_from_table(skin_to_table(skin), "again") == skin


@given(content=any_bytes(SCENES, WORDS))
@bounded(300)
def test_any_scene_is_read_or_refused_in_a_line(tmp_path, content):
    written(tmp_path, "skin.toml", SKIN)
    path = written(tmp_path, "scene.toml", content)
    scene = read_or_refuse(load_scene, path)
    if scene is not None and scene.frames <= 100:
        read_or_refuse(compile_scene, scene)


NUMBERS = ("nan", "inf", "-inf", "9" * 400, "9" * 5000, "-1", "1e999")
OTHERS = ("true", '"a"', '"\\u0000"', "[]", "[" * 5000, "1979-05-27", "{}")


@pytest.mark.parametrize("value", NUMBERS + OTHERS, ids=lambda value: value[:12])
def test_each_value_of_a_wrong_kind_is_refused_in_a_line(tmp_path, value):
    written(tmp_path, "skin.toml", SKIN)
    for whole, read in ((SKIN, load_skin), (DISK, load_skin), (SCENE, load_scene)):
        lines = whole.decode().splitlines()
        for k, line in enumerate(lines):
            key, equals, _ = line.partition(" = ")
            if equals:
                text = "\n".join([*lines[:k], f"{key} = {value}", *lines[k + 1 :]])
                path = written(tmp_path, "x.toml", text.encode())
                read_or_refuse(read, path)
