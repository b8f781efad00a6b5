"""The study of belief: confidence, places and counts of every set, and numbers by hand."""

from functools import partial
from typing import Any, ClassVar

import pytest

from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments import belief
from eitskin_studies.experiments.belief.tables import counts, coverage, curve
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.registry import load
from eitskin_studies.worlds.simulate import WorldFactory
from eitskin_studies.worlds.worlds import WORLDS
from study_pages import fills_its_page, goes_on, workspace

FRAMES: list[dict[str, Any]] = [
    {"true": 1, "crowded": False, "touches": [[True, 0.999, 0.5, 1.0]]},
    {"true": 1, "crowded": True, "touches": [[True, 0.97, 3.0, 9.0], [False, 0.6, None, None]]},
    {"true": 2, "crowded": False, "touches": [[True, None, 1.0, None]]},
    {"true": 0, "crowded": True, "touches": []},
]


def test_numbers_by_hand():
    covered, counted = coverage(FRAMES), counts(FRAMES)
    assert (covered.hits, covered.count) == (1, 2)
    reported = [(b.said, b.true.hits, b.true.count) for b in curve({"a": FRAMES})]
    assert reported == [(0.6, 0, 1), (0.97, 1, 1), (0.999, 1, 1)]
    found = counted.right, counted.said_right, counted.said_wrong, counted.honest
    assert [(one.hits, one.count) for one in found] == [(2, 4), (1, 2), (1, 2), (3, 4)]


def test_every_set_is_seen_and_a_finished_run_fills_its_page(tmp_path):
    assert load("belief") is belief

    def run() -> ExperimentOutcome:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(belief, "WorldFactory", partial(WorldFactory, elements=2000))
            return belief.run(workspace(tmp_path / "run", 0.01))

    outcome = run()
    assert list(outcome.data["sets"]) == list(WORLDS)
    assert len(outcome.tables[2].rows) == len(WORLDS)
    goes_on(run, outcome)
    page = fills_its_page(outcome, "belief", tmp_path)
    assert "expected calibration error" in page


def test_each_set_is_looked_at_with_its_own_sign():
    class Finder:
        diagnostics: tuple[str, ...] = ()
        signs: ClassVar[list[str | None]] = []

        def look_for(self, sign: str | None) -> None:
            self.signs.append(sign)

        def __call__(self, *_: Any) -> tuple[()]:
            return ()

    factory = WorldFactory(paper_skin(), adjacent(16), elements=2000)
    for name in ("insulating_touches", "discs_1_to_3"):
        belief.frames_of(Finder(), factory.scenes(name, 1, 1, family="judging"))
    assert Finder.signs == ["both", None]
