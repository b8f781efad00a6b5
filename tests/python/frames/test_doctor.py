"""The doctor on frames from the closed form: healthy ones give no finding, each injected fault is
named."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from injected import (
    FloatArray,
    as_if_electrodes,
    changed,
    healthy_frames,
    pair_off,
    reversed_sign,
    rotating,
    rows_off,
    times,
    untouched_only,
    wired,
)

from eitskin.frames.doctor import DoctorReport, Finding, examine, subject_from_frames
from eitskin.frames.doctor.remedy import combined_remedy
from eitskin.frames.frames import Frames
from eitskin.frames.homogeneous import homogeneous, shorted
from eitskin.frames.orders import electrode_map
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import polygon
from eitskin.skin.protocol import Protocol, adjacent, opposite, skip
from eitskin.skin.skin import Skin, paper_skin

ROWS = adjacent(16).drive_measure.astype(np.int64)
PAPER = paper_skin()
PROTOCOLS = {
    "adjacent": adjacent(16),
    "opposite": opposite(16),
    "skip2": skip(16, 2),
    "adjacent8": adjacent(8),
}
by_protocol = pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=PROTOCOLS.keys())


def skin_for(protocol: Protocol) -> Skin:
    return replace(PAPER, electrodes=replace(PAPER.electrodes, count=protocol.n_electrodes))


def report_of(frames: Frames, skin: Skin | None = PAPER) -> DoctorReport:
    return examine(subject_from_frames(frames, skin))


def named(report: DoctorReport) -> list[tuple[str, str]]:
    return [(finding.name, finding.severity) for finding in report.findings]


def only(frames: Frames, name: str, severity: str = "fault", skin: Skin | None = PAPER) -> Finding:
    """The single finding of ``frames``, which must have this name."""
    report = report_of(frames, skin)
    assert named(report) == [(name, severity)], report.lines()
    assert report.exit_code == (11 if severity == "fault" else 0)
    return report.findings[0]


def rms(frames: Frames) -> float:
    return float(np.sqrt(np.mean(frames.reference_voltage_v**2)))


def with_dead(
    frames: Frames, electrodes: tuple[int, ...], driving: bool, measuring: bool, seed: int
) -> Frames:
    """These electrodes float when they measure, drive no current, or both."""
    rng = np.random.default_rng(seed)
    reference, voltage = frames.reference_voltage_v.copy(), frames.voltage_v.copy()
    largest_v, noise_v = np.abs(reference).max(), 1e-3 * rms(frames)
    for electrode in electrodes:
        drives, measures = (
            (ROWS[:, columns] == electrode).any(axis=1) for columns in ([0, 1], [2, 3])
        )
        floating = rng.uniform(-1, 1, 208) * largest_v
        for values in (reference, voltage):
            noise = noise_v * rng.normal(size=values.shape)
            if measuring:
                values[:, measures] = (floating + 20 * noise)[:, measures]
            if driving:
                values[:, drives] = noise[:, drives]
    return changed(frames, reference, voltage)


@pytest.mark.parametrize(
    "protocol",
    [
        p if name == "adjacent" else pytest.param(p, marks=pytest.mark.long("adjacent"))
        for name, p in PROTOCOLS.items()
    ],
    ids=PROTOCOLS,
)
def test_fifty_healthy_frames_raise_no_alarm(protocol):
    skin = skin_for(protocol)
    for seed in range(50):
        report = report_of(healthy_frames(seed, protocol, skin), skin)
        assert named(report) == [], (seed, report.lines())
        assert report.exit_code == 0
        assert report.measured["snr_db"] == pytest.approx(60, abs=1.5)
        assert report.measured["gain_spread"] == pytest.approx(0.02, abs=0.012)


def test_noiseless_and_digitised_frames_raise_no_alarm():
    assert named(report_of(healthy_frames(1, gain=0, snr_db=300))) == []
    frames = healthy_frames(2)
    step = 2 * np.abs(frames.reference_voltage_v).max() / 4096
    reference, voltage = (
        np.round(v / step) * step for v in (frames.reference_voltage_v, frames.voltage_v)
    )
    assert named(report_of(changed(frames, reference, voltage))) == []


def test_finite_element_frames_with_uneven_contacts_raise_no_alarm():
    from eitskin.fem.cem import ForwardModel
    from eitskin.fem.mesh import mesh_for_elements

    mesh = mesh_for_elements(PAPER, 3000)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        clean = ForwardModel(mesh, PAPER, adjacent(16), 0.01 * rng.uniform(0.8, 1.2, 16)).voltages(
            0.01
        )
        untouched = clean * (1 + 0.02 * rng.normal(size=208)) + 1e-3 * np.std(clean) * rng.normal(
            size=(8, 208)
        )
        assert named(report_of(Frames(adjacent(16), untouched[:1], untouched))) == []


@by_protocol
def test_rotating_order_is_recognised(protocol):
    skin = skin_for(protocol)
    finding = only(rotating(healthy_frames(3, protocol, skin)), "order", skin=skin)
    assert finding.repair == "--order rotating"
    reached = finding.evidence["correlation"]
    assert reached["rotating"] > 0.99 and reached["as given"] < 0.5


@by_protocol
def test_reversed_polarity_is_recognised(protocol):
    skin = skin_for(protocol)
    frames = reversed_sign(healthy_frames(4, protocol, skin))
    one_sign = len(set(np.sign(frames.reference_v))) == 1
    finding = only(frames, "reversed-or-magnitude" if one_sign else "reversed", skin=skin)
    assert finding.repair == "--sign reversed"


def test_reversed_polarity_is_certain_once_a_row_crosses_zero():
    frames = healthy_frames(4)
    voltage = -frames.voltage_v.copy()
    voltage[0, 6] = -0.2 * rms(frames)
    crossing = untouched_only(changed(frames, -frames.reference_voltage_v, voltage))
    assert only(crossing, "reversed").repair == "--sign reversed"


def magnitudes(frames: Frames) -> Frames:
    return changed(frames, np.abs(frames.reference_voltage_v), np.abs(frames.voltage_v))


@pytest.mark.parametrize("protocol", (opposite(16), skip(16, 2)), ids=("opposite", "skip2"))
def test_magnitudes_are_recognised_where_signs_differ(protocol):
    assert only(magnitudes(healthy_frames(5, protocol)), "magnitude").repair == "--sign magnitude"


def test_magnitudes_of_adjacent_patterns_cannot_be_told_from_reversed():
    finding = only(magnitudes(healthy_frames(5)), "reversed-or-magnitude")
    assert "cannot be distinguished" in finding.text


@pytest.mark.parametrize(
    ("rotate", "mirror", "option"),
    [(3, False, "--rotate 3"), (0, True, "--mirror"), (5, True, "--rotate 5 --mirror")],
)
def test_numbering_is_told_by_two_known_touches(rotate, mirror, option):
    frames = as_if_electrodes(healthy_frames(6), electrode_map(16, rotate, mirror), seed=6)
    finding = only(frames, "numbering")
    assert finding.repair == option
    assert finding.evidence[option] > 0.98 > finding.evidence["as given"] + 0.05


def test_numbering_of_a_symmetric_skin_is_declared_inconclusive_without_a_touch():
    frames = as_if_electrodes(healthy_frames(6), electrode_map(16, 5, True), seed=6)
    known, unknown_places = report_of(untouched_only(frames)), report_of(frames, None)
    assert named(known) == []
    for report, option in ((known, "--touch X,Y"), (unknown_places, "--skin")):
        reported = [
            text for text in report.inconclusive if "in which direction the numbers run" in text
        ]
        assert any(option in text for text in reported)


def test_one_touch_leaves_its_mirror_image_and_says_so():
    report = report_of(healthy_frames(7, touches_mm=((0.0, 60.0),)))
    assert named(report) == []
    assert any("fits as given, but --mirror too" in text for text in report.inconclusive)


def test_numbering_of_an_odd_outline_is_told_by_the_untouched_frame():
    corners = [(-60.0, -40.0), (70.0, -40.0), (70.0, 30.0), (10.0, 60.0), (-60.0, 40.0)]
    skin = Skin("odd", polygon(corners), Electrodes(count=8))
    transfer = homogeneous(skin, 8).transfer_ohm

    def numbered(moved: FloatArray) -> Frames:
        there = transfer[np.ix_(moved, moved)]
        made = healthy_frames(8, adjacent(8), skin_for(adjacent(8)), transfer_ohm=there)
        return untouched_only(made)

    assert named(report_of(numbered(np.arange(8)), skin)) == []
    for rotate, mirror, option in ((3, False, "--rotate 3"), (1, True, "--rotate 1 --mirror")):
        turned = numbered(electrode_map(8, rotate, mirror))
        assert only(turned, "numbering", skin=skin).repair == option


@pytest.mark.parametrize(
    "firsts",
    [(0, 5), pytest.param(range(16), marks=pytest.mark.long("two of the wires"))],
    ids=["two", "all"],
)
def test_every_pair_of_exchanged_wires_is_named(firsts):
    for i, j in combinations(range(16), 2):
        if i not in firsts:
            continue
        exchanged = wired(16 * i + j, (i, j))
        assert only(exchanged, "swapped-electrodes").repair == f"--swap {i},{j}"


@pytest.mark.parametrize(
    ("width_mm", "known"),
    [
        (4.0, True),
        pytest.param(20.0, True, marks=pytest.mark.long("4 mm")),
        pytest.param(1.5, False, marks=pytest.mark.long("4 mm")),
    ],
)
def test_joined_electrodes_are_named_whatever_their_width(width_mm, known):
    skin = replace(PAPER, electrodes=replace(PAPER.electrodes, width_mm=width_mm))
    transfer = homogeneous(skin, 16).transfer_ohm
    for i, j in combinations(range(16), 2):
        if i not in (0, 5):
            continue
        joined = untouched_only(healthy_frames(16 * i + j, transfer_ohm=shorted(transfer, i, j)))
        finding = only(joined, "shorted-electrodes", skin=PAPER if known else None)
        assert finding.evidence["electrodes"] == [i, j] and finding.repair == ""


@pytest.mark.parametrize(
    ("driving", "measuring"),
    [
        (True, True),
        pytest.param(True, False, marks=pytest.mark.long("both sides")),
        pytest.param(False, True, marks=pytest.mark.long("both sides")),
    ],
)
def test_every_dead_electrode_is_named_with_its_side(driving, measuring):
    for electrode in range(16):
        frames = with_dead(healthy_frames(electrode), (electrode,), driving, measuring, electrode)
        finding = only(frames, "dead-electrode")
        assert finding.repair == f"--drop-electrodes {electrode}"
        assert ("driving" in finding.text, "measuring" in finding.text) == (driving, measuring)


@pytest.mark.parametrize("dead", [(1, 3, 11), (6, 7, 12), (0, 1, 9)], ids=str)
@pytest.mark.parametrize(("driving", "measuring"), [(True, True), (True, False), (False, True)])
def test_three_dead_electrodes_are_named_instead_of_their_rows(dead, driving, measuring):
    report = report_of(with_dead(healthy_frames(3), dead, driving, measuring, 3))
    assert named(report) == [("dead-electrode", "fault")] * 3, report.lines()
    assert tuple(sorted(one.evidence["electrode"] for one in report.findings)) == dead


def test_an_electrode_lost_in_a_frame_is_named():
    frames = untouched_only(healthy_frames(11))
    voltage = frames.voltage_v.copy()
    voltage[:, (ROWS[:, :2] == 7).any(axis=1)] *= 1e-3
    finding = only(changed(frames, frames.reference_voltage_v, voltage), "electrode-lost")
    assert finding.evidence["electrode"] == 7 and finding.evidence["frames"] == [0]
    # and beside a row of it that is dead in the untouched frames too, so that no part of it is
    # left
    dead = int(np.flatnonzero((ROWS[:, :2] == 7).any(axis=1))[3])
    reference = frames.reference_voltage_v.copy()
    reference[:, dead] = voltage[:, dead] = 0
    found = report_of(changed(frames, reference, voltage)).findings
    assert [one.evidence["electrode"] for one in found if one.name == "electrode-lost"] == [7]


@pytest.mark.parametrize("quantile", (0.9, 0.99))
def test_saturated_rows_are_named(quantile):
    frames = healthy_frames(12)
    rail = float(np.quantile(np.abs(frames.reference_voltage_v), quantile))
    reference = np.clip(frames.reference_voltage_v, -rail, rail)
    finding = only(changed(frames, reference, np.clip(frames.voltage_v, -rail, rail)), "saturated")
    clipped = (np.abs(reference) == rail).any(axis=0) | (np.abs(frames.voltage_v) >= rail).any(
        axis=0
    )
    assert finding.evidence["channels"] == np.flatnonzero(clipped).tolist()
    assert finding.evidence["rail_v"] == [pytest.approx(-rail)]


@pytest.mark.parametrize(
    ("rows", "noise", "name", "repair"),
    [
        ([77], 20e-3, "noisy-channels", "--impute-channels 77"),
        ([13], 0.0, "stuck", "--impute-channels 13"),
        (np.flatnonzero((ROWS == 5).any(axis=1)), 20e-3, "noisy-channels", "--drop-electrodes 5"),
    ],
    ids=["a noisy row", "a stuck one", "a noisy electrode"],
)
def test_noise_of_its_own_and_none_are_named(rows, noise, name, repair):
    frames, rng = healthy_frames(13), np.random.default_rng(13)
    reference = frames.reference_voltage_v.copy()
    own = noise * rms(frames) * rng.normal(size=(len(reference), len(rows)))
    reference[:, rows] = own + (reference[:, rows] if noise else reference[0, rows])
    finding = only(changed(frames, reference, frames.voltage_v), name)
    assert finding.evidence["channels"] == list(rows) and finding.repair == repair


@pytest.mark.parametrize(("snr_db", "severity"), [(40.0, "note"), (20.0, "fault")])
def test_the_snr_is_measured_and_judged(snr_db, severity):
    report = report_of(untouched_only(healthy_frames(14, snr_db=snr_db, untouched=60, gain=0.0)))
    assert named(report) == [("snr", severity)]
    assert report.measured["snr_db"] == pytest.approx(snr_db, abs=0.5)


@pytest.mark.parametrize(("drift", "severity"), [(0.01, "note"), (-0.03, "fault")])
def test_drift_is_measured_and_judged(drift, severity):
    frames = healthy_frames(15)
    ramp = 1 + np.linspace(-drift / 2, drift / 2, len(frames.reference_voltage_v))
    drifting = changed(frames, frames.reference_voltage_v * ramp[:, None], frames.voltage_v)
    finding = only(drifting, "drift", severity)
    assert finding.evidence["drift"] == pytest.approx(drift, rel=0.05)


def test_gain_faults_are_told_apart():
    frames = healthy_frames(16)
    finding = only(rows_off(frames, [40], 1.4), "channel-gain")
    assert finding.evidence["channels"] == [40] and finding.repair == "--impute-channels 40"
    assert finding.evidence["worst_gain"] == pytest.approx(1.4, rel=0.1)
    for name, columns, gain in (("drive", slice(0, 2), 0.7), ("measure", slice(2, 4), 1.3)):
        finding = only(pair_off(frames, columns, gain), f"{name}-pair-gain")
        assert finding.evidence["pair"] == [3, 4]
        assert finding.evidence["gain"] == pytest.approx(gain, rel=0.03)
    report = report_of(times(frames, np.random.default_rng(16).uniform(0.8, 1.2, 208)))
    assert named(report) == [("gain-spread", "fault"), ("reciprocity", "fault")]
    assert report.repair == "--equalise"
    found = named(report_of(healthy_frames(16, gain=0.045)))
    assert found == [("gain-spread", "note"), ("reciprocity", "note")]


def test_a_pair_that_breaks_reciprocity_is_named():
    assert ROWS[3].tolist() == [0, 1, 5, 6] and ROWS[65].tolist() == [5, 6, 0, 1]
    frames = rows_off(rows_off(healthy_frames(17, gain=0.005), [3], 1.18), [65], 0.86)
    finding = only(frames, "reciprocity-pairs")
    assert list(finding.evidence["errors"]) == ["3/65"]
    assert finding.evidence["errors"]["3/65"] == pytest.approx(0.32 / 1.02, rel=0.1)
    assert finding.evidence["off"] == [3]


def test_rows_of_the_wrong_sign_are_named():
    finding = only(pair_off(healthy_frames(18), slice(0, 2), -1.0), "flipped-channels")
    assert "drive [3, 4]" in finding.text
    of_pair = (ROWS[:, :2] == [3, 4]).all(axis=1)
    assert finding.evidence["channels"] == np.flatnonzero(of_pair).tolist()


def test_values_that_are_no_numbers_are_counted_and_named():
    frames = healthy_frames(19)
    reference, voltage = frames.reference_voltage_v.copy(), frames.voltage_v.copy()
    reference[3, 13], voltage[0, 100] = np.nan, np.inf
    finding = only(untouched_only(changed(frames, reference, voltage)), "not-finite")
    assert finding.evidence == {"channels": [13, 100], "frames": ["0"], "quiet_frames": [3]}


def test_frames_that_cannot_be_examined_say_only_that():
    frames, rng = healthy_frames(20), np.random.default_rng(20)
    only(times(frames, np.float64(0)), "no-signal")
    noise = changed(untouched_only(frames), np.abs(rng.normal(size=208))[None], np.zeros((0, 208)))
    assert "unlike-a-homogeneous-skin" in dict(named(report_of(noise)))
    imaginary = untouched_only(changed(frames, frames.reference_voltage_v, -0.4 * frames.voltage_v))
    finding = only(imaginary, "frames-unlike-the-reference")
    assert finding.evidence["frames"] == ["0"] and "--complex-part" in finding.text


def test_a_wrong_unit_is_noted():
    finding = only(times(healthy_frames(21), np.float64(1000)), "unit", "note")
    assert finding.evidence["reference_per_predicted"] == pytest.approx(1000, rel=0.05)


def test_one_untouched_frame_leaves_noise_inconclusive():
    report = report_of(healthy_frames(22, untouched=1))
    assert named(report) == [] and "snr_db" not in report.measured
    assert any(
        text.startswith("noise, SNR and drift: 1 untouched frame(s)")
        for text in report.inconclusive
    )


def stuck(frames: Frames, rows: list[int]) -> Frames:
    """Rows that give one value in every untouched frame and in the others."""
    reference, voltage = frames.reference_voltage_v.copy(), frames.voltage_v.copy()
    reference[:, rows] = voltage[:, rows] = 1e-4
    return changed(frames, reference, voltage)


def not_finite(frames: Frames, rows: list[int]) -> Frames:
    """NaN in the first untouched frame."""
    reference = frames.reference_voltage_v.copy()
    reference[0, rows] = np.nan
    return changed(frames, reference, frames.voltage_v)


SEVERAL = {
    "two pairs of exchanged wires": (
        lambda: wired(8, (3, 9), (1, 14)), "swapped-electrodes", "--swap 3,9 --swap 1,14",
    ),
    "two rows of the wrong sign": (
        lambda: rows_off(healthy_frames(12), [17, 90], -1.0),
        "flipped-channels", "--flip-channels 17,90",
    ),
    "two stuck rows": (
        lambda: stuck(healthy_frames(22), [4, 60]), "stuck", "--impute-channels 4,60",
    ),
    "three rows with numbers that are not finite": (
        lambda: not_finite(healthy_frames(20), [3, 4, 8]),
        "not-finite", "--impute-channels 3,4,8",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("made", "name", "repair"), SEVERAL.values(), ids=SEVERAL)
def test_several_faults_of_a_kind_are_one_finding(made, name, repair):
    assert only(made(), name).repair == repair


def test_several_remedies_become_one():
    frames = healthy_frames(23)
    gains = np.ones(208)
    gains[[0, 26, 100]] = 1.5, 0.5, 1.4
    reference = frames.reference_voltage_v * gains
    reference[:, 50] = reference[0, 50]
    report = report_of(changed(frames, reference, frames.voltage_v * gains))
    assert named(report) == [("stuck", "fault"), ("channel-gain", "fault")]
    assert report.repair == "--impute-channels 50,100 --drop-channels 0,26"


def test_a_round_skin_needs_no_scipy():
    program = (
        "import sys; from injected import healthy_frames; from eitskin.skin.skin import"
        " paper_skin\nfrom eitskin.frames.doctor import examine, subject_from_frames\nassert not"
        " examine(subject_from_frames(healthy_frames(1), paper_skin())).findings\nassert 'scipy'"
        " not in sys.modules and 'matplotlib' not in sys.modules"
    )
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path]),
    }
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=60)


@pytest.mark.parametrize(
    ("remedies", "combined"),
    [
        (["--swap 1:2", "--no-flag", "--swap 1:2"], "--swap 1:2 --no-flag"),
        (
            ["--drop-channels 5,3", "--impute-channels 3,4"],
            "--impute-channels 4 --drop-channels 3,5",
        ),
        (["--impute-channels 0", "--drop-channels 26"], "--drop-channels 0,26"),
        (["--impute-channels 0", "--impute-channels 26"], "--drop-channels 0,26"),
        (
            ["--drop-electrodes 0", "--impute-channels 0,50", "--drop-channels 1,40"],
            "--impute-channels 50 --drop-channels 40 --drop-electrodes 0",
        ),
    ],
)
def test_remedies_become_one(remedies, combined):
    """Row 26 is the reciprocal of row 0: neither is filled from the other where both are
    bad, and the rows of an electrode that goes are not named."""
    case = SimpleNamespace(rows=adjacent(16).drive_measure, n_electrodes=16)
    assert combined_remedy(case, remedies) == combined
