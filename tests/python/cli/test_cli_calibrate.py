"""``eitskin calibrate`` from a simulated bench to loads of presses that it never saw, on the host
and on a simulated board."""

from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
from board_cases import board_of

from eitskin.core.results import NEWTONS_PER_GRAM
from eitskin.device.client import Device
from eitskin.device.known_model import board_options
from eitskin.device.recordings.recording import Recorder
from eitskin.device.simulated import SimTransport
from eitskin.device.wire.link_table import Stream
from eitskin.model.eitm import decode_model, load_model
from eitskin.session.assemble import read_frames
from eitskin.session.checks.host_check import check_recording
from eitskin.session.frame import Frame
from eitskin.session.set_up import take_reference
from fresh_python import words
from small_models import prebuilt

GRAMS = (50, 80, 100, 150, 200)
RINGS = [(0, 0), (35, 20), (35, 140), (35, 260), *((72, 60.0 * k + 10) for k in range(6))]
PLACES = [(r * cos(radians(a)), r * sin(radians(a))) for r, a in RINGS]
SOME = 0.08  # 95 % of the loads that the fit had not seen are within 5 %
NEW = [((-20.0, 25.0), 65), ((50.0, -30.0), 120), ((-45.0, -45.0), 180), ((5.0, 62.0), 90)]


HELD = 6  # frames of each press on a board, which follows it through the scans


def bench(
    name: str, presses: list[tuple[tuple[float, float], int]], held: int = 1
) -> tuple[str, str]:
    """A scene of ``held`` frames a press by a flat end of 8 mm, and the list of its weights."""
    scene = [
        "[scene]",
        f'name = "{name}"',
        f"frames = {held * len(presses)}",
        "[effects.noise]",
        "snr_db = 72.0",
    ]
    weights = ["first,weight_g"]
    for k, ((x, y), grams) in enumerate(presses):
        scene += ["[[touch]]", f"x_mm = {x:.3f}", f"y_mm = {y:.3f}", "radius_mm = 8.0"]
        scene += ['law = "piezoresistive"', f"grams = {grams}"]
        scene += [f"from_s = {held * k / 20}", f"to_s = {(held * (k + 1) - 0.5) / 20}"]
        weights.append(f"{held * k},{grams}")
    return "\n".join(scene), "\n".join(weights)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Frames and weights of the bench and of presses that it does not have, and the model
    calibrated on the first."""
    from eitskin.cli.main import main

    path = tmp_path_factory.mktemp("bench")
    for name, presses in (
        ("weights", [(place, grams) for place in PLACES for grams in GRAMS]),
        ("new", NEW),
    ):
        scene, weights = bench(name, presses)
        (path / f"{name}.toml").write_text(scene)
        (path / f"{name}.csv").write_text(weights)
        assert not main(words("scene run", path / f"{name}.toml", "-o", path / f"{name}.npz"))
    frames, listed, out = (str(path / name) for name in ("weights.npz", "weights.csv", "skin.eitm"))
    assert main(["calibrate", frames, "--weights", listed, "-o", out]) == 0
    return path


def test_presses_that_it_never_saw_read_their_load(folder, done, json_of):
    said = json_of(f"reconstruct {folder / 'new.npz'} --model {folder / 'skin.eitm'}")
    for frame, (place, grams) in zip(said["frames"], NEW, strict=True):
        (touch,) = frame["touches"]
        assert np.hypot(touch["x_mm"] - place[0], touch["y_mm"] - place[1]) < 1
        assert touch["force_n"] / NEWTONS_PER_GRAM == pytest.approx(grams, rel=SOME)
    text = done(f"reconstruct {folder / 'new.npz'} --model {folder / 'skin.eitm'}")
    assert "force N" in text.splitlines()[0]
    assert "force N" not in done(f"reconstruct {folder / 'new.npz'}").splitlines()[0]


def test_it_says_what_it_found(folder, done, json_of):
    arguments = ("calibrate", folder / "weights.npz", "--weights", folder / "weights.csv")
    facts = json_of(*arguments)
    model = load_model(folder / "skin.eitm")[0]
    assert (facts["presses"], facts["places"], facts["left_out"]) == (50, 10, [])
    assert model.meta["calibration"] == {key: facts[key] for key in model.meta["calibration"]}
    assert facts["error_rms"] < 0.03 and facts["scatter_after"] < 0.03
    lines = done(*arguments).splitlines()
    assert lines[0] == "50 presses at 10 places, up to 1.96 N"
    assert lines[-1] == "not stored; name a model with -o"
    info = done(f"model info {folder / 'skin.eitm'}")
    assert "up to 1.96 N, 95 % within" in info
    assert "none; touches have no force" in done("model info")
    done(f"model verify {folder / 'skin.eitm'}")


def recorded(folder: Path, blob: bytes, path: Path) -> list[Frame]:
    """The new presses on a simulated board with this model, recorded to ``path``; returns the last
    frame of each."""
    held = folder / "held.toml"
    held.write_text(bench("held", NEW, HELD)[0])
    board = board_of(held, blob)
    with Device(SimTransport("test", board)) as device:
        options = board_options(decode_model(blob, "made"), device.board)
        device.solver(options)
        with Recorder(path, device, options):
            take_reference(device, 16, streamed=True)
            device.start_scene()
            items = list(read_frames(device, Stream.RAW | Stream.IMAGE | Stream.TOUCHES))
    frames = [item for item in items if isinstance(item, Frame)]
    return frames[HELD - 1 :: HELD]


def test_a_board_with_that_model_sends_the_same_load_bits(folder, tmp_path):
    live = recorded(folder, (folder / "skin.eitm").read_bytes(), tmp_path / "run.eits")
    json_of = [
        t.force_n / NEWTONS_PER_GRAM
        for frame in live
        if frame.touches is not None
        for t in frame.touches
    ]
    assert json_of == pytest.approx([grams for _, grams in NEW], rel=SOME)
    check, _ = check_recording(tmp_path / "run.eits", folder / "skin.eitm")
    assert (check.touches, check.different) == (HELD * len(NEW), [])


def test_a_recorded_run_calibrates_too(folder, tmp_path, json_of):
    path, listed = tmp_path / "run.eits", tmp_path / "run.toml"
    live = recorded(folder, prebuilt()[1], path)
    tables = [
        f"[[press]]\nfirst = {frame.number}\nweight_g = {grams}\nx_mm = {x_mm}\ny_mm = {y_mm}"
        for frame, ((x_mm, y_mm), grams) in zip(live, NEW, strict=True)
    ]
    listed.write_text("\n".join(tables))
    facts = json_of(f"calibrate {path} --weights {listed}")
    assert (facts["presses"], facts["places"], facts["gain_order"]) == (4, 4, 0)
    assert "4 places: the gain is taken to be the same everywhere" in facts["notes"][0]
    both = f"{path} {folder / 'weights.npz'}"
    lists = f"--weights {listed} --weights {folder / 'weights.csv'}"
    assert json_of("calibrate", both, lists)["presses"] == 54


def test_weights_that_do_not_show_are_named(folder, tmp_path, ran):
    _, *rows, last = (folder / "weights.csv").read_text().splitlines()
    # that one stands near the rim
    elsewhere = ["first,weight_g,x_mm,y_mm", *(f"{row},," for row in rows), f"{last},0,0"]
    (tmp_path / "w.csv").write_text("\n".join(elsewhere))
    said = ran(0, f"calibrate {folder / 'weights.npz'} --weights {tmp_path / 'w.csv'}")[1]
    assert "weights.npz: frames 49 to 49: 0 of 1 show the weight; left out" in said


def test_refusals(folder, refused, tmp_path):
    frames, listed, own = folder / "weights.npz", folder / "weights.csv", tmp_path / "w.csv"
    outside = (
        "frames 50 to 50 of the list of weights do not exist; the recording has frames 0 to 49"
    )
    for code, arguments, rows, said in (
        (2, f"{frames} --weights {listed} --weights {listed}", "",
         "1 recordings and 2 lists of weights"),
        (8, f"{frames} --weights {own}", "50,10", outside),
        (8, f"{frames} --weights {own}", "0,10\n1,20", "2 presses are too few"),
        (3, f"{tmp_path / 'none.npz'} --weights {listed}", "", "no such frames file"),
        (2, f"{frames} --weights {listed} --seed -1", "", "--seed -1 must be 0 or above"),
    ):  # fmt: skip
        own.write_text(f"first,weight_g\n{rows}\n")
        assert said in refused(code, "calibrate", arguments)
