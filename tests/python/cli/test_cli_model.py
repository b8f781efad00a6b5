"""``eitskin model``: from a description to a model, what is in it, and that it verifies."""

import argparse
import json
import os
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import eitskin
from eitskin.cli import cmd_model
from eitskin.errors import FileError, UsageError
from eitskin.frames.frames import Frames, save_frames
from eitskin.model.eitm import load_model
from eitskin.model.model import Defaults
from eitskin.skin.protocol import Protocol, adjacent, table
from eitskin.skin.skin import load_skin
from fresh_python import MAIN, run_command, run_python, without, words
from small_models import prebuilt

SKIN = """
[skin]
name = "palm"
{outline}
thickness_mm = 6.0
conductivity_s_per_m = 0.02

[electrodes]
count = {count}
width_mm = 3.0

[protocol]
kind = "{kind}"
"""
OUTLINES = {
    "disk": "diameter_mm = 120.0",
    "L": "polygon_mm = [[0, 0], [100, 0], [100, 40], [40, 40], [40, 100], [0, 100]]",
    "clockwise L": "polygon_mm = [[0, 100], [40, 100], [40, 40], [100, 40], [100, 0], [0, 0]]",
}
FACTS = (
    "model", "bytes", "made_by", "skin", "electrodes", "pattern", "protocol_rows", "protocol_hash",
    "folded_rows", "independent_rows", "rank", "pixels",
    "pixel_mm", "storage", "data", "lipschitz", "mesh_elements", "calibration", "model_errors",
    "defaults",
)  # fmt: skip
QUICK = ("--elements", "900", "--pixels", "14", "--samples", "0")


def write_skin(
    folder: Path, outline: str = "disk", count: int = 16, kind: str = "adjacent"
) -> Path:
    path = folder / "skin.toml"
    path.write_text(SKIN.format(outline=OUTLINES[outline], count=count, kind=kind))
    return path


@pytest.mark.parametrize(
    ("outline", "count", "kind", "options", "expected"),
    [
        ("disk", 16, "adjacent", "",
         {"protocol_rows": 208, "folded_rows": 104, "rank": 64, "storage": "f32"}),
        ("disk", 32, "adjacent", "--storage i8",
         {"protocol_rows": 928, "folded_rows": 464, "rank": 128, "storage": "i8"}),
        ("L", 16, "opposite", "--rank 20 --storage f16",
         {"protocol_rows": 192, "rank": 20, "storage": "f16"}),
        ("clockwise L", 8, "adjacent", "--data log-ratio --samples 3",
         {"protocol_rows": 40, "rank": 20, "data": "log-ratio"}),
    ],
)  # fmt: skip
def test_build_info_verify(
    outline,
    count,
    kind,
    options,
    expected,
    json_of,
    tmp_path,
):
    skin, model = write_skin(tmp_path, outline, count, kind), tmp_path / "palm.eitm"
    built = json_of(f"model build {skin} -o {model}", *QUICK, options)
    assert tuple(built) == FACTS
    assert json_of(f"model info {model}") == built
    assert built == built | expected
    assert built["bytes"] == model.stat().st_size and built["skin"] == "palm"
    assert built["electrodes"] == count
    assert built["protocol_hash"] == f"{load_skin(skin)[1].hash:016x}"
    assert set(built["defaults"]) == set(asdict(Defaults()))
    assert load_model(model)[0].skin == load_skin(skin)[0]
    verified = json_of(f"model verify {model}")
    differences = verified["difference_to_golden_over_peak"]
    assert verified["ok"] is True and verified["model"] == str(model)
    assert differences["C float32"] == differences["C float32, portable"] == 0
    by_numpy = verified["difference_to_numpy_over_peak"]
    assert 0 < differences["C float64"] < 1e-4 and 0 < by_numpy["C float32"] < 1e-4
    assert by_numpy["C float64"] < 1e-9
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["palm.eitm", "skin.toml"]


def test_touch_change_and_regularisation_reach_the_model(json_of, tmp_path):
    skin, path = write_skin(tmp_path), tmp_path / "x.eitm"
    facts = json_of(f"model build {skin} -o {path} --touch-change 2 --regularisation 0.1", *QUICK)
    assert facts["defaults"]["touch_change_s_per_m"] == 0.04
    assert facts["lipschitz"] == pytest.approx(1 / 1.1, rel=2e-4)


def test_the_prebuilt_model_for_people(done, json_of):
    text = done("model info")
    assert "protocol hash    73aa164087184d25" in text and "rank             64" in text
    assert "defaults         iterations 60" in text
    text = done("model verify")
    assert text.count("the same bits") == 2 and "to the image by numpy" in text
    facts = json_of("model info")
    assert facts["bytes"] == len(prebuilt()[1]) and facts["pixels"] == 812


def test_verifies_as_installed_without_extras_or_a_checkout():
    bare = without("scipy", "netgen", "eitskin_emulator", "eitskin_studies") + MAIN
    verified = run_python(bare, "model", "verify")
    assert verified.returncode == 0 and verified.stdout.count("the same bits") == 2
    assert "to the image by numpy" in verified.stdout and verified.stderr == ""


def test_building_twice_gives_the_same_bytes(done, tmp_path):
    skin, files = write_skin(tmp_path), [tmp_path / "a.eitm", tmp_path / "b.eitm"]
    for file in files:
        done(f"model build {skin} -o {file}", *QUICK)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_in_a_process_of_its_own(done, tmp_path):
    """The module as users run it: exit codes, streams, and output in pipes."""

    def ended(*arguments: str) -> tuple[int, str, str]:
        command = [sys.executable, "-m", "eitskin.cli.main", *words(*arguments)]
        process = run_command(command, cwd=tmp_path)
        return process.returncode, process.stdout, process.stderr

    skin, palm = write_skin(tmp_path), tmp_path / "palm.eitm"
    done(f"model build {skin} -o {palm}", *QUICK)
    code, out, err = ended("model info palm.eitm --json")
    assert (code, err) == (0, "") and json.loads(out)["model"] == "palm.eitm"
    skin.write_text(skin.read_text().replace("thickness_mm", "thicknes_mm"))
    said = "skin.toml [skin]: unknown key 'thicknes_mm'; did you mean 'thickness_mm'?"
    assert ended("model build skin.toml -o other.eitm") == (4, "", f"eitskin: {said}\n")
    palm.write_bytes(palm.read_bytes()[:-16])
    code, _, err = ended("model verify palm.eitm")
    assert code == 6 and err.startswith("eitskin: palm.eitm: the model is truncated")
    code, _, err = ended("model verfy")
    assert code == 2 and err.count("\n") == 1
    code, _, err = ended("--traceback model info none.eitm")
    assert code == 1 and "FileError: none.eitm: no such model" in err


def test_a_pipe_that_closes_early_leaves_no_traceback():
    environment = {**os.environ, "PYTHONPATH": str(Path(eitskin.__file__).parents[1])}
    with subprocess.Popen(
        [sys.executable, "-u", "-m", "eitskin.cli.main", "model", "info", "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment,
    ) as process:  # fmt: skip
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert b"Traceback" not in process.stderr.read()


def test_start_up_imports_little():
    """Help needs no numpy; info needs neither scipy nor matplotlib."""
    code = (
        "import sys\nfrom eitskin.cli.main import main\nmain(sys.argv[1:])\nprint([name for name in"
        " ('scipy', 'matplotlib', 'netgen', 'sklearn') if name in sys.modules], file=sys.stderr)"
    )
    done = run_python(code, "model", "info")
    assert (done.returncode, done.stderr) == (0, "[]\n")


def test_pixels_too_coarse_for_a_narrow_skin_are_told(ran, tmp_path):
    skin, strip = tmp_path / "skin.toml", "polygon_mm = [[0, 0], [240, 0], [240, 20], [0, 20]]"
    skin.write_text(SKIN.format(outline=strip, count=16, kind="adjacent"))
    build = f"model build {skin} -o {tmp_path / 'strip.eitm'} --elements 900 --samples 0"
    _, err = ran(0, build, "--pixels 16")
    assert re.search(r"a pixel of [0-9.]+ mm is too coarse for a skin about 18\.5 mm wide", err)
    assert "build it with  --pixels N" in err
    assert "too coarse" not in ran(0, build)[1]


def frames_of_some_rows(path: Path, count: int = 16) -> Protocol:
    """Write frames of every row of adjacent but each third; return their protocol."""
    rows = adjacent(count).drive_measure
    protocol = table(count, rows[np.arange(len(rows)) % 3 != 2], 2e-3)
    untouched_v = np.full((2, protocol.n_rows), -0.01)
    save_frames(path, Frames(protocol, untouched_v, untouched_v, ("one", "two")))
    return protocol


def build(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser()
    cmd_model.add_options(parser)
    options = parser.parse_args(["build", *arguments])
    options.run(options)


def test_build_measures_the_rows_of_frames(tmp_path):
    protocol = frames_of_some_rows(tmp_path / "frames.npz")
    skin, model = write_skin(tmp_path), tmp_path / "own.eitm"
    build([str(skin), "--rows-of", str(tmp_path / "frames.npz"), *QUICK, "-o", str(model)])
    built, _ = load_model(model)
    assert built.protocol.hash == protocol.hash
    assert built.protocol.current_a == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{skin}", "--rows-of", "{frames}", "--drive", "adjacent"], "give one of them"),
        (["{skin}", "--rows-of", "{other}"], "frames of 8 electrodes, but the skin has 16"),
        (["{skin}", "--rows-of", "{nowhere}"], "no such frames file"),
        (["{frames}"], "add  --rows-of {frames}"),
    ],
)
def test_rows_that_cannot_be_measured_are_refused(arguments, said, tmp_path):
    paths = {name: tmp_path / f"{name}.npz" for name in ("frames", "other", "nowhere")}
    frames_of_some_rows(paths["frames"])
    frames_of_some_rows(paths["other"], 8)
    named = {"skin": write_skin(tmp_path)} | paths
    filled = [text.format(**named) for text in arguments]
    with pytest.raises(UsageError if "such" not in said else FileError) as caught:
        build([*filled, "-o", str(tmp_path / "x.eitm")])
    assert said.format(**named) in str(caught.value)
    assert not (tmp_path / "x.eitm").exists()
