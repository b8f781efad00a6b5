"""Measured tank frames: their order, sign and numbering are recognised, import repairs them, and
truth comes along."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.frames.doctor import examine, subject_from_frames, subject_from_source
from eitskin.frames.frames import Frames, load_frames, save_frames
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.source import SourceOptions
from eitskin.frames.truth import TruthOptions
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import Skin

KIT4 = Skin(
    "kit4", disk(280.0), Electrodes(count=16, width_mm=25.0, start_angle_deg=90.0, clockwise=True)
)
KIT4_SOURCE = SourceOptions(
    voltage="voltage", reference="reference_voltage", names="frame_name",
    protocol_table="drive_measure", scale=1.0,
)  # fmt: skip
KIT4_TRUTH = TruthOptions(
    touch_frame="object_frame",
    touch_xy="object_xy",
    touch_radius="object_radius",
    touch_sign="object_is_conductive",
    touch_unit_mm=140.0,
    mask="truth_mask",
)
TANKS = ("tank_metal_e1.csv", "tank_metal_e1_e13_plastic_e5_e9.csv")
MENDED = ImportOptions(
    source=SourceOptions(columns="2", reference_columns="0"),
    order="rotating",
    sign="reversed",
    clockwise=True,
)


@pytest.fixture(scope="module")
def kit4(shared_data, tmp_path_factory) -> Frames:
    options = ImportOptions(source=KIT4_SOURCE, truth=KIT4_TRUTH)
    path = tmp_path_factory.mktemp("kit4") / "kit4.npz"
    save_frames(path, import_frames(shared_data / "kit4_dev.npz", options, adjacent(16), KIT4))
    return load_frames(path)


def test_kit4_is_imported_with_its_truth(kit4, shared_data):
    with np.load(shared_data / "kit4_dev.npz") as source:
        assert np.array_equal(kit4.voltage_v, source["voltage"])
        assert np.array_equal(kit4.reference_v, source["reference_voltage"])
        assert np.array_equal(kit4.truth_mask, source["truth_mask"])
        assert kit4.touch_xy_mm is not None and kit4.touch_sign is not None
        assert np.allclose(kit4.touch_xy_mm, 140 * source["object_xy"])
        assert ((kit4.touch_sign > 0) == source["object_is_conductive"]).all()
    assert kit4.frame_name == ("1_1", "1_3", "2_1", "2_3", "2_6", "3_2", "3_4", "4_1", "4_3")
    assert kit4.touches_in(kit4.frame_name.index("3_4")).tolist() == [11, 12, 13]
    assert kit4.truth_mask_extent_mm == (-140.0, -140.0, 140.0, 140.0)
    assert (kit4.protocol.hash, kit4.meta["unit"]) == (adjacent(16).hash, "V")


def test_kit4_is_healthy_with_notes_on_what_is_there(kit4):
    report = examine(subject_from_frames(kit4, KIT4))
    assert report.exit_code == 0
    found = {finding.name: finding for finding in report.findings}
    assert set(found) == {"measure-pair-gain", "gain-spread", "reciprocity"}
    gains = (f.evidence for f in report.findings if f.name == "measure-pair-gain")
    assert {tuple(one["pair"]): one["gain"] for one in gains} == {
        (14, 15): pytest.approx(0.908, abs=0.005),
        (15, 0): pytest.approx(1.113, abs=0.005),
    }
    assert found["gain-spread"].evidence["spread"] == pytest.approx(0.045, abs=0.003)
    assert found["reciprocity"].evidence["rms"] == pytest.approx(0.053, abs=0.003)
    assert report.measured["numbering_by_touch"]["as given"] == pytest.approx(0.975, abs=0.005)
    assert report.measured["numbering_by_touch"]["--rotate 15"] < 0.85


def test_kit4_numbered_the_other_way_is_noticed(kit4):
    wrong = replace(KIT4, electrodes=replace(KIT4.electrodes, clockwise=False))
    report = examine(subject_from_frames(kit4, wrong))
    assert report.repair == "--mirror" and report.exit_code == 11
    turned = replace(KIT4, electrodes=replace(KIT4.electrodes, start_angle_deg=0.0))
    assert examine(subject_from_frames(kit4, turned)).repair == "--rotate 12"


@pytest.mark.parametrize("name", TANKS)
def test_the_rotating_order_of_the_raw_exports_is_recognised(shared_data, name):
    report = examine(subject_from_source(shared_data / name, ImportOptions(), adjacent(16), None))
    assert report.exit_code == 11
    assert report.repair == "--order rotating --sign reversed"
    found = {finding.name: finding.evidence for finding in report.findings}
    assert found["order"]["correlation"]["rotating"] > 0.995
    assert found["order"]["correlation"]["fixed"] < 0.25
    assert found["frames-unlike-the-reference"]["frames"] == ["1", "3"]


@pytest.mark.parametrize("name", TANKS)
@pytest.mark.parametrize("part", (None, "in-phase"))
def test_mended_raw_exports_are_clean(shared_data, name, part):
    source = (
        MENDED.source
        if part is None
        else SourceOptions("2,3", None, "2,3", "0,1", complex_part=part, pairs="real-imag")
    )
    source = replace(source, voltage=None)
    frames = import_frames(shared_data / name, replace(MENDED, source=source), adjacent(16), KIT4)
    report = examine(subject_from_frames(frames, KIT4))
    assert report.exit_code == 0
    assert {finding.name for finding in report.findings} <= {"gain-spread"}
    assert report.measured["reference_correlation"] > 0.995
    assert report.measured["reciprocity_rms"] < 0.03


def test_the_metal_rod_changes_most_beside_its_electrode(shared_data):
    """A rod is beside electrode 0 (1 in the names of the data), in the second file beside 0 and 12
    (1 and 13)."""
    for name, electrodes in zip(TANKS, ((0,), (0, 12)), strict=True):
        frames = import_frames(shared_data / name, MENDED, adjacent(16), KIT4)
        rows = frames.protocol.drive_measure.astype(np.int64)
        change = frames.voltage_v[0] - frames.reference_v
        strongest = np.argsort(-np.abs(change))[:10]
        assert np.isin(rows[strongest], electrodes).any(axis=1).sum() >= 8
        apart = np.abs((rows[strongest][..., None] - np.array(electrodes) + 8) % 16 - 8).min(axis=2)
        assert (apart <= 3).all()
        assert (change[strongest] / frames.reference_v[strongest] < 0).all()


def test_the_metal_rods_place_agrees_with_the_numbering(shared_data):
    options = replace(MENDED, source=replace(MENDED.source, scale=1.0))
    frames = import_frames(shared_data / TANKS[1], options, adjacent(16), KIT4)
    known = replace(
        frames,
        touch_frame=np.zeros(4, dtype=np.int64),
        touch_xy_mm=0.58 * KIT4.electrode_centres_mm()[[0, 12, 4, 8]],
        touch_radius_mm=np.full(4, 14.0),
        touch_sign=np.array([1, 1, -1, -1], dtype=np.int8),
    )
    report = examine(subject_from_frames(known, KIT4))
    assert report.exit_code == 0
    assert report.measured["numbering_by_touch"]["as given"] > 0.85
