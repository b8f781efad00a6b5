"""Guiding a person through a plan: places, presses that are good and that are not, going on after a
kill, and a whole session before a simulated board."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.errors import FileError, FrameError
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import adjacent, opposite
from eitskin.skin.skin import Skin
from eitskin.teaching.guide import GuideEvent, PressGuide, Step, guide_presses
from eitskin.teaching.plan import PressPlan, load_plan, plan_places, save_plan
from eitskin.teaching.press_file import PressFile
from eitskin.teaching.presses import load_presses
from small_models import EIGHT_OPPOSITE_TOML

ROWS = opposite(8)


def plan_of(count: int) -> PressPlan:
    place = np.column_stack([np.arange(count) * 10.0, np.zeros(count)])
    return PressPlan(place, np.full(count, np.nan), np.full(count, np.nan))


class Finger:
    """Frames of a skin at 1 V a row with noise of 1 mV, and presses of 50 mV along a pattern of
    their own."""

    def __init__(self) -> None:
        self.draw = np.random.default_rng(3)
        self.frames: list[np.ndarray] = []
        self.pattern = self.draw.normal(size=(9, ROWS.n_rows))

    def add(self, count: int, strength: np.ndarray | float = 0.0, pattern: int = 0) -> Finger:
        change = 0.05 * np.broadcast_to(strength, count)[:, None] * self.pattern[pattern]
        self.frames += list(1 + change + 1e-3 * self.draw.normal(size=change.shape))
        return self

    def good(self, pattern: int = 0) -> Finger:
        return self.add(20).add(25, 1.0, pattern)

    def guided(self, path: Path, count: int) -> tuple[PressFile, list[GuideEvent]]:
        said: list[GuideEvent] = []
        file = PressFile(path, plan_of(count), ROWS, "")
        guide = PressGuide(plan_of(count), start=file.following)
        timed = ((frame, 0.02 * k) for k, frame in enumerate(self.frames))
        guide_presses(timed, guide, file, said.append)
        return file, said


def test_good_presses_are_taken_with_the_frame_before(tmp_path):
    finger = Finger().good(0).good(1).good(2).add(20)
    _, said = finger.guided(tmp_path / "p.npz", 3)
    presses = load_presses(tmp_path / "p.npz")
    steps = [Step.REST, Step.PRESS, Step.HOLD, Step.LIFT, Step.REST]
    assert [event.step for event in said[:5]] == steps
    assert said[-1].step is Step.DONE
    assert np.array_equal(presses.place_mm, plan_of(3).place_mm)
    assert np.abs(presses.difference - 0.05 * finger.pattern[:3]).max() < 2e-3
    assert np.abs(presses.untouched - 1).max() < 2e-3


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (lambda f: f.add(9, 1.0), "released too early"),
        (lambda f: f.add(25, np.linspace(0.6, 1.6, 25)), "was not held"),
        (lambda f: f.add(13, 1.0, 0).add(12, 1.0, 5), "moved or slipped"),
    ],
    ids=["short", "sinking", "slipping"],
)
def test_a_bad_press_is_asked_for_again(bad, why, tmp_path):
    finger = Finger().add(20)
    bad(finger)
    _, said = finger.good(1).add(20).guided(tmp_path / "p.npz", 1)
    rejected = [event.rejected for event in said if event.rejected]
    assert len(rejected) == 1 and why in rejected[0]
    presses = load_presses(tmp_path / "p.npz")
    assert np.abs(presses.difference - 0.05 * finger.pattern[1]).max() < 2e-3


@pytest.mark.parametrize(
    ("early", "said"),
    [
        (lambda f: f.add(5).add(25, 1.0, 5).add(20), "too early"),
        (lambda f: f.add(11).add(25, 1.0, 5).add(20), "too early"),
        (lambda f: f.add(5, 1.0, 5).add(230), "too early"),
        (lambda f: f.add(20, 1.0, 5).add(500), "perhaps lifting was taken for a press"),
    ],
    ids=["before rest", "as rest ends", "lifted before rest", "lifted when told to press"],
)
def test_a_press_before_the_first_is_not_the_first(early, said, tmp_path):
    finger = Finger()
    early(finger)
    _, events = finger.good(0).good(1).add(20).guided(tmp_path / "p.npz", 2)
    assert sum(said in event.text for event in events) == 1 and events[-1].step is Step.DONE
    presses = load_presses(tmp_path / "p.npz")
    assert np.array_equal(presses.place_mm, plan_of(2).place_mm)
    assert np.abs(presses.difference - 0.05 * finger.pattern[:2]).max() < 2e-3


def test_a_killed_session_goes_on_and_can_go_back(tmp_path):
    path = tmp_path / "p.npz"
    first, _ = Finger().good(0).good(1).guided(path, 3)
    with pytest.raises(FileError, match="another process records to it"):
        Finger().guided(path, 3)
    first.close()
    file, said = Finger().good(2).add(20).guided(path, 3)
    assert file.numbers == [0, 1, 2] and said[-1].step is Step.DONE
    assert file.back() == 2 and len(load_presses(path)) == 2
    file.close()
    with pytest.raises(FrameError, match="its places are not this plan's"):
        PressFile(path, plan_of(1), ROWS, "")
    with pytest.raises(FrameError, match="made with another protocol"):
        PressFile(path, plan_of(3), adjacent(8), "")


def test_begun_again_the_old_presses_stay_until_the_first_new_one(tmp_path):
    old, link = tmp_path / "old.npz", tmp_path / "p.npz"
    Finger().good(0).good(1).add(20).guided(old, 2)[0].close()
    link.symlink_to(old)
    file = PressFile(link, plan_of(2), ROWS, "", start_again=True)
    assert file.following == 0 and len(load_presses(old)) == 2
    file.add(1, np.ones(ROWS.n_rows), np.full(ROWS.n_rows, 2.0), 0.5)
    assert link.is_symlink() and np.array_equal(load_presses(old).place_mm, plan_of(2).place_mm[1:])
    assert file.back() == 1 and link.is_symlink() and not old.exists()


def test_presses_that_another_program_wrote_meanwhile_stay(tmp_path):
    path, frame = tmp_path / "p.npz", np.ones(ROWS.n_rows)
    files = [PressFile(path, plan_of(2), ROWS, "") for _ in range(2)]
    files[0].add(0, frame, 2 * frame, 0.0)
    with pytest.raises(FileError, match="another program changed it meanwhile"):
        files[1].add(1, frame, 3 * frame, 0.0)
    files[0].add(1, frame, 2 * frame, 1.0)
    assert np.array_equal(load_presses(path).pressed, [2 * frame, 2 * frame])


def test_places_spread_over_the_skin(tmp_path):
    skin = Skin("disk", disk(100.0), Electrodes(count=8, width_mm=5.0))
    plan = plan_places(skin, opposite(8), 12)
    assert np.linalg.norm(plan.place_mm, axis=1).max() < 46
    apart = np.linalg.norm(plan.place_mm[:, None] - plan.place_mm[None], axis=2)
    assert apart[~np.eye(12, dtype=bool)].min() > 8
    save_plan(tmp_path / "plan.csv", plan)
    assert np.allclose(load_plan(tmp_path / "plan.csv").place_mm, plan.place_mm, atol=0.006)


@pytest.mark.parametrize(
    ("text", "said"),
    [("a,b\n1,2\n", "x_mm,y_mm"), ("x_mm,y_mm\n1,\n", "line 2"), ("x_mm,y_mm\n1,two\n", "two")],
)
def test_a_plan_that_is_none(text, said, tmp_path):
    (tmp_path / "plan.csv").write_text(text)
    with pytest.raises(FrameError, match=said):
        load_plan(tmp_path / "plan.csv")


@pytest.mark.parametrize(
    "kind",
    ["sim", pytest.param("emu", marks=pytest.mark.long("sim, and emulator/test_taught_model.py"))],
)
def test_a_whole_session(kind, tmp_path, capsys, monkeypatch):
    """Plan, practise 20 presses, fit, check, then touch with the taught model, as a person would;
    the board's images are this host's."""
    monkeypatch.chdir(tmp_path)

    def done(command: str) -> str:
        capsys.readouterr()
        assert main(command.split()) == 0
        return capsys.readouterr().out

    Path("skin.toml").write_text(EIGHT_OPPOSITE_TOML)
    done("model build skin.toml --samples 0 -o physics.eitm")
    done("teach plan skin.toml -n 20 -o plan.csv --practice scene.toml --picture template.pdf")
    assert Path("template.pdf").read_bytes()[:5] == b"%PDF-"
    device = f"--device {kind}:scene.toml"
    files = "--plan plan.csv -o presses.npz --skin skin.toml"
    said = done(f"teach record {files} {device} --model physics.eitm")
    assert said.count("good; lift") == 20 and "all places are done" in said
    assert np.allclose(load_presses("presses.npz").place_mm, load_plan("plan.csv").place_mm)
    report = json.loads(done("teach fit presses.npz -o taught.eitm --json"))
    assert report["presses"] == 20 and report["error_mm"]["held_out_median"] < 3
    assert ": fits (" in done(f"teach check taught.eitm {device}")
    done(f"record {device} --model taught.eitm -o run.eits --frames 30")
    facts = json.loads(done("replay run.eits --model taught.eitm --check --json"))
    assert facts["same_bits"] and facts["images"] == facts["touches"] == 30
