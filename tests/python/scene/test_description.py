"""Scenes that are read from TOML: their contents, and refusals that name file, table and key."""

from pathlib import Path

import numpy as np
import pytest

from eitskin.errors import ConfigError, EitskinError
from eitskin.scene.description import Scene, load_scene
from eitskin.scene.laws import Piezoresistive, ShortCircuit
from eitskin.scene.touch_path import Keyframe, TouchTrack, always, sample, touches_at

HEAD = '[scan]\nfrozen = true\n[scene]\nname = "s"\nframes = 40\nrate_hz = 20.0\nquiet_frames = 4\n'
TOUCH = (
    "[[touch]]\nradius_mm = 8.0\npath = [{t_s = 0.5, x_mm = -30, y_mm = 0}, {t_s = 1.5, x_mm = 30,"
    " y_mm = 10}]\n"
)


def written(folder: Path, text: str) -> Path:
    path = folder / "s.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_touch_comes_moves_and_goes(tmp_path):
    scene = load_scene(written(tmp_path, HEAD + TOUCH))
    (one,) = scene.samples()
    assert scene.n_frames == 44 and scene.times_s()[10] == 0.5
    assert np.flatnonzero(one.there).tolist() == list(range(10, 31))
    assert (one.x_mm[10], one.x_mm[20], one.x_mm[30]) == (-30.0, pytest.approx(0.0), 30.0)
    assert one.y_mm[20] == pytest.approx(5.0)
    assert touches_at([one], 9) == () and touches_at([one], 20)[0].contrast == 9.0
    assert scene.text == HEAD + TOUCH


def test_hold_keeps_a_touch_and_standing_touches_need_no_path(tmp_path):
    touch = TOUCH.replace("radius_mm", "hold = true\nradius_mm")
    held = load_scene(written(tmp_path, HEAD + touch))
    assert held.samples()[0].there[39] and held.samples()[0].x_mm[39] == 30.0
    text = HEAD + "[[touch]]\nradius_mm = 8\nx_mm = 1\ny_mm = 2\n"
    assert load_scene(written(tmp_path, text)).samples()[0].there.all()
    assert not load_scene(written(tmp_path, text)).touches[0].moves
    bounded = load_scene(written(tmp_path, text + "from_s = 0.5\nto_s = 1.0\n")).samples()[0]
    assert np.flatnonzero(bounded.there).tolist() == list(range(10, 21))


def test_press_scales_the_contact():
    keys = (Keyframe(0.0, 0, 0, 8, 0.0), Keyframe(1.0, 0, 0, 8, 1.0))
    found = sample(TouchTrack(keys, ShortCircuit(9.0)), np.array([0.0, 0.25, 1.0]))
    assert found.there.tolist() == [False, True, True]
    assert found.contrast[1:] == pytest.approx([3.0, 9.0])


def test_load_is_nearly_linear_and_saturates():
    """Slope at no load as stated; 10 % below the straight line at small loads at most; never beyond
    saturation."""
    law = Piezoresistive(0.01, 11.0)
    change = law.contrast_at(np.array([0.0, 1e-3, 100.0, 1e6])) - 1
    assert change[0] == 0 and change[1] == pytest.approx(1e-5, rel=1e-5)
    assert change[2] == pytest.approx(10 * (1 - np.exp(-0.1))) and 0.9 < change[2] < 1.0
    assert change[3] == pytest.approx(10.0)


def head(old: str, new: str) -> str:
    return HEAD.replace(old, new)


def touch(old: str, new: str) -> str:
    return HEAD + TOUCH.replace(old, new)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (head("frames = 40", "frams = 40"),
         r"\[scene\]: unknown key 'frams'; did you mean 'frames'"),
        (head("frames = 40", "frames = 0"), r"\[scene\]: frames = 0 is out of range"),
        (HEAD + "[touche]\n", "unknown key 'touche'; did you mean 'touch'"),
        (HEAD + "[touch]\nradius_mm = 8\n", r"two brackets"),
        (HEAD + "effects = 3\n", r"\[scene\]: unknown key 'effects'"),
        (HEAD + "[effects]\nnoise = 3\n",
         r"\[effects\]: noise = 3 must be a table: write \[effects.noise\]"),
        (HEAD + 'skin = "nowhere.toml"\n', r"skin = 'nowhere.toml' is neither"),
        (HEAD + 'solver = "magic"\n', r"solver = 'magic' is not known"),
        (touch("8.0", "0"),
         r"\[\[touch\]\] 0 .* path 0 \(from 0\): radius_mm = 0 is out of range"),
        (touch("8.0", "-2"), "radius_mm = -2 is out of range"),
        (touch("x_mm = 30", "x_mm = 92"),
         r"\[\[touch\]\] 0 \(from 0\): at 1.5 s x_mm = 92.* outside"),
        (HEAD + TOUCH + TOUCH,
         r"\[\[touch\]\] 1 \(from 0\): it overlaps touch 0 by 16 mm at 0.5 s"),
        (touch("t_s = 1.5", "t_s = 0.5"), r"path 1 \(from 0\): t_s = 0.5 is not after 0.5"),
        (HEAD + TOUCH + "contrast = -1\n", "contrast = -1 is out of range; it must be above 0"),
        (HEAD + TOUCH + "contrast = 0\n", "contrast = 0 is out of range"),
        (HEAD + TOUCH + "grams = 5\n", 'grams goes with law = "piezoresistive"'),
        (HEAD + TOUCH + 'law = "piezo"\n',
         "law = 'piezo' is not known; did you mean 'piezoresistive'"),
        (HEAD + TOUCH + 'law = "piezoresistive"\n',
         r"path 0 \(from 0\): the key 'grams' is required"),
        (HEAD + TOUCH + "x_mm = 5\n", "x_mm beside path"),
        (touch("y_mm = 10", 'y_mm = "10"'), "y_mm must be a number"),
        (touch("radius_mm = 8.0\n", ""), "the key 'radius_mm' is required"),
        (HEAD + "[[touch]]\nradius_mm = 8\nx_mm = nan\ny_mm = 0\n", "x_mm = nan is out of range"),
        (HEAD + "[[touch]]\nradius_mm = 8\npath = []\n", "path must be a list of keyframes"),
        ("[scene\n", "not valid TOML"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line_naming_file_table_and_key(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(EitskinError, match=said) as caught:
        load_scene(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"touches": (always(95, 0, 8),)}, "outside"),
        ({"touches": (always(0, 0, 0),)}, "radius_mm must be above 0"),
        ({"touches": (always(0, 0, 8, ShortCircuit(-1.0)),)}, "contrast must be above 0"),
        ({"seed": -1}, "seed = -1"),
    ],
)
def test_scenes_made_in_python_are_checked_too(given, said):
    with pytest.raises(ConfigError, match=said):
        Scene("s", **given)


def test_a_skin_file_beside_the_scene_is_found(tmp_path):
    (tmp_path / "skin.toml").write_text(
        '[skin]\nname = "mine"\ndiameter_mm = 100\n[electrodes]\ncount = 8\n'
    )
    scene = load_scene(written(tmp_path, HEAD + 'skin = "skin.toml"\n'))
    assert scene.skin.name == "mine" and scene.protocol.n_electrodes == 8
