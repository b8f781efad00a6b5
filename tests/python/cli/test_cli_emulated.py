"""The commands before the emulated board: the issue's acceptance, and the demo's section."""

import json
import re
from importlib.resources import files

import pytest

from eitskin.demo import demo
from eitskin.demo.demo_board import run_board_demo, to_json, to_text
from eitskin.scene.library_scenes import find_scene

OFF_BY = re.compile(r"off by (\d+\.\d\d) mm")
IMAGE = files("eitskin.firmware").joinpath("nucleo_f767zi.bin")
needs_image = pytest.mark.skipif(
    not IMAGE.is_file(), reason="the prebuilt firmware is not there: scripts/firmware --prebuilt"
)


@needs_image
def test_two_touches_within_two_millimetres_of_the_scene(done, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = done("stream", "--device", "emu:two_touch.toml", "--frames", "20", "-v").splitlines()
    for line in lines[:20]:
        errors = [float(error) for error in OFF_BY.findall(line)]
        assert len(errors) == 2 and max(errors) < 2.0, line
    assert lines[20].startswith("20 frames, ")
    assert lines[20].endswith(
        "; 0 gaps (0 packets missing), 0 dropped here, 0 dropped by the board"
    )
    assert lines[21].startswith("solve and touches on the board: p50 ")
    assert "40 of 40 touches found, 0 false" in lines[22]


@needs_image
def test_images_within_two_millimetres_of_the_scene(tmp_path, capsys):
    from eitskin.cli.main import main

    picture = tmp_path / "images.png"
    arguments = [
        "stream",
        "--device",
        "emu:two_touch",
        "--mode",
        "image",
        "--frames",
        "6",
        "--picture",
        str(picture),
    ]
    assert main(arguments) == 0
    out, err = capsys.readouterr()
    errors = [float(error) for error in OFF_BY.findall(out)]
    assert len(errors) == 12 and max(errors) < 2.0
    assert picture.stat().st_size > 10_000 and "one frame in 2 of image" in err


@needs_image
def test_a_scene_ends_by_itself(done, tmp_path):
    scene = tmp_path / "short.toml"
    scene.write_text('[scene]\nname = "short"\nframes = 4\nelements = 900\n', encoding="utf-8")
    *frames, _ = map(json.loads, done("stream", "--device", f"emu:{scene}", "--json").splitlines())
    assert 5 <= len(frames) <= 10 and frames[-1]["time_s"] < 0.2


@needs_image
def test_the_emulated_boards_images_are_this_hosts(tmp_path, capsys):
    from eitskin.cli.main import main

    path = tmp_path / "run.eits"
    assert main(["record", "--device", "emu:two_touch", "-o", str(path), "--frames", "8"]) == 0
    capsys.readouterr()
    assert main(["replay", str(path), "--check", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["same_bits"] and facts["images"] == facts["touches"] == 8
    assert facts["untold"] == facts["alone"] == 0


@needs_image
def test_the_demos_touches_on_the_emulated_board():
    result = run_board_demo("emu:demo")
    assert result.check.as_dict()["same_bits"] and result.check.compared == 3
    assert result.matching.hits == 3 and max(result.matching.distances_mm) < 2.0
    assert result.matching.false_touches == 0
    text = to_text(result)
    assert "nucleo_f767zi, firmware 0.1.0" in text and "same bits: yes, 3 images" in text
    json.dumps(to_json(result), allow_nan=False)


def test_the_demos_touches_on_a_simulated_board():
    result = run_board_demo("sim:demo")
    assert result.check.as_dict()["same_bits"] and result.matching.hits == 3
    assert to_json(result)["solve_us_p50"] is None


def test_the_library_scene_is_the_demos():
    tracks = find_scene("demo").touches
    scene = [
        (t.keyframes[0].x_mm, t.keyframes[0].y_mm, t.keyframes[0].radius_mm, t.keyframes[0].drive)
        for t in tracks
    ]
    assert [place[:3] for place in scene] == [(t.x_mm, t.y_mm, t.radius_mm) for t in demo.TOUCHES]
    contrasts = [float(s.contrast[0]) for s in find_scene("demo").samples()]
    assert contrasts == [t.contrast for t in demo.TOUCHES]


def test_the_demo_goes_without_an_emulator(tmp_path):
    from fresh_python import MAIN, run_python, without

    done = run_python(
        without("unicorn") + MAIN, "demo", "--picture", tmp_path / "demo.png", "--json"
    )
    facts = json.loads(done.stdout)
    assert done.returncode == 0 and facts["board"] is None and facts["hits"] == 3
    *steps, missing = done.stderr.splitlines()
    assert [step.split()[0] for step in steps] == ["1/4", "2/4", "3/4", "4/4"]
    assert "without the emulated board" in missing
