"""The experiment ``homogeneous``: the fold, the measures, the influence of each effect on them, and
the doctor's findings."""

from pathlib import Path

import numpy as np
import pytest

from eitskin.errors import FileError, FrameError
from eitskin.frames.homogeneous import homogeneous as predicted
from eitskin.skin.protocol import Protocol, adjacent, opposite, table
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments import homogeneous
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.homogeneous.cases import IDEAL, INSTRUMENT
from eitskin_studies.experiments.homogeneous.measured import FILE, load_tank
from eitskin_studies.experiments.homogeneous.uniformity import (
    deviations_percent,
    fold_for,
    uniformity,
)
from study_pages import fills_its_page, goes_on, workspace

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")

PROTOCOL = adjacent(16)
ROWS = PROTOCOL.drive_measure.astype(np.int64)
EVEN_V = predicted(paper_skin(), 16).voltages(ROWS, 1e-3)


def small(folder: Path) -> ExperimentOutcome:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(homogeneous, "SIMULATED_ELEMENTS", 2500)
        return homogeneous.run(workspace(folder, 0.1, seed=3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("homogeneous")


@pytest.fixture(scope="module")
def outcome(folder) -> ExperimentOutcome:
    return small(folder)


def spread(outcome: ExperimentOutcome, name: str, measure: str = "spread") -> float:
    case = next(one for one in outcome.data["cases"] if one["name"] == name)
    return float(np.mean([one[measure] for one in case["uniformity_percent"]]))


def test_an_even_disk_is_a_u_for_each_drive():
    folded = fold_for(PROTOCOL).of(EVEN_V)
    assert folded.shape == (16, 13)
    assert folded == pytest.approx(np.tile(folded[0], (16, 1)), rel=1e-9)
    size = np.abs(folded[0])
    assert (np.diff(size[:7]) < 0).all() and size == pytest.approx(size[::-1], rel=1e-9)
    even = uniformity(EVEN_V, PROTOCOL, fold_for(PROTOCOL))
    assert all(value < 1e-6 for value in vars(even).values())


def test_the_fold_does_not_mind_order_and_polarity():
    generator = np.random.default_rng(2)
    order, turned = generator.permutation(208), ROWS.copy()
    turned[::3] = turned[::3][:, [0, 1, 3, 2]]
    turned[::2] = turned[::2][:, [1, 0, 2, 3]]
    sign = np.where(np.arange(208) % 3 == 0, -1, 1) * np.where(np.arange(208) % 2 == 0, -1, 1)
    other = table(16, turned[order])
    uneven = EVEN_V * generator.uniform(0.9, 1.1, 208)
    assert (fold_for(other).of((sign * uneven)[order]) == fold_for(PROTOCOL).of(uneven)).all()
    one = uniformity((sign * uneven)[order], other, fold_for(other))
    assert vars(one) == pytest.approx(vars(uniformity(uneven, PROTOCOL, fold_for(PROTOCOL))))


def test_measures_see_what_they_are_for():
    fold = fold_for(PROTOCOL)
    one = EVEN_V.copy()
    one[fold.row[5, 6]] *= 1.16
    found = uniformity(one, PROTOCOL, fold)
    # one of 16 larger by 16 %: a standard deviation of 16 sqrt(15) / 16 of a mean that is larger by
    # 1 %
    assert found.worst == pytest.approx(16 * np.sqrt(15) / 16 / 1.01)
    assert found.spread == pytest.approx(found.worst / 13) and found.reciprocity > 0
    shown = deviations_percent(fold.of(one))
    assert np.unravel_index(np.argmax(shown), shown.shape) == (5, 6)
    assert shown[5, 6] == pytest.approx(100 * (1.16 / 1.01 - 1))
    both = one.copy()
    pairs = PROTOCOL.reciprocal_pairs()
    k = int(np.flatnonzero((pairs.first == fold.row[5, 6]) | (pairs.second == fold.row[5, 6]))[0])
    both[pairs.first[k]] = pairs.sign[k] * both[pairs.second[k]]
    assert uniformity(both, PROTOCOL, fold).reciprocity < 1e-6


@pytest.mark.parametrize(
    ("protocol", "match"),
    [
        (opposite(16), r"row 0 \(from 0\) has the pair \[0, 8\]"),
        (
            Protocol(16, ROWS[:-1].astype(np.uint8)),
            "207 rows are not one for each of 16 adjacent drives",
        ),
        (Protocol(16, ROWS[[0, *range(207)]].astype(np.uint8)), "208 rows are not one for each"),
    ],
)
def test_scans_that_cannot_be_folded(protocol, match):
    with pytest.raises(FrameError, match=match):
        fold_for(protocol)


def test_each_effect_moves_what_physics_says(outcome):
    usual = spread(outcome, INSTRUMENT)
    assert usual < 1.0
    half, one, two = (
        spread(outcome, f"electrodes up to {s:g} mm off their places") for s in (0.5, 1, 2)
    )
    assert one == pytest.approx(2 * half, rel=0.2) and two == pytest.approx(2 * one, rel=0.2)
    assert half > usual
    # places and the sheet keep reciprocity, gains and the common mode do not
    for name in (
        "electrodes up to 2 mm off their places",
        "gel uneven by 20 % (sd)",
        "an electrode off",
    ):
        assert spread(outcome, name, "reciprocity") < 0.1, name
    gains = [spread(outcome, f"channel gains ±{s} %", "reciprocity") for s in (1, 5)]
    assert gains[1] == pytest.approx(5 * gains[0], rel=0.1) and gains[0] > 0.3
    assert spread(outcome, "common-mode rejection of 40 dB", "reciprocity") > 1
    assert spread(outcome, "contacts ±95 %") < 1.5


def test_the_doctor_names_what_is_broken(outcome):
    found = {one["name"]: one["findings"] for one in outcome.data["cases"]}
    for name, diagnostic in (
        ("an electrode off", "dead-electrode"),
        ("two neighbours bridged by 10 ohm", "shorted-electrodes"),
        ("wires of two neighbours exchanged", "swapped-electrodes"),
    ):
        assert all([diagnostic, "fault"] in session for session in found[name]), name
    assert found[INSTRUMENT] == [[], []] and found[IDEAL] == [[]]


def test_what_is_kept_is_not_computed_again(folder, outcome):
    goes_on(lambda: small(folder), outcome)


def test_without_a_tank_the_page_says_so(outcome):
    assert "left out" in outcome.words["measured"] and FILE in outcome.words["measured"]
    assert all(one["name"] != homogeneous.MEASURED_TANK for one in outcome.data["cases"])


def test_a_file_that_is_no_tank(tmp_path):
    assert load_tank(None) is None and load_tank(tmp_path) is None
    (tmp_path / FILE).write_bytes(b"no archive")
    with pytest.raises(FileError, match="these are not the tank's frames"):
        load_tank(tmp_path)
    np.savez(tmp_path / FILE, voltage=np.zeros((2, 208)))
    with pytest.raises(FileError, match="drive_measure"):
        load_tank(tmp_path)


def test_the_measured_tank(shared_data):
    tank = load_tank(shared_data)
    assert tank is not None
    reference = tank.frames.reference_voltage_v.mean(axis=0)
    found = uniformity(reference, tank.frames.protocol, fold_for(tank.frames.protocol))
    assert 3 < found.spread < 7
    assert found.reciprocity == pytest.approx(5.3, abs=0.1)  # as docs/guide/tank.md says


def test_pictures_and_page(outcome, tmp_path):
    fills_its_page(outcome, "homogeneous", tmp_path)
