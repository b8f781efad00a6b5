"""Numbers on pages come from stored files that commands wrote; the README's come from pages."""

import re
from pathlib import Path

import pytest

from eitskin.cli.main import build_parser
from eitskin.errors import ConfigError, UsageError
from eitskin_studies.experiments.registry import EXPERIMENTS
from eitskin_studies.harness import make_results, numbers, sections
from eitskin_studies.harness.numbers import file_of, keep_numbers, stored_filling
from eitskin_studies.harness.sections import fill_marks, fill_readme

RESULTS = Path(__file__).resolve().parents[1] / "results"
README = RESULTS.parents[1] / "README.md"
STORED = sorted((RESULTS / numbers.FOLDER).glob("*.json"))


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_page_says_what_its_stored_file_says(path, tmp_path):
    page = RESULTS / f"{path.stem}.md"
    copy = tmp_path / page.name
    text = page.read_text(encoding="utf-8")
    copy.write_text(text, encoding="utf-8")
    name, filling = stored_filling(path)
    fill_marks(copy, name, filling)
    done = copy.read_text(encoding="utf-8")
    assert done == text, f"edited by hand; run  studies/run {page.stem}"


def test_the_pages_of_the_first_screen_are_stored():
    linked = set(re.findall(r"\(studies/results/([\w-]+)\.md", README.read_text(encoding="utf-8")))
    assert {"tradeoff", "hard-cases", "other-worlds"} <= linked
    # hard-cases.md is filled from margins.json and compared by its own test; corrections.md quotes
    by_hand = linked - {path.stem for path in STORED} - {"README", "hard-cases", "corrections"}
    assert not by_hand, f"run  studies/run {' '.join(sorted(by_hand))}"


def test_the_readmes_numbers_are_those_of_the_pages(tmp_path):
    copy = tmp_path / "README.md"
    text = README.read_text(encoding="utf-8")
    copy.write_text(text, encoding="utf-8")
    fill_readme(copy, RESULTS)
    assert copy.read_text(encoding="utf-8") == text, "run  studies/run other-worlds"
    copy.write_text(text.replace("<!-- numbers -->", ""), encoding="utf-8")
    with pytest.raises(ConfigError, match="<!-- numbers -->"):
        fill_readme(copy, RESULTS)


def _numbers(text: str) -> set[str]:
    return {f"{float(one):g}" for one in re.findall(r"(?<![\w.])(?:\d*\.\d+|\d+)(?!\w)", text)}


def _rows(title: str) -> list[str]:
    page = (RESULTS / "README.md").read_text(encoding="utf-8")
    lines = page.split(f"## {title}")[1].split("\n## ")[0].splitlines()
    return [line for line in lines if line.startswith("|")][2:]


def test_the_measured_numbers_of_each_aim_are_on_the_pages_that_its_line_links_to():
    linked: set[str] = set()
    for row in _rows("Measured against the aims"):
        # a line without a link uses the pages of the line above
        linked = set(re.findall(r"\]\(([^)#]+\.md)", row)) or linked
        known = set()
        for page in (RESULTS / name for name in linked):
            for path in (page, file_of(page)):  # a page may leave intervals out
                known |= _numbers(path.read_text(encoding="utf-8")) if path.exists() else set()
        assert _numbers(row.strip("|").split("|")[-1]) - known == set(), row


def test_what_the_papers_claims_are_compared_with_is_on_the_pages_that_their_lines_link_to():
    text = (RESULTS / "paper.md").read_text(encoding="utf-8")
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| ")]
    ours = [row[2] for row in rows if len(row) == 4]
    compared = [(one, re.findall(r"\]\((\w+\.md)\)", one)) for one in ours]
    compared = [(one, pages) for one, pages in compared if pages]
    assert len(compared) >= 5
    for one, pages in compared:
        known = set()
        for page in (RESULTS / name for name in pages):
            for path in (page, file_of(page)):
                known |= _numbers(path.read_text(encoding="utf-8"))
        assert _numbers(one) - known == set(), one


def test_the_sentences_to_doubt_have_the_numbers_of_the_pages_they_link_to():
    rows = _rows("Ten sentences to doubt first")
    assert len(rows) == 10
    for row in rows:
        linked = set(re.findall(r"\]\(([^)#]+\.md)", row)) | {"../../README.md"}
        pages = " ".join((RESULTS / name).read_text(encoding="utf-8") for name in linked)
        numbers = re.findall(r"(?<!\w)\.\d{3}\b|\b\d+\.\d\d\b|\b\d+ to \d+\b|\b\d+ %", row)
        assert [one for one in numbers if one not in " ".join(pages.split())] == [], row


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("{other-worlds.imagez|`fingers`|exact (95 %)}", "other-worlds.images"),
        ("{other-worlds.images|`finger`|exact (95 %)}", "0 rows"),
        ("{other-worlds.images|`fingers`|exactly}", "exact"),
    ],
)
def test_a_number_that_no_page_has_is_refused(cell, said, tmp_path, monkeypatch):
    (tmp_path / "pages.toml").write_text(f'[README.numbers]\ntext = "{cell}"\n')
    monkeypatch.setattr(sections, "PARTS", tmp_path / "pages.toml")
    (tmp_path / "README.md").write_text("<!-- numbers -->\n<!-- end numbers -->\n")
    with pytest.raises(ConfigError, match=re.escape(said)):
        fill_readme(tmp_path / "README.md", RESULTS)


def test_numbers_are_kept_mark_by_mark(tmp_path):
    page = tmp_path / "some.md"
    keep_numbers(page, "some", ({"words": "a"}, {"t": (("x",), (("1",),))}))
    keep_numbers(page, "some", ({"words": "b"}, {}))
    assert stored_filling(file_of(page)) == ("some", ({"words": "b"}, {"t": (["x"], [["1"]])}))
    file_of(page).write_text("{}")
    with pytest.raises(ConfigError, match="run its command again"):
        keep_numbers(page, "some", ({}, {}))


def test_every_study_has_a_command_that_exists(monkeypatch, capsys):
    monkeypatch.setenv("TANKS", "tanks")
    monkeypatch.setenv("PRESSES", "presses")
    monkeypatch.chdir(README.parent)  # pages are named from there
    known = make_results.commands()
    assert EXPERIMENTS.keys() <= known.keys()
    for program, *words in known.values():
        if program == "eitskin":
            build_parser(words[0]).parse_args(words)
        else:
            assert Path(program).is_file()
    assert make_results.main(["--list"]) == 0 and "other-worlds" in capsys.readouterr().out
    for wrong in ([], ["other-world"]):
        with pytest.raises(UsageError, match="studies/run"):
            make_results.main(wrong)
    for names in (make_results.ALONE, make_results.AFTER, make_results.AFTER.values()):
        assert set(names) <= known.keys()
    # the commands that fill one page never run at the same time
    for page in {word for words in known.values() for word in words if word.endswith(".md")}:
        fill = {name for name, words in known.items() if page in words} - {*make_results.ALONE}
        assert sum(make_results.AFTER.get(name) not in fill for name in fill) <= 1, page


def test_a_command_that_fails_does_not_stop_the_others(tmp_path, monkeypatch, capsys):
    results = tmp_path / make_results.RESULTS
    results.mkdir(parents=True)
    mark = make_results.TIMES
    table = "| command | processor time, min |\n|---|---|\n| other | 7.0 |\n| last | 1.0 |"
    page = results / "README.md"
    page.write_text(f"<!-- {mark} -->\n{table}\n<!-- end {mark} -->\n")
    (tmp_path / "README.md").write_text("<!-- numbers -->\n<!-- end numbers -->\n")
    log = tmp_path / "order"
    shell = {name: ["sh", "-c", f"echo {name} >> {log}; exit {name == 'bad':d}"]
             for name in ("next", "bad", "last", "slow", "alone")}  # fmt: skip
    monkeypatch.setattr(make_results, "checkout_root", lambda: tmp_path)
    monkeypatch.setattr(make_results, "commands", lambda: shell)
    monkeypatch.setattr(make_results, "fill_readme", lambda *_: None)
    monkeypatch.setattr(make_results, "DATA", {})
    monkeypatch.setattr(make_results, "ALONE", ("alone",))
    monkeypatch.setattr(make_results, "AFTER", {"next": "slow"})
    assert make_results.main(["--all"]) == 1
    assert "failed: bad" in capsys.readouterr().out
    ran = log.read_text().split()
    assert ran[-2:] == ["last", "alone"] and ran.index("next") == ran.index("slow") + 1
    times = make_results._known_times(page)
    assert times["other"] == "7.0" and times["slow"] == "0.0" and "bad" not in times
