"""Test ``eitskin recommend``, and ``--preset`` on frames and boards."""

import json
from pathlib import Path

import pytest
from board_cases import write_scene

import eitskin
from eitskin.errors import UsageError
from eitskin.model.eitm import load_model
from eitskin.tuning.front import PRESETS, Conditions, load_front
from small_models import prebuilt


@pytest.fixture
def scene(tmp_path) -> Path:
    return write_scene(tmp_path / "one.toml", frames=2, elements=900)


def test_the_recommended_model_has_the_points_settings(json_of, tmp_path, monkeypatch):
    """The model errors of 300 random skins are left out of the comparison."""
    monkeypatch.setattr("eitskin.model.build.with_model_errors", lambda model, *_, **__: model)
    path = tmp_path / "model.eitm"
    facts = json_of(f"recommend --budget 5ms -o {path}")
    assert facts["solve_us"] <= 5000 < facts["frame_us"] == facts["acquisition_us"] == 20_800
    assert facts["options"] == ["--samples 80", "--full"]
    model, _ = load_model(path)
    one = next(p for p in load_front().points if p.name == facts["name"])
    settings = one.configuration
    found = model.rank, model.stored.storage, model.grid.n_pixels
    assert found == (settings.rank, settings.storage, one.costs["pixels_kept"])
    found = model.defaults.iterations, model.defaults.solver
    assert found == (settings.iterations, settings.solver)
    assert model.defaults.mask_threshold == pytest.approx(one.threshold)


def test_recommendations_name_what_limits_the_rate(done, json_of):
    slow = done("recommend --accuracy 0.87 --board f767")
    assert "an estimate" in slow and "frames per second" in slow
    assert "measuring limits the rate" in done("recommend --budget 2ms")
    assert "host: solve and touches take" in done("recommend --budget 1ms --board host")
    facts = json_of("recommend --budget 12ms --period 13ms")
    assert facts["acquisition_us"] <= 13_000 and facts["configuration"]["scan"] == "reciprocal"
    discs = json_of("recommend --budget 10ms --by discs")
    assert discs["judged"].startswith("discs") and discs["accuracy"] > 0.9


@pytest.mark.parametrize("board", ["f767", "host"])
def test_presets_are_dearer_and_better_from_fast_to_accurate(json_of, board):
    chosen = [json_of(f"recommend --preset {name} --board {board} --snr-db 60") for name in PRESETS]
    assert [one["accuracy"] for one in chosen] == sorted(one["accuracy"] for one in chosen)
    assert chosen[0]["report_us"] < 0.6 * chosen[2]["report_us"]
    assert chosen[0]["accuracy"] >= 0.84


@pytest.mark.parametrize(
    ("code", "arguments", "said"),
    [
        (2, "recommend", "--budget 10ms"),
        (2, "recommend --budget ten", "--budget ten"),
        (2, "recommend --budget 1us", "the cheapest"),
        (2, "recommend --accuracy 0.99", "the best"),
        (2, "recommend --budget 9ms --skin a.toml", "-o MODEL.eitm"),
        (2, "recommend --budget 9ms --scenes quads", "quads"),
        (2, "recommend --budget 9ms --period 9kMACs", "--period"),
        (3, "recommend --budget 9ms --front nowhere.json", "nowhere.json"),
        (3, "recommend --budget 9ms -o nowhere/model.eitm", "does not exist"),
    ],
)
def test_refusals(refused, code, arguments, said):
    assert said in refused(code, arguments)


def test_reconstruct_with_a_preset(json_of, frames_file, ran):
    usual = json_of(f"reconstruct {frames_file}")
    out, err = ran(0, f"reconstruct {frames_file} --preset accurate --json")
    fine = json.loads(out)
    assert "settings of" in err and fine["settings"]["rank"] == prebuilt()[0].rank
    point = next(one for one in load_front().points if one.name == fine["settings"]["name"])
    assert "measured at 60 dB" in err  # by the tare
    assert (point.accuracy(Conditions()) or 0) >= 0.87
    most = max(frame["info"]["iterations"] for frame in fine["frames"])
    solves = 2 if point.configuration.second_pass else 1
    assert most == solves * fine["settings"]["iterations"]
    # a preset chooses the solver's settings; the image drawn of touches hardly depends on them
    assert fine["summary"]["miou_solver"] > usual["summary"]["miou_solver"]
    assert fine["summary"]["miou_image"] > usual["summary"]["miou_image"] - 0.01
    for info in (frame["info"] for frame in fine["frames"] + usual["frames"]):
        assert info["solve_us"] > 0 and info["touch_us"] >= 0
    quick = json.loads(ran(0, f"reconstruct {frames_file} --preset fast --json")[0])
    names = quick["settings"]["name"], "standard"  # which has the default settings
    fast, default = (next(one for one in load_front().points if one.name == n) for n in names)
    costs_us = [one.cost("us", "host", Conditions(), worst=False) for one in (fast, default)]
    assert (costs_us[0] or 0) <= (costs_us[1] or 0)  # as they were measured


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("--preset fast --iterations 5", "--iterations is chosen by --preset"),
        ("--preset fast --gap 0.1", "--gap"),
        ("--preset fast --solver fista", "--solver"),
        ("--preset fast --engine numpy", "--preset needs the C core"),
        ("--preset quick", "'quick' is unknown; known are: accurate, balanced, fast"),
        ("--budget 5ms", "use --preset"),
        ("--accuracy 0.8", "use --preset"),
    ],
)
def test_reconstruct_refuses(refused, frames_file, arguments, said):
    assert said in refused(2, f"reconstruct {frames_file}", arguments)


def test_a_model_that_nothing_was_measured_with(refused, done, frames_file, tmp_path):
    path = tmp_path / "odd.eitm"
    done(f"model build --paper --rank 33 --pixels 12 --samples 0 -o {path}")
    assert "eitskin recommend" in refused(
        2, f"reconstruct {frames_file} --model {path} --preset fast"
    )


def test_boards_receive_the_settings(tmp_path, ran):
    scene = write_scene(tmp_path / "one.toml", elements=900)
    out, err = ran(0, f"stream --device sim:{scene} --preset balanced --json")
    assert "on the F767 (an estimate)" in err and "at most 60 iterations" in err
    infos = [json.loads(line)["info"] for line in out.splitlines()[:-1]]
    solved = [info for info in infos if info is not None]
    assert len(infos) == 6 and len(solved) >= 4  # not the first one, in which the touch lands
    for info in solved:
        assert info["stop"] == "iterations" and info["iterations"] == 60
    line = ran(0, f"stream --device sim:{scene} --preset fast -v")[0].splitlines()[0]
    assert "iterations (limit), gap" in line and "MMAC" in line


def test_a_preset_sets_the_boards_scan_too(scene, tmp_path, ran):
    run = tmp_path / "run.eits"
    said = ran(0, f"record --device sim:{scene} -o {run} --preset fast")[1]
    assert "20 samples, reciprocal scan; measured" in said
    board = json.loads(ran(0, f"info --device file:{run} --json")[0])["board"]
    assert (board["samples"], board["check_every"]) == (20, 0)


def test_python_takes_a_preset(scene, tmp_path):
    run = tmp_path / "run.eits"
    assert len(list(eitskin.stream(f"sim:{scene}", preset="fast", record=run))) == 2
    with eitskin.open_device(f"file:{run}") as device:
        assert (device.board.samples, device.board.check_every) == (20, 0)
    skin = eitskin.Reconstructor(eitskin.load_model())
    skin.set_options(**eitskin.preset("accurate", snr_db=60.0))
    assert skin.options.lambda_rel < eitskin.load_model().defaults.lambda_rel
    for wrong in ({"preset": "quick"}, {"preset": "fast", "iterations": 5}):
        with pytest.raises(UsageError, match="preset"):
            next(eitskin.stream(f"sim:{scene}", **wrong))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [("--preset fast --iterations 9", "--iterations"), ("--budget 5ms", "use --preset")],
)
def test_boards_refuse(refused, scene, arguments, said):
    assert said in refused(2, f"stream --device sim:{scene} {arguments}")


def test_a_recording_takes_no_preset_but_keeps_its_settings(refused, scene, tmp_path, ran):
    run = tmp_path / "run.eits"
    ran(0, f"record --device sim:{scene} -o {run} --preset balanced")
    ran(0, f"replay {run} --check")
    first = json.loads(ran(0, f"replay {run} --json")[0].splitlines()[-2])
    assert first["info"]["iterations"] == 60
    assert "recording" in refused(2, f"stream --device file:{run} --preset fast")
