"""Checks that the tests of all experiments make of runs and pages."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from eitskin.config import load_toml
from eitskin.fem.cem import ForwardModel
from eitskin.progress import silent
from eitskin_studies.experiments.experiment import (
    ExperimentOutcome,
    ExperimentSettings,
    Workspace,
    workspace_in,
)
from eitskin_studies.experiments.write import to_json, write_page
from eitskin_studies.harness.sections import PARTS
from eitskin_studies.harness.sessions import SceneSolver
from eitskin_studies.harness.store import Store

PAGES = Path(__file__).resolve().parents[1] / "results"


def workspace(folder: Path, share: float = 1.0, **settings: object) -> Workspace:
    return workspace_in(folder, ExperimentSettings(share=share, **settings), silent)


def coarse(folder: Path, share: float, elements: int = 2500, seed: int = 1) -> Workspace:
    """For few scenes, solved on a mesh of few elements."""
    made = workspace(folder, share, seed=seed)
    made.scenes = lambda skin, scan, _=0: SceneSolver(skin, scan, elements, folder / "frames")
    return made


def page_copy(folder: Path, name: str) -> Path:
    """Return a copy of a page of the results, in ``folder``."""
    copy = folder / f"{name}.md"
    copy.write_bytes((PAGES / copy.name).read_bytes())
    return copy


def goes_on(
    run: Callable[[], ExperimentOutcome], first: ExperimentOutcome, solves: bool = False
) -> None:
    """A second run in the same folder computes, keeps and solves nothing, and returns the same
    results. With ``solves``, it may solve for its model."""
    with pytest.MonkeyPatch.context() as patch:
        for owner, name in ((Store, "put"), (ForwardModel, "solve"))[: 1 if solves else 2]:
            patch.setattr(owner, name, lambda *_, **__: pytest.fail("computed again"))
        again = run()
    assert again.tables == first.tables and again.words == first.words
    assert to_json(again) == to_json(first)


def fills_its_page(
    outcome: ExperimentOutcome, name: str, folder: Path, but: tuple[str, ...] = ()
) -> str:
    """Check that tables are complete and that pictures are drawn, except those in ``but``. A copy
    of the page is filled with the outcome: every mark must be filled, and every picture shown.
    Returns the text of the page."""
    for table in outcome.tables:
        assert table.rows and all(len(row) == len(table.head) for row in table.rows)
    for picture in outcome.pictures.keys() - set(but):
        outcome.pictures[picture](folder / picture)
        assert (folder / picture).read_bytes().startswith((b"\x89PNG", b"<?xml"))
    page, settings = page_copy(folder, name), ExperimentSettings(share=0.01)
    write_page(outcome, folder, page, name, settings)
    text = page.read_text(encoding="utf-8")
    tables = {table.name for table in outcome.tables}
    parts = load_toml(PARTS, "list").get(name, {})
    said = {mark for mark, part in parts.items() if "text" in part}
    assert parts.keys() - said <= tables
    marks = set(re.findall("<!-- end (.*) -->", text))
    assert said <= marks <= {"command", *outcome.words, *tables, *said}
    assert (
        f"`eitskin study {name} -o out/{name} --share 0.01 --page studies/results/{name}.md`"
        in text
    )
    assert all(f"pictures/{name}/{picture}" in text for picture in outcome.pictures)
    return text
