"""``eitskin reconstruct``: frames to touches, images, files and pictures."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.core.options_table import SOLVERS
from eitskin.frames.frames import load_frames, save_frames
from eitskin.model.eitm import load_model
from eitskin.scene.random_touches import TouchRules, TouchScene, TouchSet, random_touches
from eitskin.scene.random_touches import TrueTouch as Put
from eitskin.scene.simulate import simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import load_skin, paper_skin
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt, session

PNG = b"\x89PNG\r\n\x1a\n"
TOUCH = {
    "id", "x_mm", "y_mm", "radius_mm", "strength_s_per_m_mm2", "explained", "force_n", "confidence",
    "x_variance_mm2", "xy_covariance_mm2", "y_variance_mm2", "long_x_mm", "long_y_mm",
    "radius_sd_mm", "confirmed",
}  # fmt: skip
INFO = {
    "iterations", "stop", "nonzeros", "masked", "step_halvings", "touches", "macs", "touch_macs",
    "lambda", "lambda_max",
    "lambda_noise", "gap", "gap_rel", "residual", "data_norm", "solve_us", "touch_us",
    "diagnostics", "found", "saturated", "outliers", "model_mismatch", "unexplained", "shown",
    "regularisation",
    "open_electrodes", "bridged_electrodes", "noisy_electrodes",
}  # fmt: skip
SUMMARY = {
    "frames", "found", "true", "false", "position_median_mm", "position_worst_mm", "miou_image",
    "miou_solver", "miou_touches",
}  # fmt: skip


@pytest.mark.parametrize("engine", ["c", "c64"])
def test_json(engine, json_of, frames_file):
    facts = json_of(f"reconstruct {frames_file} --engine {engine}")
    found = facts["model"], facts["engine"], len(facts["frames"])
    assert found == ("prebuilt paper skin", engine, 20)
    for number, frame in enumerate(facts["frames"]):
        assert frame["frame"] == number and frame["name"] == f"test-s3-{number}"
        assert set(frame["info"]) == INFO and frame["info"]["iterations"] == 60
        assert frame["info"]["solve_us"] > 0
        assert all(set(touch) == TOUCH for touch in frame["touches"])
        assert len(frame["touches"]) == frame["info"]["touches"]
        assert 0.4 < frame["miou_image"] < 1 and 0.4 < frame["miou_touches"] < 1
    summary = facts["summary"]
    assert set(summary) == SUMMARY
    assert summary["frames"] == 20
    assert summary["true"] == sum(len(scene.touches) for scene in session().touches.scenes)
    assert summary["found"] >= 0.9 * summary["true"] and summary["false"] <= 2
    assert summary["position_median_mm"] < 1.2 < summary["position_worst_mm"] < 10
    assert summary["miou_image"] > 0.8 and summary["miou_touches"] > 0.88


def test_json_by_numpy(json_of, frames_file):
    """The same fields, and the touches of the core but for a confidence."""
    only = "--only test-s3-0,test-s3-1"
    ours, theirs = (
        json_of(f"reconstruct {frames_file} --engine {engine} {only}") for engine in ("numpy", "c")
    )
    assert ours["engine"] == "numpy" and len(ours["frames"]) == 2
    for one, other in zip(ours["frames"], theirs["frames"], strict=True):
        assert set(one["info"]) == INFO and one["info"]["iterations"] == 60
        assert len(one["touches"]) == len(other["touches"])
        assert all(set(touch) == TOUCH for touch in one["touches"])
        assert all(touch["confidence"] is None for touch in one["touches"])
        for touch, near in zip(one["touches"], other["touches"], strict=True):
            off = touch["x_mm"] - near["x_mm"], touch["y_mm"] - near["y_mm"]
            assert abs(off[0]) < 2 and abs(off[1]) < 2  # the oracle fits discs alone


def test_what_is_found_is_said(done, frames_file, tmp_path, capsys):
    """A detached electrode in frame 1, an outlier in frame 2: by name in table and JSON; too many
    rows: refused, by name."""
    frames = load_frames(frames_file)
    spoilt = frames.voltage_v.copy()
    spoilt[1, (frames.protocol.drive_measure == 5).any(axis=1)] = 0.0
    spoilt[2, 30] *= 1.5
    spoilt[3, np.isin(frames.protocol.drive_measure, (2, 6, 10)).any(axis=1)] = 0.0
    save_frames(tmp_path / "spoilt.npz", replace(frames, voltage_v=spoilt))
    code = main(["reconstruct", str(tmp_path / "spoilt.npz"), "--json"])
    said = capsys.readouterr()
    listed = json.loads(said.out)["frames"]
    assert code == 8 and "electrodes 2, 6 and 10 open" in listed[3]["refused"]
    assert "electrodes 2, 6 and 10 open" in said.err
    assert listed[1]["info"]["found"][0] == "electrode 5 open" and listed[1]["info"]["masked"] == 52
    assert listed[2]["info"]["diagnostics"][0] == "outlier"
    assert listed[2]["info"]["outliers"] in (1, 2)
    assert listed[0]["info"]["masked"] == 0 and set(listed[0]["info"]["diagnostics"]) <= {"crowded"}
    main(["reconstruct", str(tmp_path / "spoilt.npz"), "--only", "test-s3-1"])
    assert "diagnostics: electrode 5 open" in capsys.readouterr().out


def test_what_it_says_is_what_the_reconstructor_does(json_of, frames_file):
    facts = json_of(f"reconstruct {frames_file} --iterations 25 --sign both")
    reconstructor = Reconstructor(*prebuilt()[:1], blob=prebuilt()[1])
    reconstructor.set_options(iterations=25, sign="both")
    reconstructor.tare(session().untouched_v)
    for number in (0, 7, 19):
        reconstructor.forget()
        touches = reconstructor.reconstruct(session().frames_v[number]).touches
        listed = facts["frames"][number]["touches"]
        assert [(t["x_mm"], t["y_mm"]) for t in listed] == [(t.x_mm, t.y_mm) for t in touches]


def test_threads_change_nothing(json_of, frames_file, ran):
    one, three = (
        json_of(f"reconstruct {frames_file}", *threads) for threads in ((), ("--threads", "3"))
    )
    for frame in (*one["frames"], *three["frames"]):
        del frame["info"]["solve_us"], frame["info"]["touch_us"]
    assert one == three
    for arguments, text in (
        (("--threads", "0"), "use 1 to 256"),
        (("--threads", "2", "--warm"), "--warm starts each frame from the last one"),
        (("--threads", "2", "--engine", "numpy"), "the numpy engine uses one thread"),
    ):
        assert text in ran(2, f"reconstruct {frames_file}", *arguments)[1]


def test_options_reach_the_solver(json_of, frames_file, changed_frames):
    facts = json_of(f"reconstruct {frames_file} --gap 0.001 --iterations 5000")
    assert {frame["info"]["stop"] for frame in facts["frames"]} == {"gap"}
    assert all(frame["info"]["gap_rel"] <= 0.001 for frame in facts["frames"])
    infos = {}
    for solver in SOLVERS:
        facts = json_of(f"reconstruct {frames_file} --only test-s3-0 --solver {solver}")
        infos[solver] = facts["frames"][0]["info"]
    assert infos["working-set"]["macs"] < 0.25 * infos["fista"]["macs"]
    assert infos["active-set"]["stop"] == "optimum" and infos["active-set"]["gap_rel"] < 1e-5
    facts = json_of(f"reconstruct {frames_file} --only test-s3-0 --mac-limit 200000")
    assert facts["frames"][0]["info"]["stop"] == "macs"
    assert facts["frames"][0]["info"]["macs"] <= 200000
    resting = changed_frames(voltage_v=np.repeat(session().frames_v[:1], 20, axis=0))
    cold = json_of(f"reconstruct {resting} --iterations 10")["frames"]
    warm = json_of(f"reconstruct {resting} --iterations 10 --warm")["frames"]
    assert (
        cold[0]["info"]["gap"]
        == warm[0]["info"]["gap"]
        == cold[5]["info"]["gap"]
        > 2 * warm[5]["info"]["gap"]
    )
    assert {frame["touches"][0]["id"] for frame in (*warm, *cold)} == {1}
    limit = str(0.999 * np.abs(session().frames_v).max())
    masked = json_of(f"reconstruct {frames_file} --saturation-v {limit}")
    assert max(frame["info"]["masked"] for frame in masked["frames"]) >= 1
    some = json_of(f"reconstruct {frames_file} --only test-s3-4,test-s3-11")
    assert [frame["frame"] for frame in some["frames"]] == [4, 11]
    assert some["summary"]["frames"] == 2


def test_for_people(done, frames_file):
    text = done(f"reconstruct {frames_file}")
    lines = text.splitlines()
    found = " ".join(lines[0].split())
    assert found == "frame touch x mm y mm radius mm strength S/m mm2 error mm solve"
    assert text.count("60 iterations (limit), gap ") == 20
    assert "20 frames, 0 refused; median " in text and " of " in lines[-1]
    assert lines[-1].startswith("compared with the truth of 20")
    assert sum(line.startswith("test-s3-") for line in lines) == 20


def test_untouched_frames_show_nothing(done, json_of, changed_frames):
    untouched = session().untouched_v
    names = np.array([f"q{k}" for k in range(8)])
    given = {"voltage_v": untouched[:8], "reference_voltage_v": untouched[8:], "frame_name": names}
    path = changed_frames(truth=False, **given)
    text = done(f"reconstruct {path}")
    assert text.count("none (no change above the noise)") >= 7
    assert "compared with the truth" not in text
    facts = json_of(f"reconstruct {path}")
    assert "summary" not in facts
    assert {frame["info"]["stop"] for frame in facts["frames"]} <= {"below-threshold", "iterations"}


def test_output_and_picture(json_of, frames_file, tmp_path):
    output, picture = tmp_path / "out.npz", tmp_path / "out.png"
    facts = json_of(f"reconstruct {frames_file} -o {output} --picture {picture}")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out.npz", "out.png"]
    assert picture.read_bytes()[:8] == PNG and picture.stat().st_size > 20_000
    with np.load(output, allow_pickle=False) as saved:
        assert str(saved["format"]) == "eitskin-results"
        assert saved["image_s_per_m"].shape == (20, 32, 32)
        assert len(saved["touch_frame"]) == sum(len(frame["touches"]) for frame in facts["frames"])


def test_a_bad_frame_among_good_ones(changed_frames, tmp_path, ran):
    """The others are done, written and listed; the exit code says that not all were."""
    voltage = session().frames_v.copy()
    voltage[3, :150] = np.nan
    voltage[5] = 0
    path, output = changed_frames(voltage_v=voltage), tmp_path / "out.npz"
    out, err = ran(8, f"reconstruct {path} --json -o {output}")
    facts = json.loads(out)
    assert [frame["refused"] is None for frame in facts["frames"]].count(False) == 2
    assert "too many rows" in facts["frames"][3]["refused"]
    assert "zero" in facts["frames"][5]["refused"]
    lines = err.splitlines()
    assert len(lines) == 2 and all(line.startswith(f"eitskin: {path}: frame ") for line in lines)
    with np.load(output) as saved:
        assert saved["frame"].tolist() == [k for k in range(20) if k not in (3, 5)]


def test_a_reference_of_another_skin_is_warned_of(changed_frames, ran):
    order = np.random.default_rng(1).permutation(208)
    path = changed_frames(
        voltage_v=session().frames_v[:, order], reference_voltage_v=session().untouched_v[:, order]
    )
    err = ran(0, f"reconstruct {path}")[1]
    assert err.startswith("eitskin: warning: the reference correlates with the model only by 0.")
    assert err.count("\n") == 1
    assert f"eitskin doctor {path}" in err


def test_the_whole_way(done, json_of, tmp_path):
    """A description to a model to simulated frames to touches, with one's own skin: an L with 24
    electrodes."""
    skin_file = tmp_path / "hand.toml"
    skin_file.write_text(
        "[skin]\nname = 'hand'\npolygon_mm ="
        " [[0,0],[160,0],[160,80],[80,80],[80,160],[0,160]]\nthickness_mm ="
        " 6.0\nconductivity_s_per_m = 0.02\n[electrodes]\ncount = 24\nwidth_mm ="
        " 5.0\n[protocol]\nkind = 'skip'\nskip = 2\n"
    )
    model_file, frames_path = tmp_path / "hand.eitm", tmp_path / "frames.npz"
    done(f"model build {skin_file} -o {model_file} --samples 0")
    assert json_of(f"model info {model_file}")["skin"] == "hand"
    done(f"model verify {model_file}")
    skin, protocol = load_skin(skin_file)
    rules = TouchRules(count=(1, 2), radius_mm=(7, 10), gap_mm=20, rim_margin_mm=8)
    save_frames(
        frames_path,
        simulate(skin, protocol, random_touches(skin.outline, 5, 12, rules=rules)).as_frames(),
    )
    output, picture = tmp_path / "out.npz", tmp_path / "out.png"
    facts = json_of(
        f"reconstruct {frames_path} --model {model_file} -o {output} --picture {picture}"
    )
    assert facts["model"] == str(model_file)
    summary = facts["summary"]
    assert summary["found"] >= 0.85 * summary["true"] and summary["false"] <= 2
    assert summary["position_median_mm"] < 2 and summary["miou_image"] > 0.75
    assert summary["miou_touches"] > 0.8
    assert picture.read_bytes()[:8] == PNG
    with np.load(output) as saved:
        grid = load_model(model_file)[0].grid
        assert saved["image_s_per_m"].shape == (12, grid.ny, grid.nx)
        assert np.isnan(saved["image_s_per_m"]).sum() == 12 * (grid.nx * grid.ny - grid.n_pixels)
    assert load_frames(frames_path).n_frames == 12


@pytest.mark.long("test_the_demo_goes_without_an_emulator, test_the_whole_way")
def test_the_demo(tmp_path, ran):
    out, err = ran(0, f"demo --picture {tmp_path / 'demo.png'} --json")
    facts = json.loads(out)
    assert [line[:4] for line in err.splitlines()] == ["1/4 ", "2/4 ", "3/4 ", "4/4 "]
    assert (facts["hits"], facts["false"]) == (3, 0)
    assert max(facts["position_errors_mm"]) < 1
    assert (tmp_path / "demo.png").read_bytes()[:8] == PNG
    difference = facts["difference_over_peak"]
    assert 0 < difference["C float32 to numpy"] < 1e-4 and difference["C float64 to numpy"] < 1e-9


def test_a_stream_keeps_ids_and_confirms_touches(json_of, tmp_path):
    """A finger that moves 2 mm a frame keeps one id, and lies where each frame by itself has it.
    Its second frame confirms it."""
    moving = tuple(TouchScene(str(k), (Put(-20.0 + 2 * k, 30.0, 9.0, 5.0),)) for k in range(8))
    made = simulate(paper_skin(), adjacent(16), TouchSet("moving", 1, moving)).as_frames()
    save_frames(tmp_path / "moving.npz", replace(made, time_s=np.arange(8) / 48))
    (stream,), (alone,) = (
        zip(*(frame["touches"] for frame in frames), strict=True)
        for frames in (
            json_of(f"reconstruct {tmp_path / 'moving.npz'}", *more)["frames"]
            for more in ((), ("--threads", "2"))
        )
    )
    assert [touch["id"] for touch in stream] == [1] * 8
    assert [touch["confirmed"] for touch in stream] == [False] + [True] * 7
    assert [touch["x_mm"] for touch in stream] == [touch["x_mm"] for touch in alone]


def test_frames_with_times_are_a_stream(json_of, tmp_path):
    frames = session().as_frames()
    timed, alone = tmp_path / "timed.npz", tmp_path / "alone.npz"
    save_frames(timed, replace(frames, time_s=np.arange(frames.n_frames) / 48))
    save_frames(alone, frames)

    def touches(path: Path, *more: str) -> list[list[dict[str, float]]]:
        facts = json_of(f"reconstruct {path}", *more)
        return [frame["touches"] for frame in facts["frames"]]

    assert touches(timed) != touches(alone) == touches(timed, "--threads", "2")


@pytest.mark.parametrize(("untouched", "said"), [(1, "1 untouched frame: "), (4, None)])
def test_few_untouched_frames_do_not_show_the_noise(untouched, said, frames_file, tmp_path, capsys):
    frames = load_frames(frames_file)
    few = replace(frames, reference_voltage_v=frames.reference_voltage_v[:untouched])
    save_frames(tmp_path / "few.npz", few)
    assert main(["reconstruct", str(tmp_path / "few.npz"), "--only", "test-s3-0"]) == 0
    shown = capsys.readouterr().err
    assert ("the noise is unknown" in shown) == (said is not None)
    assert said is None or said in shown
