"""The commands before the emulated board: the issue's acceptance, and the demo's section."""

import json
from importlib.resources import files

import pytest

from eitskin.demo import demo
from eitskin.demo.demo_board import run_board_demo, to_json
from eitskin.scene.library_scenes import find_scene

IMAGE = files("eitskin.firmware").joinpath("nucleo_f767zi.bin")
needs_image = pytest.mark.skipif(
    not IMAGE.is_file(), reason="the prebuilt firmware is not there: scripts/firmware --prebuilt"
)


@needs_image
def test_a_scene_ends_by_itself(done, tmp_path):
    """That the touches lie where the scene has them is emulator/test_emulated_board.py's."""
    scene = tmp_path / "short.toml"
    scene.write_text('[scene]\nname = "short"\nframes = 4\nelements = 900\n', encoding="utf-8")
    *frames, summary, solves, _ = done(f"stream --device emu:{scene} --tare 4 -v").splitlines()
    assert 5 <= len(frames) <= 10 and float(frames[-1].split()[1]) < 0.2
    assert summary.startswith(f"{len(frames)} frames, ")
    assert summary.endswith("; 0 gaps (0 packets missing), 0 dropped here, 0 dropped by the board")
    assert solves.startswith("solve and touches on the board: p50 ")


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
