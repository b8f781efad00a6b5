"""The commands: what the doctor advises, import takes, and then the doctor is content."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from injected import (
    as_if_electrodes,
    dead,
    healthy_frames,
    pair_off,
    reversed_sign,
    rotating,
    rows_off,
    times,
    untouched_only,
    wired,
)

from eitskin.cli import cmd_doctor, cmd_import
from eitskin.errors import EitskinError, UsageError
from eitskin.frames.frames import Frames, load_frames, save_frames
from eitskin.frames.orders import electrode_map, match_rows, source_table
from eitskin.skin.protocol import opposite

NPZ = ("--voltage", "v", "--reference", "r", "--scale", "1")
ADJACENT = ("--protocol", "adjacent", "--electrodes", "16")
SKIN = """
[skin]
name = "paper"
diameter_mm = 194.0
[electrodes]
count = 16
[protocol]
kind = "adjacent"
"""


def run(*words: object) -> int:
    parser = argparse.ArgumentParser()
    subparsers = parser.add_subparsers(required=True)
    for name, command in {"import": cmd_import, "doctor": cmd_doctor}.items():
        command.add_options(subparsers.add_parser(name))
    options = parser.parse_args([str(word) for word in words])
    return int(options.run(options))


def write(path: Path, frames: Frames) -> Path:
    np.savez(path, v=frames.voltage_v, r=frames.reference_voltage_v)
    return path


BOTH_WAYS = "--order rotating --swap 3,9 --swap 1,14"
FAULTS: dict[str, tuple[Callable[[], Frames], str]] = {
    "rotating": (lambda: rotating(healthy_frames(1)), "--order rotating"),
    "reversed": (lambda: reversed_sign(healthy_frames(2)), "--sign reversed"),
    "rotating and reversed": (
        lambda: reversed_sign(rotating(healthy_frames(3))), "--order rotating --sign reversed",
    ),
    "swapped": (lambda: wired(4, (2, 7)), "--swap 2,7"),
    "swapped twice, rotating": (lambda: rotating(wired(5, (3, 9), (1, 14))), BOTH_WAYS),
    "swapped twice, rotating, reversed": (
        lambda: reversed_sign(rotating(wired(10, (3, 9), (1, 14)))), f"{BOTH_WAYS} --sign reversed",
    ),
    "dead": (lambda: dead(healthy_frames(6), 11), "--drop-electrodes 11"),
    "two dead": (lambda: dead(healthy_frames(19), 2, 9), "--drop-electrodes 2,9"),
    "dead, rotating, reversed": (
        lambda: reversed_sign(rotating(dead(healthy_frames(7), 4))),
        "--order rotating --sign reversed --drop-electrodes 4",
    ),
    "one row": (
        lambda: rows_off(healthy_frames(8), [40], 1.5), "--impute-channels 40"
    ),
    "both of a pair": (
        lambda: rows_off(healthy_frames(9), [0, 26], 1.5), "--drop-channels 0,26"
    ),
    "flipped": (
        lambda: rows_off(healthy_frames(10), [17, 90], -1.0), "--flip-channels 17,90"
    ),
    "own gains": (
        lambda: times(healthy_frames(11), np.random.default_rng(11).uniform(0.8, 1.2, 208)),
        "--equalise",
    ),
    "one drive": (lambda: pair_off(healthy_frames(12), slice(0, 2), 0.7), "--equalise"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_the_advice_mends(tmp_path, capsys, fault):
    make, wanted = FAULTS[fault]
    path, repaired = write(tmp_path / "s.npz", make()), tmp_path / "repaired.npz"
    assert run("doctor", path, *NPZ, *ADJACENT, "--json") == 11
    advice = json.loads(capsys.readouterr().out)["repair"]
    assert advice == wanted
    assert run("import", path, "-o", repaired, *NPZ, *ADJACENT, *advice.split()) == 0
    assert run("doctor", repaired, "--json") == 0, capsys.readouterr().out


def test_numbering_is_advised_by_known_touches_and_mends(tmp_path, capsys):
    (tmp_path / "skin.toml").write_text(SKIN)
    turned = as_if_electrodes(healthy_frames(13), electrode_map(16, 5, True), seed=13)
    path = write(tmp_path / "s.npz", rows_off(turned, [40], 1.5))
    repaired, skin = tmp_path / "repaired.npz", tmp_path / "skin.toml"
    touch = ("--skin", skin, "--touch", "30,40,8", "--touch=-50,10,8", "--touch-in", "0")
    assert run("doctor", path, *NPZ, *touch, "--json") == 11
    report = json.loads(capsys.readouterr().out)
    assert report["repair"] == "--rotate 5 --mirror"
    assert any("renumber by import first" in text for text in report["untold"])
    assert run("import", path, "-o", repaired, *NPZ, *touch[:2], *report["repair"].split()) == 0
    capsys.readouterr()
    assert run("doctor", repaired, *touch, "--json") == 11
    again = json.loads(capsys.readouterr().out)
    assert [finding["name"] for finding in again["findings"]] == ["channel-gain"]
    assert run("import", repaired, "-o", tmp_path / "m2.npz", *again["repair"].split()) == 0
    assert run("doctor", tmp_path / "m2.npz", *touch) == 0


def test_import_says_what_it_wrote(tmp_path, capsys):
    path = write(tmp_path / "s.npz", healthy_frames(14))
    words = ("import", path, "-o", tmp_path / "o.npz", *NPZ, *ADJACENT)
    assert run(*words, "--current-a", "0.002", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["frames"], said["quiet_frames"]) == (1, 12)
    assert (said["channels"], said["unit"]) == (208, "V")
    frames = load_frames(tmp_path / "o.npz")
    assert frames.protocol.current_a == 2e-3
    assert said["protocol_hash"] == f"{frames.protocol.hash:016x}"
    assert frames.meta["source"] == "s.npz"
    assert run(*words) == 0
    assert "next: eitskin doctor" in capsys.readouterr().out


def test_the_doctor_examines_frames_files_and_prints_evidence(tmp_path, capsys):
    path = tmp_path / "f.npz"
    save_frames(path, rotating(untouched_only(healthy_frames(15))))
    assert run("doctor", path) == 11
    text = capsys.readouterr().out
    assert "FAULT order" in text
    assert "rotating 0.9" in text
    assert "repair: eitskin import ... --order rotating" in text
    save_frames(path, untouched_only(healthy_frames(15, opposite(16))))
    assert run("doctor", path) == 0
    assert "0 faults, 0 notes: nothing must be repaired" in capsys.readouterr().out


def test_sources_with_all_pairs_are_recognised_by_their_number(tmp_path, capsys):
    frames = untouched_only(healthy_frames(16))
    rows = source_table("rotating-all", frames.protocol)
    values = np.full((len(rows), 2), 0.5)
    measured = ~(rows[:, :2, None] == rows[:, None, 2:]).any(axis=(1, 2))
    index = match_rows(frames.protocol.drive_measure, rows[measured]).index
    values[measured] = np.column_stack([frames.reference_v, frames.voltage_v[0]])[index]
    np.savetxt(tmp_path / "all.csv", values, delimiter=",")
    words = (tmp_path / "all.csv", *ADJACENT, "--reference-columns", "0")
    assert run("doctor", *words, "--json") == 11
    report = json.loads(capsys.readouterr().out)
    assert [finding["name"] for finding in report["findings"]] == ["order"]
    assert report["repair"] == "--order rotating-all"


def test_the_picture_is_drawn(tmp_path):
    path = tmp_path / "f.npz"
    save_frames(path, dead(untouched_only(healthy_frames(17)), 3))
    assert run("doctor", path, "--picture", tmp_path / "p.png") == 11
    assert (tmp_path / "p.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    with pytest.raises(EitskinError, match=r"is not a format of a picture; use \.png"):
        run("doctor", path, "--picture", tmp_path / "p.xyz")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--protocol", "adjacent"), "needs --electrodes N or --skin FILE"),
        (("--protocol", "skip", "--electrodes", "16"), "--protocol skip needs --skip K"),
        (("--skip", "2"), "--skip goes with --protocol skip"),
        (("--skin", "SKIN", "--electrodes", "8"), "--electrodes 8: the skin .* has 16"),
        (("--skin", "SKIN", "--swap", "3"), "--swap 3: name two electrodes"),
        (("--skin", "SKIN", "--drop-channels", "3,x"), "'x' is not an integer or range a:b"),
        (("--skin", "SKIN", "--truth-mask", "v", "--truth-mask-extent", "1,2"),
         "XMIN,YMIN,XMAX,YMAX"),
        (("--skin", "SKIN", "--touch", "1"), "X,Y or X,Y,RADIUS"),
        (("--skin", "SKIN", "--touch", "500,0"), "outside the skin"),
        (("--skin", "SKIN", "--touch", "5,0", "--touch-in", "zz"),
         "--touch-in zz: no such frame; frames are 0"),
        ((*ADJACENT, "--touch", "5,0"), "--touch needs --skin FILE"),
    ],
)  # fmt: skip
def test_bad_words_are_refused_in_one_line(tmp_path, words, said):
    (tmp_path / "skin.toml").write_text(SKIN)
    path = write(tmp_path / "s.npz", healthy_frames(18))
    given = [tmp_path / "skin.toml" if word == "SKIN" else word for word in words]
    with pytest.raises(UsageError, match=said) as caught:
        run("doctor", path, *NPZ, *given)
    assert "\n" not in str(caught.value)
