"""``eitskin scene``: what its commands print and write."""

import json
from pathlib import Path

import pytest
from scene_helpers import ELEMENTS, scene_command

from eitskin.errors import ConfigError, FileError, UsageError
from eitskin.frames.frames import load_frames

TEXT = f"""
[scene]
name = "short"
frames = 3
quiet_frames = 2
elements = {ELEMENTS}
[[touch]]
radius_mm = 9
x_mm = 10
y_mm = 20
[effects.noise]
snr_db = 60.0
"""


@pytest.fixture
def scene(tmp_path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_run_writes_frames_with_truth(scene, tmp_path, capsys):
    assert scene_command("run", str(scene), "-o", str(tmp_path / "f.npz"), "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["effects"] == ["noise"] and facts["counters"]["states"] == 2
    frames = load_frames(tmp_path / "f.npz")
    assert frames.n_frames == 3 and frames.truth_mask is not None and frames.touch_xy_mm is not None
    assert frames.meta["scene"] == TEXT
    again = scene_command("run", str(scene), "-o", str(tmp_path / "f.npz"), "--truth-pixels", "0")
    assert again == 0
    assert "short: 3 frames after 2 untouched ones" in capsys.readouterr().out
    assert load_frames(tmp_path / "f.npz").truth_mask is None


def test_plan_lists_the_steps(scene, capsys):
    scene_command("plan", str(scene), "--json")
    plan = json.loads(capsys.readouterr().out)
    assert [step["name"] for step in plan["steps"] if step["effect"]] == ["noise"]
    assert plan["factorisations"] == 2
    scene_command("plan", str(scene))
    assert "*noise" in capsys.readouterr().out


def test_picture_is_a_picture(scene, tmp_path):
    scene_command("picture", str(scene), "-o", str(tmp_path / "s.png"))
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [("list", "pinch"), ("effects", "gel_drying"), ("effects noise", "snr_db")],
)
def test_lists(arguments, named, capsys):
    for more in ([], ["--json"]):
        scene_command(*arguments.split(), *more)
        out = capsys.readouterr().out
        assert named in out
    content = json.loads(out)
    if arguments == "effects noise":
        assert {row["name"] for row in content["parameters"]} == {"snr_db", "noise_v"}
    else:
        assert content[named]


def test_bad_input_is_refused_before_the_work(scene, tmp_path):
    with pytest.raises(FileError, match="does not exist; make it first"):
        scene_command("run", str(scene), "-o", str(tmp_path / "none" / "f.npz"))
    with pytest.raises(ConfigError, match="unknown effect 'nose'; did you mean 'noise'"):
        scene_command("effects", "nose")
    with pytest.raises(UsageError, match="pixels across"):
        scene_command("run", str(scene), "-o", str(tmp_path / "f.npz"), "--truth-pixels", "3")
    scene.write_text(TEXT.replace("snr_db", "snr"), encoding="utf-8")
    said = r"short.toml \[effects.noise\]: unknown key 'snr'; did you mean 'snr_db'"
    with pytest.raises(ConfigError, match=said):
        scene_command("plan", str(scene))
