"""The study of other worlds: every set is scored, the worst first, and a run goes on where it
was."""

from functools import partial
from pathlib import Path

import pytest
from study_pages import fills_its_page, goes_on

from eitskin_studies.experiments import other_worlds
from eitskin_studies.experiments.experiment import (
    ExperimentOutcome,
    ExperimentSettings,
    plain,
    workspace_in,
)
from eitskin_studies.experiments.other_worlds.tables import HEADLINES
from eitskin_studies.experiments.registry import load
from eitskin_studies.worlds.simulate import WorldFactory
from eitskin_studies.worlds.worlds import WORLDS


def _run(folder: Path) -> ExperimentOutcome:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(other_worlds, "WorldFactory", partial(WorldFactory, elements=2000))
        return other_worlds.run(workspace_in(folder, ExperimentSettings(share=0.01), plain))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ExperimentOutcome]:
    folder = tmp_path_factory.mktemp("worlds")
    return folder, _run(folder)


def test_every_set_is_scored_and_the_worst_come_first(done: tuple[Path, ExperimentOutcome]) -> None:
    assert load("other-worlds") is other_worlds
    outcome = done[1]
    assert [one["name"] for one in outcome.data["scores"]] == list(WORLDS)
    fails, holds, headline = outcome.tables
    shares = [float(row[1].split(" %")[0]) for row in fails.rows]
    assert shares == sorted(shares) and max(shares) < 90
    assert len(fails.rows) + len(holds.rows) == len(WORLDS)
    assert [row[0] for row in headline.rows] == [what for what, *_ in HEADLINES]
    assert outcome.words["summary"].startswith(f"In {len(fails.rows)} of {len(WORLDS)} sets")


def test_a_finished_run_is_read_again_and_fills_its_page(
    done: tuple[Path, ExperimentOutcome], tmp_path: Path
) -> None:
    folder, outcome = done
    goes_on(lambda: _run(folder), outcome)
    page = fills_its_page(outcome, "other-worlds", tmp_path)
    assert page.index("## What fails") < page.index("## What holds")
