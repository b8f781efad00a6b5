"""Refusals of ``eitskin teach``: one line says which press is wrong and what to do, and no file is
written."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.model.eitm import save_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.skin.protocol import adjacent
from eitskin.teaching.presses import save_presses
from eitskin.teaching.teach import teach
from simulated_presses import SKIN, presses

Arrays = dict[str, Any]

DESCRIPTION = """
[skin]
name = "small"
diameter_mm = 100.0
thickness_mm = 5.0
conductivity_s_per_m = 0.02
[electrodes]
count = 8
width_mm = 4.0
"""
MODEL, PROTOCOL, FRAME = 6, 7, 8


@cache
def taught() -> Model:
    return teach(presses(20), SKIN).model


def with_value(name: str, where: Any, value: float) -> Callable[[Arrays], Arrays]:
    def change(arrays: Arrays) -> Arrays:
        new = arrays[name].copy()
        new[where] = value
        return {name: new}

    return change


BAD: dict[str, tuple[Callable[[Arrays], Arrays], int, str]] = {
    "outside": (
        lambda a: {"place_mm": a["place_mm"] + 60},
        FRAME,
        "correct its place, or the skin's description",
    ),
    "centimetres": (
        lambda a: {"place_mm": a["place_mm"] / 10},
        FRAME,
        "look like cm: multiply place_mm by 10",
    ),
    "no untouched frames": (
        lambda a: {"untouched": None},
        FRAME,
        "the untouched frame just before it",
    ),
    "untouched frames of zeros": (
        lambda a: {"untouched": 0 * a["untouched"]},
        FRAME,
        "take the frame just before each press",
    ),
    "untouched frame while pressed": (
        lambda a: {"untouched": np.vstack([a["pressed"][:1], a["untouched"][1:]])},
        FRAME,
        "presses 0 (from 0) hardly differ from their untouched frame",
    ),
    "untouched frames while pressed": (
        lambda a: {"untouched": a["pressed"]},
        FRAME,
        "no press differs from its untouched frame; take that before the finger is down",
    ),
    "one corner": (
        lambda a: {"place_mm": 0.01 * a["place_mm"] + 30},
        FRAME,
        "press all over it (eitskin teach plan chooses the places)",
    ),
    "a press with NaN": (
        with_value("pressed", (3, 2), np.nan),
        FRAME,
        "press 3 (from 0) has a number in pressed that is not finite",
    ),
    "a row of NaN": (
        with_value("pressed", (slice(None), 4), np.nan),
        FRAME,
        "leave those rows out, of drive_measure too",
    ),
    "a place of NaN": (
        with_value("place_mm", (5, 0), np.nan),
        FRAME,
        "press 5 (from 0) has no place",
    ),
    "three presses": (
        lambda a: {n: a[n][:3] for n in ("untouched", "pressed", "place_mm", "depth_mm")},
        FRAME,
        "3 presses are too few; record at least 5",
    ),
    "another protocol": (
        lambda a: {
            "drive_measure": adjacent(16).drive_measure,
            "n_electrodes": 16,
            **{n: np.ones((12, 1)) * np.resize(a[n], (1, 208)) for n in ("untouched", "pressed")},
        },
        PROTOCOL,
        "give the ",
    ),
}


@pytest.fixture
def files(tmp_path) -> Path:
    """A folder with twelve good presses, the skin, and a taught model."""
    save_presses(tmp_path / "good.npz", presses(12))
    save_model(tmp_path / "taught.eitm", taught())
    (tmp_path / "skin.toml").write_text(DESCRIPTION, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("name", BAD)
def test_presses_that_cannot_teach(refused, files, name):
    change, code, words = BAD[name]
    arrays = dict(np.load(files / "good.npz"))
    changed = arrays | change(arrays)
    bad, out = files / "bad.npz", files / "new.eitm"
    np.savez(bad, **{key: value for key, value in changed.items() if value is not None})
    for arguments in (
        ("fit", bad, "--skin", files / "skin.toml"),
        ("update", files / "taught.eitm", bad),
    ):
        line = refused(code, "teach", *arguments, f"-o {out}")
        assert words in line and str(bad if code == FRAME else "") in line


@pytest.mark.parametrize("action", ["update", "check"])
def test_a_model_from_physics_is_none_to_adapt(refused, files, action):
    save_model(files / "physics.eitm", load_prebuilt()[0])
    out = ("-o", files / "new.eitm") if action == "update" else ()
    line = refused(MODEL, f"teach {action} {files / 'physics.eitm'} {files / 'good.npz'}", *out)
    assert line.endswith("and was not taught; make one with  eitskin teach fit")


def test_frames_without_a_press_leave_the_old_file(files, frames_file, ran):
    plan, old = files / "plan.csv", (files / "good.npz").read_bytes()
    plan.write_text("x_mm,y_mm\n1,2\n500,0\n")
    given = ["--plan", plan, "-o", files / "good.npz", "--frames", frames_file, "--overwrite"]
    skin = ["--skin", files / "skin.toml"]
    said = ran(FRAME, "teach record", *given, *skin)[1].splitlines()
    assert said[0].endswith("outside the skin 'small': places 2 of 2; are they in mm?")
    assert said[1].endswith("because the frames ended before any press of the plan was held")
    assert (files / "good.npz").read_bytes() == old


def test_frames_of_another_protocol_check_nothing(refused, files, frames_file):
    line = refused(PROTOCOL, f"teach check {files / 'taught.eitm'} {frames_file}")
    assert line.endswith("give the model of this skin")


def test_a_board_of_other_electrodes_is_told_before_any_press(refused, files):
    plan = files / "plan.csv"
    plan.write_text("x_mm,y_mm\n1,2\n")
    given = ("--plan", plan, "-o", files / "new.npz", "--skin", files / "skin.toml")
    line = refused(PROTOCOL, "teach record", *given, "--device sim:hydrogel")
    assert "8 electrodes, but the board scans 16; build" in line
