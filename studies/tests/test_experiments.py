"""Common to all experiments: their names and pages, the command, the files that they
leave."""

import json
from collections.abc import Mapping
from typing import Any

import pytest

from eitskin.cli.main import main
from eitskin.errors import ConfigError, UsageError
from eitskin_studies.experiments import registry
from eitskin_studies.experiments.experiment import (
    ExperimentOutcome,
    ExperimentSettings,
    Table,
    Workspace,
)
from eitskin_studies.experiments.write import to_json, write_all, write_page
from study_pages import PAGES, workspace


class Small:
    """An experiment of one number, which counts how often it is computed."""

    TITLE = "small"

    def __init__(self) -> None:
        self.computed = 0

    def run(self, workspace: Workspace) -> ExperimentOutcome:
        def make() -> Mapping[str, Any]:
            self.computed += 1
            return {"mean": 0.5, "none": float("nan")}

        values = workspace.kept({"part": "small"}, make)
        table = Table("small", ("what", "value"), (("mean", f"{values['mean']:g}"),))
        pictures = {"small.png": lambda path: path.write_bytes(b"png")}
        return ExperimentOutcome((table,), values, pictures, {"said": "so"})


@pytest.fixture
def small(monkeypatch) -> Small:
    one = Small()
    monkeypatch.setitem(registry.EXPERIMENTS, "small", "one number")
    monkeypatch.setattr(registry, "load", lambda _: one)
    return one


@pytest.mark.parametrize("name", registry.EXPERIMENTS)
def test_each_has_a_title_and_a_page_that_its_command_fills(name):
    experiment = registry.load(name)
    assert experiment.TITLE and callable(experiment.run)
    page = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    assert f"`eitskin study {name} -o out/{name}" in page
    assert "<!-- command -->\n<!-- end command -->" not in page
    assert f"]({name}.md)" in (PAGES / "README.md").read_text(encoding="utf-8")


def test_the_command_lists_runs_and_goes_on(small, tmp_path, capsys):
    assert main(["study", "list"]) == 0
    assert "small        one number" in capsys.readouterr().out
    page = tmp_path / "small.md"
    marks = (f"<!-- {m} -->\nold\n<!-- end {m} -->\n" for m in ("command", "small", "said"))
    page.write_text("".join(marks))
    out = str(tmp_path / "out")
    for _ in range(2):
        assert main(["study", "small", "-o", out, "--seed", "3", "--page", str(page)]) == 0
        assert "mean    0.5" in capsys.readouterr().out
    assert small.computed == 1
    assert main(["study", "small", "-o", out, "--seed", "4", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"mean": 0.5, "none": None}
    assert small.computed == 2
    text = page.read_text(encoding="utf-8")
    assert "| mean | 0.5 |" in text and "old" not in text
    assert "--seed 3 --page studies/results/small.md" in text
    assert (tmp_path / "pictures" / "small" / "small.png").read_bytes() == b"png"
    assert (tmp_path / "out" / "small.csv").read_text(encoding="utf-8") == "what,value\nmean,0.5\n"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nothing"], "no experiment is named 'nothing'"),
        (["levres"], "did you mean 'levers'?"),
        (["levers", "--share", "0"], "--share 0 is out of range"),
        (["levers", "--seed", "-1"], "--seed -1 must be 0 or above"),
        (["levers", "-o", "FILE"], "this is a file; name a folder"),
        (["levers", "--page", "no/such/page.md"], "no such page"),
        (["tank", "--data", "no/such"], "no such folder"),
    ],
)
def test_what_cannot_be_is_refused_on_one_line(arguments, text, tmp_path, capsys):
    file = tmp_path / "file"
    file.write_bytes(b"")
    assert main(["study", *(str(file) if one == "FILE" else one for one in arguments)]) != 0
    out, err = capsys.readouterr()
    assert out == "" and text in err and err.count("\n") == 1


def test_a_page_without_its_marks_stays_as_it_is(tmp_path):
    outcome = Small().run(workspace(tmp_path / "out"))
    write_all(outcome, tmp_path / "out", pictures=False)
    page = tmp_path / "small.md"
    page.write_text("<!-- small -->\nold\n<!-- end small -->\n")
    with pytest.raises(ConfigError, match="has no marks <!-- said -->"):
        write_page(outcome, tmp_path / "out", page, "small", ExperimentSettings())
    assert "old" in page.read_text(encoding="utf-8") and "NaN" not in to_json(outcome)
    assert not (tmp_path / "out" / "small.png").exists()


def test_a_torn_line_is_computed_again(tmp_path):
    one = Small()
    one.run(workspace(tmp_path))
    kept = tmp_path / "results.jsonl"
    kept.write_bytes(kept.read_bytes()[:-9])
    for _ in range(2):
        one.run(workspace(tmp_path))
        assert one.computed == 2


def test_sets_to_choose_on_are_not_those_that_are_reported():
    settings = ExperimentSettings(seed=7, share=0.1)
    assert settings.tuning_seed != settings.seed
    assert (settings.count(40), settings.count(3)) == (4, 2)
    with pytest.raises(UsageError):
        ExperimentSettings(share=101)
