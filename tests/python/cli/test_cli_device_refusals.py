"""Refusals of the commands for boards: each has the documented exit code and one line that says
what to do, without a traceback, and leaves no file. tests/python/docs/mistakes.md has the most
frequent mistakes, which are not repeated here."""

import re
from pathlib import Path

import pytest
from board_cases import board_of, write_scene

from board_on_a_port import behind_a_port
from eitskin.device.wire.codec import encode
from fresh_python import MAIN, run_python, without, words
from small_models import small_blob

USAGE, FILE, FRAME, EXTRA, DEVICE = 2, 3, 8, 9, 12


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    return write_scene(tmp_path_factory.mktemp("scene") / "one.toml", 3)


# ---- arguments, before any device is opened ----


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("stream --mode raw,voltages", "--mode raw,voltages: "),
        ('stream --mode ""', "--mode : "),
        ("stream --every 0", "--every 0 is out of range; use 1 to 65535"),
        ("stream --frames 0", "--frames 0 is out of range"),
        ("stream --frames many", "invalid int value: 'many'"),
        ("stream --tare 3", "a tare of 3 frames cannot be; use 1, or 4 to 1024"),
        ("stream --iterations 0", "--iterations 0 is out of range"),
        ("stream --gap 2", "--gap 2 is out of range"),
        ("stream --gap nan", "--gap nan is out of range"),
        ("stream --warm --cold", "not allowed with argument"),
        ("stream --full --reciprocal 4", "not allowed with argument"),
        ("stream --reciprocal 1", "--reciprocal 1 would check every frame"),
        ("stream --excitation-hz nan", "--excitation-hz nan is out of range"),
        ("stream --excitation-hz 1e6", "--excitation-hz 1e+06 is out of range"),
        ("stream --samples 5000", "--samples 5000 is out of range"),
        ("stream --settle-us -1", "--settle-us -1 is out of range"),
        ("stream --mode raw --picture x.png", "--picture and --film draw images and touches"),
        ("stream --device usb0", "as in auto, serial:/dev/ttyACM0, sim:two_touch"),
        ("stream --device sim:", "something must follow the colon"),
        ("stream --device auto:x", "device 'auto:x': nothing follows  auto"),
        ('stream --device ""', "device ''"),
        ("stream --device seral:/dev/ttyACM0", "serial"),
        ("stream --device serial", "serial:/dev/ttyACM0"),
        ("stream --device serial:", "something must follow the colon"),
        ("stream --device serial:/dev/x?baud=fast", "must be baud=N"),
        ("stream --device serial:/dev/x?baud=0", "baud=N"),
        ("stream --device serial:/dev/x?speed=9600", "baud=N"),
        ("stream --device serial:/dev/x?baud=99999999", "baud=N"),
        ("stream --device serial:?baud=9600", "baud=N"),
        ("record -o x.eits --seconds 0", "--seconds 0 is out of range"),
        ("record -o x.eits --seconds nan", "--seconds nan is out of range"),
        ("replay", "required: RUN.eits"),
        ("replay x.eits --first 0", "--first 0 is out of range"),
        ("replay x.eits --check --mode raw", "leave out one kind"),
        ("flash --tool dfu", "--tool: 'dfu' is unknown; known are: openocd, pyocd, st-flash"),
        ("flash --json", "--json needs --dry-run"),
        ("doctor x.npz --device auto", "name frames to examine, or a board"),
        ("doctor --device sim:two_touch --frames 2", "--frames 2 is out of range; use 4 to 1024"),
        ("model upload", "required: MODEL.eitm"),
    ],
)
def test_arguments(refused, arguments, text):
    assert text in refused(USAGE, arguments)


# ---- files ----


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("stream --device sim:nowhere.toml", "no such scene"),
        ("stream --device emu:two_tuch", "did you mean 'two_touch'"),
        ("stream --device file:none.eits", "no such recording"),
        ("stream --device sim:two_touch --picture no/such/folder/x.png", "make it first"),
        ("stream --device sim:two_touch --record no/such/folder/x.eits", "make it first"),
        ("record --device sim:two_touch -o no/such/folder/x.eits", "make it first"),
        ("stream --device sim:two_touch --model none.eitm", "no such model"),
        ("model upload none.eitm --device sim:two_touch", "no such model"),
        ("replay none.eits --frames no/such/folder/x.npz", "make it first"),
        ("flash --image none.bin", "no such firmware image"),
    ],
)
def test_files(refused, arguments, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert text in refused(FILE, arguments)


@pytest.mark.parametrize("command", ["replay", "replay --check", "replay --frames x.npz", "stream"])
def test_what_is_no_recording(command, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "run.eits"
    path.write_bytes(encode(0x70, 0, b"not JSON"))
    line = refused(FILE, command, f"--device file:{path}" if command == "stream" else path)
    assert str(path) in line and "no eitskin recording" in line


def test_a_recording_is_not_written_over(refused, scene, tmp_path):
    path = tmp_path / "run.eits"
    path.write_bytes(b"precious")
    for command in (["record", "-o"], ["stream", "--record"]):
        assert "exists already" in refused(FILE, *command, f"{path} --device sim:{scene}")
    assert path.read_bytes() == b"precious"


def test_a_recording_takes_no_settings(refused, ran, scene, tmp_path):
    path = tmp_path / "run.eits"
    ran(0, f"record --device sim:{scene} -o {path} --frames 1")
    for options in (["--samples", "40"], ["--iterations", "3"], ["--tare", "4"], ["--cold"]):
        assert "is a recording" in refused(USAGE, f"stream --device file:{path}", *options)
    assert "is a recording already" in refused(
        USAGE, f"record --device file:{path} -o {tmp_path / 'again.eits'}"
    )
    for command in (["tare"], ["model", "upload", write_model(tmp_path)]):
        assert "is a recording" in refused(DEVICE, *command, f"--device file:{path}")


def write_model(folder: Path) -> Path:
    path = folder / "small.eitm"
    path.write_bytes(small_blob())
    return path


def test_settings_of_a_recorded_board_are_shown(refused, scene, tmp_path, ran):
    path = tmp_path / "run.eits"
    ran(0, f"record --device sim:{scene} --frames 1 -o {path}")
    assert "settings  none" in ran(0, f"board --device file:{path}")[0]
    assert "is a recording" in refused(DEVICE, f"board --lock --device file:{path}")


def test_a_recording_without_raw_frames(refused, ran, scene, tmp_path):
    path = tmp_path / "run.eits"
    ran(0, f"record --device sim:{scene} -o {path} --mode touches")
    assert "nothing to compare" in refused(FRAME, f"replay {path} --check")
    assert "no raw frames" in refused(FRAME, f"replay {path} --frames {tmp_path / 'x.npz'}")


# ---- ports ----


def test_a_board_without_a_model(scene, ran):
    with behind_a_port(board_of(scene, b"")) as port:
        device = f"serial:{port}"
        assert "none; upload one with  eitskin model upload" in ran(0, f"info --device {device}")[0]
        for command in ("stream", "stream --mode image", "tare", "doctor"):
            line = ran(DEVICE, command, f"--device {device}")[1].splitlines()[-1]
            assert line.startswith(f"eitskin: {port}: ") and "eitskin model upload" in line, line


def test_a_model_that_is_not_the_boards(scene, tmp_path, ran):
    model = write_model(tmp_path)
    with behind_a_port(board_of(scene)) as port:
        line = ran(DEVICE, f"stream --device serial:{port} --model {model} --mode image")[1]
        assert "checksum" in line and "eitskin model upload" in line and line.count("\n") == 1
    with behind_a_port(board_of(scene, small_blob())) as port:
        assert "--model FILE" in ran(DEVICE, f"stream --device serial:{port} --mode image")[1]
        assert (
            "changing the solver needs the defaults"
            in ran(DEVICE, f"stream --device serial:{port} --iterations 5")[1]
        )


def test_what_the_board_refuses(refused, scene):
    device = ["--device", f"sim:{scene}"]
    assert "the nearest that are: 80" in refused(DEVICE, "stream", *device, "--samples 79")
    assert "frame period of at least 20800 us" in refused(
        DEVICE, "stream", *device, "--frame-period-us 10000"
    )


# ---- extras ----


@pytest.mark.parametrize("missing", ["eitskin_emulator", "unicorn"])
def test_without_the_emulated_board(missing, scene):
    done = run_python(without(missing) + MAIN, "stream", "--device", f"emu:{scene}")
    assert done.returncode == EXTRA
    assert re.search(r"run .* pip install \S*/firmware/emulator\n", done.stderr)
    assert done.stderr.count("\n") == 1


def test_pictures_without_matplotlib(scene, tmp_path):
    command = words(f"stream --device sim:{scene} --mode image --picture {tmp_path / 'x.png'}")
    done = run_python(without("matplotlib") + MAIN, *command)
    assert done.returncode == EXTRA and "eitskin[plot]" in done.stderr
    assert not (tmp_path / "x.png").exists()
