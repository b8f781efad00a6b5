"""Boards that scan other patterns than adjacent: full and half scans, in any order of drives, with
the bits of this host."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from device_helpers import UNTOUCHED, frames, raw_frames, sim_board, sim_device

from eitskin.device.check import check_model, scanned, scanned_pattern
from eitskin.device.known_model import scanned_protocol
from eitskin.device.settings import ScanSettings
from eitskin.device.wire.link_table import Stream
from eitskin.errors import DeviceError
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.session.checks.host_check import check_recording
from eitskin.session.frame import Frame, Notice
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.skin.protocol import in_order, pattern, pattern_name
from eitskin.skin.skin import paper_skin
from eitskin.truth import observe_scene

SMALL = BuildSettings(pixels_across=20, elements=2000, samples=0)
PATTERNS = [("skip-3", None, "by 7"), ("opposite", None, "by 3"), ("skip-2", "adjacent", "by 5")]
PLACES = np.array([[-40.0, 10.0], [30.0, -25.0]])


@cache
def blob_of(drive: str, measure: str | None = None, order: str | None = None) -> bytes:
    protocol = pattern(16, drive, measure)
    ordered = protocol if order is None else in_order(protocol, order)
    return encode_model(build_model(paper_skin(), ordered, SMALL))


SCANS = {"full": 1, "half": 0, "one of 3 full": 3}  # touches after each drive with "full"
CASES = [
    pytest.param(
        *one, SCANS[scan], id=f"{one[0]}, {one[1]}, {scan}",
        marks=[] if k == n else pytest.mark.long("each pattern with one kind of scan"),
    )
    for k, one in enumerate(PATTERNS) for n, scan in enumerate(SCANS)
]  # fmt: skip


@pytest.mark.parametrize(("drive", "measure", "order", "check_every"), CASES)
def test_a_simulated_board_has_the_hosts_bits(tmp_path, drive, measure, order, check_every):
    model, run, full = tmp_path / "model.eitm", tmp_path / "run.eits", check_every == 1
    model.write_bytes(blob_of(drive, measure, order))
    settings = SessionSettings(
        mode=Stream.RAW | Stream.IMAGE | Stream.TOUCHES, report="drive" if full else "frame",
        tare=8, frames=7,
        model=model, record=run, scan=ScanSettings(check_every=check_every),
    )  # fmt: skip
    with Session("sim:two_touch", settings, observe=observe_scene) as session:
        seen = [item for item in session.messages() if isinstance(item, Frame)]
        info = session.device.board
    assert scanned_pattern(info) == (drive if measure is None else f"{drive}/{measure}")
    check, _ = check_recording(run, model)
    assert check.as_dict()["same_bits"] and check.compared >= 6
    assert (check.drives > 0) == full
    for place in PLACES:
        near = [np.hypot(one.x_mm - place[0], one.y_mm - place[1]) for one in seen[-1].touches]
        assert min(near) < 3


@pytest.mark.parametrize(("drive", "measure", "order"), PATTERNS)
def test_half_scans_measure_each_voltage_once_in_the_models_order(drive, measure, order):
    protocol = decode_model(blob_of(drive, measure, order), "model").protocol
    with sim_device(sim_board(blob_of(drive, measure, order))) as device:
        device.scan(check_every=0)
        device.start_scene()
        half = raw_frames(device, 2)[1]
        device.scan(check_every=1)
        whole = raw_frames(device, 2)[1]
    fold = protocol.reciprocal_pairs()
    assert whole.scan_us == 100 * protocol.n_rows - 20
    assert half.scan_us == 100 * len(fold.first) - 20
    exact = frames().voltage_v(protocol)[UNTOUCHED]
    assert whole.voltage_v == pytest.approx(exact, abs=3e-2 * np.abs(exact).max())
    assert half.voltage_v[fold.first] == pytest.approx(
        whole.voltage_v[fold.first], abs=1e-2 * np.abs(exact).max()
    )
    paired = fold.second >= 0
    assert np.array_equal(
        half.voltage_v[fold.second[paired]], fold.sign[paired] * half.voltage_v[fold.first[paired]]
    )


def test_patterns_of_boards_are_named():
    with sim_device(sim_board(blob_of("skip-3"))) as device:
        info = device.board
    assert pattern_name(scanned_protocol(info, None, "it")) == "skip-3"
    other = blob_of("opposite")
    with pytest.raises(DeviceError, match=r"the board scans skip-3 .* the model here opposite"):
        check_model(info, decode_model(other, "model"), other, "it")
    unknown = replace(info, protocol_hash=info.protocol_hash ^ 1)
    assert scanned(unknown) is None and scanned_pattern(unknown) == "a table of 208 rows"


OPEN = """
[scene]
name = "open"
frames = 5
quiet_frames = 8
elements = 2000
[effects.noise]
snr_db = 60.0
[effects.detached]
electrodes = [5]
from_s = 0.1
"""


@pytest.mark.parametrize(
    "drive", ["skip-3", pytest.param("opposite", marks=pytest.mark.long("skip-3"))]
)
def test_an_open_electrode_is_named(tmp_path, drive):
    model, scene = tmp_path / "model.eitm", tmp_path / "open.toml"
    model.write_bytes(blob_of(drive, None, {one[0]: one[2] for one in PATTERNS}[drive]))
    scene.write_text(OPEN, encoding="utf-8")
    with Session(f"sim:{scene}", SessionSettings(tare=8, model=model)) as session:
        texts = [item.text for item in session.messages() if isinstance(item, Notice)]
    assert [text for text in texts if text.startswith("electrode 5 open")]
    assert not [text for text in texts if "electrode" in text and "electrode 5" not in text]
