"""A taught model after remounting or drying: a few presses adapt it, or it stays as it is; from the
untouched skin alone a model is checked for whether it fits."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.model.eitm import decode_model, encode_model, load_model, save_model
from eitskin.model.model import Model
from eitskin.teaching.kernel import Placement
from eitskin.teaching.known import known_of
from eitskin.teaching.presses import Presses, save_presses, shifted
from eitskin.teaching.still import FITS, TEACH_AGAIN, UPDATE, still_fits
from eitskin.teaching.teach import Taught, solve_presses, teach
from eitskin.teaching.update import FULL, KEPT, MOVED, choice, update
from simulated_presses import RADIUS_MM, SKIN, TRUE, presses

REMOUNTED: dict[str, Any] = {
    "placement": Placement(TRUE.turn_deg + 130, TRUE.scale),
    "shift_mm": (2.0, -3.0),
    "dried": 0.2,
}


@pytest.fixture(scope="module")
def taught() -> Taught:
    return teach(presses(40), SKIN)


@pytest.fixture(scope="module")
def model(taught) -> Model:
    return decode_model(encode_model(taught.model), "taught")


def median_error(model: Model, judged: Presses) -> float:
    return float(np.median(solve_presses(model, judged)[0]))


def test_the_file_knows_what_was_learned(taught, model):
    known, unit = known_of(model, "taught"), taught.learned.unit
    answer = taught.learned.process.mean(model.grid.centres_mm()) * unit
    assert np.abs(known.answer - answer).max() < 2e-3 * np.abs(answer).max()
    noise = taught.learned.noise.covariance * unit * unit[:, None]
    assert np.abs(known.noise - noise).max() < 1e-4 * np.abs(noise).max()
    assert known.presses == 40


@pytest.mark.parametrize("count", [5, pytest.param(12, marks=pytest.mark.long("5 presses"))])
def test_a_remounted_skin_is_found_again(model, count):
    """Turned by 130 degrees, shifted by 3.6 mm, a fifth drier."""
    judged = presses(40, seed=9, **REMOUNTED)
    updated = update(model, presses(count, seed=4, **REMOUNTED))
    assert updated.chosen != KEPT
    assert updated.move.turn_deg % 360 == pytest.approx(130, abs=3)
    new = decode_model(encode_model(updated.model), "updated")
    assert median_error(model, judged) > RADIUS_MM / 2
    assert median_error(new, judged) < 0.025 * RADIUS_MM
    angle = new.skin.electrodes.start_angle_deg - model.skin.electrodes.start_angle_deg + 130
    assert (angle + 180) % 360 - 180 == pytest.approx(0, abs=3)
    middle = updated.move.to_old(np.array([new.skin.outline.centre_mm]), (0.0, 0.0))
    assert np.abs(middle).max() < 0.1
    assert new.force_law is not None
    strength = solve_presses(new, judged)[2]
    depth = new.force_law.forces_at(judged.place_mm, strength)
    assert np.sqrt(np.mean((depth - judged.depth_mm) ** 2)) < 1.0
    assert known_of(new, "updated").presses == 40 + count


def test_a_skin_that_is_as_it_was_keeps_its_model(model):
    updated = update(model, presses(5, seed=4))
    assert updated.chosen == KEPT and updated.model is model


def test_what_is_better_by_chance_is_not_chosen():
    good, bad = np.full(8, 1.0), np.full(8, 9.0)
    luck = np.array([0.5, 3.0] * 4)
    assert choice({KEPT: bad, MOVED: good, FULL: luck}, 0.1) == MOVED
    assert choice({KEPT: good, MOVED: luck, FULL: good * 0.5}, 0.1) == FULL
    assert choice({KEPT: good, MOVED: luck, FULL: luck}, 0.1) == KEPT


@pytest.mark.parametrize(
    ("change", "verdict"),
    [({}, FITS), ({"dried": 0.02}, FITS), ({"dried": 0.2}, UPDATE), ({"dried": 2.0}, TEACH_AGAIN)],
    ids=["own", "a little drier", "drier", "dry"],
)
def test_the_untouched_skin_tells_whether_a_model_fits(model, change, verdict):
    judged = presses(9, seed=9, **change)
    untouched = judged.untouched.copy()
    untouched[3], untouched[5, 2] = judged.pressed[3], np.nan  # a touch and a hole do no harm
    assert still_fits(model, untouched, judged.protocol).verdict == verdict


def test_one_electrode_that_came_off_is_seen(model):
    judged = presses(9, seed=9)
    rows = (judged.protocol.drive_measure == 3).any(axis=1)
    found = still_fits(model, judged.untouched * np.where(rows, 1.1, 1.0), judged.protocol)
    assert found.verdict == UPDATE


def test_check_and_update_at_the_command_line(model, tmp_path, capsys):
    old, new, file = (tmp_path / name for name in ("old.eitm", "new.eitm", "presses.npz"))
    save_model(old, model)
    save_presses(file, presses(5, seed=4, **REMOUNTED))
    assert main(["teach", "check", str(old), str(file)]) == 0
    assert "update (correlation below 0.99); make 5 to 20 presses" in capsys.readouterr().out
    assert main(["teach", "update", str(old), str(file), "-o", str(new)]) == 0
    assert "chosen           moved" in capsys.readouterr().out
    assert load_model(new)[0].meta["teach"]["update"]["presses"] == 5
    assert main(["teach", "check", str(new), str(file)]) == 0
    assert "fits" in capsys.readouterr().out


def test_mirrored_and_strange_presses_are_told(model):
    some = presses(12, seed=4)
    pressed = some.pressed.copy()
    pressed[7] += some.difference[2]
    odd = replace(some, pressed=pressed, place_mm=some.place_mm * (1, -1))
    updated = update(model, odd)
    notes = " ".join(updated.report["notes"])
    assert updated.move.mirrored and "the new places are mirrored" in notes
    assert "wrong place); leave them out or record them again: 7" in notes
    judged = presses(40, seed=9)
    judged = replace(judged, place_mm=judged.place_mm * (1, -1))
    assert median_error(updated.model, judged) < 0.03 * RADIUS_MM < median_error(model, judged)


@pytest.mark.parametrize(
    ("by", "note"),
    [
        pytest.param(2, "2 more came first", marks=pytest.mark.long("the first was missed")),
        (-1, "the first was missed"),
    ],
)
def test_places_shifted_by_some_presses_are_put_right(model, by, note):
    updated = update(model, shifted(presses(12, seed=4, **REMOUNTED), by))
    assert updated.move.turn_deg % 360 == pytest.approx(130, abs=3)
    assert any(note in one for one in updated.report["notes"])
    assert median_error(updated.model, presses(40, seed=9, **REMOUNTED)) < 0.03 * RADIUS_MM
