"""Messages name what was found and what to do about it; printed commands can be pasted."""

import shlex
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import eitskin
from eitskin.cli.main import main
from eitskin.device.open import open_device
from eitskin.errors import ConfigError, EitskinError, FrameError, UsageError
from eitskin.frames.arrays import pick, read_arrays
from eitskin.frames.frames import Frames, save_frames
from eitskin.page.server import listen
from eitskin.session.checks.raw_frames import frames_of as raw_frames
from eitskin.skin.drawing import read_drawing
from eitskin.skin.drawing_shapes import DrawingReading
from small_models import session

RING = "M10 10H110V110H10Z M45 45H75V75H45Z"
SKIN = """
[skin]
name = "small"
diameter_mm = 100.0
thickness_mm = 5.0
conductivity_s_per_m = 0.02
[electrodes]
count = 16
width_mm = 4.0
"""
SQUARE = "M10 10H110V110H10Z"
HIDDEN = {
    "attribute": 'display="none"',
    "style": 'style="fill:none; display : none"',
    "visibility": 'visibility="hidden"',
    "visibility in style": 'style="visibility:hidden"',
    "opacity": 'style="opacity:0"',
}


def svg(folder: Path, *shapes: str, around: str = "") -> Path:
    path = folder / "d.svg"
    body = "".join(shapes)
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="120mm" height="120mm"'
        f' viewBox="0 0 120 120"><g {around}>{body}</g></svg>'
    )
    return path


def outline(path: Path, element: str | None = None):
    return read_drawing(path, DrawingReading()).outline(element)


@pytest.mark.parametrize("element", ("plate", None))
def test_a_hole_is_named_with_what_to_do(tmp_path, element):
    path = svg(tmp_path, f'<path id="plate" d="{RING}"/>')
    with pytest.raises(EitskinError, match=r"'plate' itself has 2 closed parts.*one rim.*split"):
        outline(path, element)
    two = svg(tmp_path, f'<path id="a" d="{SQUARE}"/><path id="b" d="M45 45H75V75H45Z"/>')
    with pytest.raises(EitskinError, match="2 closed outlines; name one with element"):
        outline(two)


@pytest.mark.parametrize("how", HIDDEN.values(), ids=HIDDEN)
def test_a_hidden_shape_is_no_rim(tmp_path, how):
    shown = '<circle cx="60" cy="60" r="20"/>'
    path = svg(tmp_path, f'<path d="{SQUARE}" {how}/>', shown)
    assert np.ptp(outline(path).vertices_mm, axis=0).max() < 41
    alone = svg(tmp_path, f'<path d="{SQUARE}" {how}/>')
    with pytest.raises(EitskinError, match=r"nothing is drawn .* 1 hidden shapes or groups"):
        outline(alone)
    group = svg(tmp_path, f'<path d="{SQUARE}"/>', around=how)
    with pytest.raises(EitskinError, match=r"nothing is drawn .* hidden"):
        outline(group)


def test_what_a_dxf_holds_besides_lines_is_named(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="the extra drawing is not installed")
    document = ezdxf.new(units=4)
    hatch = document.modelspace().add_hatch()
    hatch.paths.add_polyline_path([(0, 0), (100, 0), (100, 100)], is_closed=True)
    document.paperspace().add_line((0, 0), (1, 1))
    document.saveas(tmp_path / "h.dxf")
    with pytest.raises(EitskinError, match=r"nothing is drawn .*1 HATCH.*1 LINE in paper space"):
        read_drawing(tmp_path / "h.dxf", DrawingReading())


def test_an_array_that_is_not_numbers_is_named(tmp_path):
    from scipy import sparse
    from scipy.io import savemat

    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = np.arange(3.0), np.arange(4.0)
    savemat(tmp_path / "m.mat", {"vi": cell, "vh": {"meas": np.arange(3.0)}, "x": np.eye(2),
                                 "s": sparse.csc_matrix(np.eye(3))})  # fmt: skip
    np.savez(tmp_path / "p.npz", v=np.array([[1], [1, 2]], dtype=object), w=np.eye(2))
    arrays = read_arrays(tmp_path / "m.mat")
    assert np.array_equal(arrays["s"], np.eye(3))
    for key, said in (("vi", "is a cell array; .*cell2mat"), ("vh", "is a struct; .*vh.meas"),
                      ("vj", r"no array 'vj'.*not as numbers: vi \(a cell array\)")):  # fmt: skip
        with pytest.raises(FrameError, match=said):
            pick(arrays, key, "--voltage", "m.mat")
    with pytest.raises(FrameError, match=r"is an array of pickled Python objects; .*np.savez"):
        pick(read_arrays(tmp_path / "p.npz"), "v", "--voltage", "p.npz")


def test_open_device_honours_the_speed():
    def took(url: str) -> float:
        with open_device(url) as device:
            device.tare()
            began = time.monotonic()
            device.start_scene()
            assert sum(1 for _ in device.stream(frames=6)) >= 6
            return time.monotonic() - began

    period_s = 1e-6 * 5 * open_period_us()
    assert took("sim:two_touch?speed=0.5") >= 2 * period_s > period_s / 2


def open_period_us() -> int:
    with open_device("sim:two_touch") as device:
        return device.board.frame_us


def test_a_path_in_place_of_a_model():
    for given in ("x.eitm", Path("x.eitm"), None):
        with pytest.raises(UsageError, match=r"not a model; write .*eitskin\.load_model\(PATH\)"):
            eitskin.Reconstructor(given)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("reconstruct f.npz --iteration-limit 5", "did you mean '--iterations'"),
        ("import f.csv -o x.npz --protokol adjacent", "did you mean '--protocol'"),
        ("stream --device sim:two_touch --frame-count 3", "did you mean"),
        ("view --devise sim:two_touch", "did you mean '--device'"),
    ],
)
def test_the_nearest_option(typed, said, capsys):
    assert main(shlex.split(typed)) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(("rate_hz", "code"), [(5, 0), (48, 0), (60, 2)])
def test_the_rate_of_a_scene_holds_or_is_refused(tmp_path, capsys, rate_hz, code):
    scene = tmp_path / "s.toml"
    scene.write_text(
        f"[scene]\nframes = 4\nquiet_frames = 8\nelements = 1500\nrate_hz = {rate_hz}\n"
    )
    words = ["stream", "--device", f"sim:{scene}", "--frames", "3", "--json"]
    assert main(words) == code
    said = capsys.readouterr()
    if code:
        assert "a scan takes 20.8 ms: use at most 48.08" in said.err
        return
    with open_device(f"sim:{scene}") as device:
        assert abs(device.board.frame_us - 1e6 / rate_hz) < 40


def test_ids_without_times_are_explained(tmp_path, capsys):
    scene = session().as_frames()
    frames = Frames(scene.protocol, scene.voltage_v, scene.reference_voltage_v)
    save_frames(tmp_path / "f.npz", frames)
    assert main(["reconstruct", str(tmp_path / "f.npz")]) == 0
    assert (
        "ids number the touches of each frame alone; if the frames are a stream, import them with"
        in (capsys.readouterr().err)
    )
    save_frames(tmp_path / "f.npz", replace(frames, time_s=np.arange(frames.n_frames) / 48))
    assert main(["reconstruct", str(tmp_path / "f.npz")]) == 0
    assert "ids number" not in capsys.readouterr().err


def test_no_found_touch_has_no_error_in_mm(tmp_path, capsys):
    frames = session().as_frames()
    quiet = np.repeat(frames.reference_v[None], frames.n_frames, axis=0)
    save_frames(tmp_path / "q.npz", replace(frames, voltage_v=quiet))
    assert main(["reconstruct", str(tmp_path / "q.npz")]) == 0
    out = capsys.readouterr().out
    assert "nan" not in out and "0 of" in out


def test_printed_commands_have_their_paths_quoted(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my run").mkdir()
    volts = session().as_frames()
    table = -np.vstack([volts.reference_voltage_v, volts.voltage_v])
    np.savetxt("my run/a b.csv", table, delimiter=",")
    words = ["--protocol", "adjacent", "--electrodes", "16", "--reference-frames", "0"]
    assert main(["doctor", "my run/a b.csv", *words]) == 11
    line = capsys.readouterr().out.partition("all in one: ")[2].strip()
    assert main(shlex.split(line)[1:]) == 0
    capsys.readouterr()
    assert main(["import", "my run/a b.csv", "-o", "my run/c d.npz", *words]) == 0
    assert "eitskin doctor 'my run/c d.npz'" in capsys.readouterr().out


def test_presses_that_are_continued_are_named_with_their_option(tmp_path, capsys):
    plan, presses = tmp_path / "plan.csv", tmp_path / "presses.npz"
    skin = tmp_path / "skin.toml"
    skin.write_text(SKIN)
    assert main(["teach", "plan", str(skin), "-o", str(plan)]) == 0
    view = ["view", "--device", "sim:tap", "--folder", str(tmp_path), "--teach", str(plan)]
    presses.mkdir()
    capsys.readouterr()
    assert main(view) != 0
    said = capsys.readouterr().err
    assert f"--teach continues {presses}; name another file with  --presses FILE" in said
    assert said.endswith("; the presses go there unless you say  --presses FILE\n")
    assert main([*view, "--presses", str(presses)]) != 0
    assert "--presses FILE" not in capsys.readouterr().err


def test_an_unknown_argument_of_stream_gets_the_nearest_of_all():
    with pytest.raises(UsageError, match=r"stream\(frame=...\).*did you mean 'frames'"):
        next(eitskin.stream("sim:two_touch", sign="both", frame=3))
    with pytest.raises(UsageError, match="did you mean 'iterations'"):
        next(eitskin.stream("sim:two_touch", iteration=3))


def test_a_frame_without_voltages_names_the_mode_that_brings_them():
    with pytest.raises(FrameError, match=r'is None.*mode="raw,touches"'):
        eitskin.Reconstructor(eitskin.load_model()).reconstruct(None)


def test_a_recording_without_raw_frames_says_how_python_records_them(tmp_path):
    path = tmp_path / "run.eits"
    for _ in eitskin.stream("sim:two_touch", frames=1, record=path):
        pass
    with pytest.raises(FrameError, match=r'in Python .*mode="raw,touches"'):
        raw_frames(path)


def test_a_port_in_use_is_told_in_words():
    with listen("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        with pytest.raises(UsageError) as end:
            listen("127.0.0.1", port)
    assert str(end.value) == (
        f"cannot listen on 127.0.0.1 port {port} (another program has it, perhaps a second view);"
        " name another with  --port, --port 0  for any that is free"
    )


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"url": None}, "url=None.: must be a text or the path of a file"),
        ({"url": ["sim:tap", "sim:swipe"]}, "url=.*must be a text or the path"),
        (
            {"model": eitskin.load_model()},
            "model=<Model paper.*must be a text or the path of a file",
        ),
        ({"mode": ["raw", "touches"]}, r'mode=\[.*: must be a text, such as "raw,touches"'),
        ({"frames": "5"}, "frames='5'.: must be a whole number, 0 or more"),
        ({"frames": 2.5}, "frames=2.5.: must be a whole number"),
        ({"frames": -1}, "frames=-1.: must be a whole number, 0 or more"),
        ({"speed": "fast"}, "speed='fast'.: must be a number, 0 or more"),
        ({"sign": "up"}, "sign='up'.: known are: both, decrease, increase"),
    ],
)
def test_an_argument_of_the_wrong_kind_is_named(named, said):
    with pytest.raises(UsageError, match=rf"^stream\({said}"):
        next(eitskin.stream(**{"url": "sim:two_touch", **named}))


def test_one_sink_kinds_with_a_space_and_a_path_are_understood(tmp_path):
    scene, table = tmp_path / "one finger.toml", tmp_path / "touches.csv"
    scene.write_text("[scene]\n[[touch]]\nradius_mm = 8.0\nx_mm = 5.0\ny_mm = 0.0\n")
    with pytest.raises(ConfigError, match=r"a scene, not a robot file.* sim:"):
        next(eitskin.stream(scene))
    url, sink = f"sim:{scene}", f"csv:{table}"
    frames = list(eitskin.stream(url, mode="raw, touches", frames=1, to=sink))
    assert frames[0].voltage_v is not None and len(frames[0].touches) == 1
    assert len(table.read_text().splitlines()) == 2
