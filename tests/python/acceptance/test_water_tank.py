"""Measured frames that nobody here made, from raw arrays to touches by the commands that
docs/guide/tank.md gives.

The data are not part of the project; without them these tests are skipped.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.frames.frames import load_frames
from eitskin.model.eitm import load_model
from eitskin.scoring.score import scorer_for
from eitskin.solve.reconstructor import Reconstructor

SKIN = Path(__file__).resolve().parents[3] / "examples" / "tank_kit4.toml"
DIAMETER_MM = 280.0
TOUCH_LIKE = {"1_3": 1, "2_3": 2, "2_6": 2, "3_4": 3}
IMPORT = [
    "--voltage", "voltage", "--reference", "reference_voltage", "--scale", "1", "--protocol-table",
    "drive_measure",
    "--names", "frame_name", "--truth-frame", "object_frame", "--truth-xy", "object_xy",
    "--truth-radius", "object_radius",
    "--truth-sign", "object_is_conductive", "--truth-unit-mm", "140", "--truth-mask", "truth_mask",
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(shared_data, tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("tank")
    source, skin = str(shared_data / "kit4_dev.npz"), str(SKIN)
    build = ["--data", "log-ratio", "--touch-change", "2", "--samples", "0"]
    assert main(["import", source, "-o", str(place / "kit4.npz"), "--skin", skin, *IMPORT]) == 0
    assert main(["model", "build", skin, "-o", str(place / "kit4.eitm"), *build]) == 0
    build[-1] = "6"  # random skins, from which the model states its own errors
    assert main(["model", "build", skin, "-o", str(place / "tested.eitm"), *build]) == 0
    return place


def reconstructed(
    folder: Path,
    frames: str,
    capsys: pytest.CaptureFixture[str],
    *options: str,
    model: str = "kit4.eitm",
) -> dict[str, Any]:
    capsys.readouterr()
    model = str(folder / model)
    assert main(["reconstruct", str(folder / frames), "--model", model, "--json", *options]) == 0
    facts: dict[str, Any] = json.loads(capsys.readouterr().out)
    return facts


def test_every_metal_object_is_found_and_nothing_else(folder, capsys):
    facts = reconstructed(folder, "kit4.npz", capsys, "--only", ",".join(TOUCH_LIKE))
    assert {frame["name"]: len(frame["touches"]) for frame in facts["frames"]} == TOUCH_LIKE
    summary = facts["summary"]
    assert (summary["found"], summary["true"], summary["false"]) == (8, 8, 0)
    assert summary["position_median_mm"] <= 0.02 * DIAMETER_MM
    assert summary["position_worst_mm"] <= 0.03 * DIAMETER_MM
    assert summary["miou_touches"] >= 0.84
    assert min(frame["miou_touches"] for frame in facts["frames"]) >= 0.80


@pytest.mark.parametrize("model", ["kit4.eitm", "tested.eitm"])
def test_the_touches_show_every_frame_and_better_than_the_solver(folder, capsys, model):
    """On log-ratio data touches are not fitted jointly and leave 2 to 11 % of the data, also with a
    model that states its errors. Its image had an MIoU of .65 when the guard asked for 2 %."""
    facts = reconstructed(folder, "kit4.npz", capsys, "--only", ",".join(TOUCH_LIKE), model=model)
    assert {frame["image_is"] for frame in facts["frames"]} == {"touches"}
    summary = facts["summary"]
    assert (summary["found"], summary["false"]) == (8, 0)
    assert summary["miou_image"] >= 0.85
    assert summary["miou_image"] >= summary["miou_solver"] + 0.1


def test_the_oracle_finds_most_metal_objects_and_nothing_else(folder, capsys):
    """Its touches are the best fit from the image's peaks. It neither splits nor merges discs, so
    that two near objects may be one: 6 of the 8 were found when the oracle was written."""
    facts = reconstructed(
        folder, "kit4.npz", capsys, "--only", ",".join(TOUCH_LIKE), "--engine", "numpy"
    )
    summary = facts["summary"]
    assert summary["true"] == 8
    assert summary["found"] >= 6
    assert summary["false"] == 0


def test_the_reference_is_the_models_own(folder):
    model, blob = load_model(folder / "kit4.eitm")
    frames = load_frames(folder / "kit4.npz")
    for engine in ("c", "c64", "numpy"):
        reconstructor = Reconstructor(model, engine=engine, blob=blob)
        reconstructor.check_protocol(frames.protocol)
        baseline = reconstructor.tare(frames.reference_voltage_v)
        assert baseline.correlation >= 0.99
        assert scorer_for(model).gate_mm == pytest.approx(10 * 280 / 194)


def test_gains_of_single_channels_do_not_matter_to_ratios(folder):
    """log(v / v0) is the same whatever each channel's amplifier does, as long as it does so in
    both."""
    model, blob = load_model(folder / "kit4.eitm")
    frames = load_frames(folder / "kit4.npz")
    gain = 1 + 0.02 * np.random.default_rng(1).normal(size=208)
    found = []
    for factor in (np.ones(208), gain):
        reconstructor = Reconstructor(model, blob=blob)
        reconstructor.tare(frames.reference_voltage_v * factor)
        number = frames.frame_name.index("2_6")
        found.append(reconstructor.reconstruct(frames.voltage_v[number] * factor).touches)
    assert len(found[0]) == len(found[1]) == 2
    for a, b in zip(*found, strict=True):
        assert np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) < 3


def test_a_raw_export_in_another_order_and_polarity(folder, shared_data, capsys):
    """The rod before electrode 0 (12 o'clock) at 0.58 of the radius is the strongest touch, and it
    conducts."""
    source, output = str(shared_data / "tank_metal_e1.csv"), str(folder / "e1.npz")
    repair = [
        "--columns",
        "2",
        "--reference-columns",
        "0",
        "--order",
        "rotating",
        "--sign",
        "reversed",
    ]
    assert main(["import", source, "-o", output, "--skin", str(SKIN), *repair]) == 0
    touches = reconstructed(folder, "e1.npz", capsys, "--sign", "both")["frames"][0]["touches"]
    rod = touches[0]
    assert rod["strength_s_per_m_mm2"] > 0
    assert np.hypot(rod["x_mm"], rod["y_mm"]) / (DIAMETER_MM / 2) == pytest.approx(0.58, abs=0.06)
    assert abs(np.degrees(np.arctan2(rod["x_mm"], rod["y_mm"]))) < 6


def test_the_shown_image_of_a_tank_is_better_than_the_solvers(folder, capsys):
    """Nine frames with conducting and resistive objects, some of them wide. The model does not
    state its errors, so touches may leave more of the data than in simulated scenes. The MIoU is
    .858. It was .846, with 16 objects found and 10 false touches, when three objects were shown as
    eight touches, because discs were no longer merged after 120 steps of the fit."""
    facts = reconstructed(folder, "kit4.npz", capsys, "--sign", "both")
    assert [frame["image_is"] for frame in facts["frames"]] == ["touches"] * 9
    better = [frame["miou_image"] > frame["miou_solver"] for frame in facts["frames"]]
    assert all(better)
    assert (facts["summary"]["found"], facts["summary"]["true"]) == (18, 18)
    assert facts["summary"]["false"] <= 3
    assert facts["summary"]["miou_image"] >= 0.85
    assert facts["summary"]["miou_image"] >= facts["summary"]["miou_solver"] + 0.15
