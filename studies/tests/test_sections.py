"""Pages that commands fill between marks, with the part of each table that ``pages.toml`` names."""

from pathlib import Path

import pytest

from eitskin.errors import ConfigError
from eitskin_studies.harness import sections
from eitskin_studies.harness.sections import fill_marks, text_table

TABLE = (
    ("what", "method", "value (95 %)"),
    (("a", "one", ".5 (.4 to .6)"), ("b", "one", "2 [1, 3]"), ("c", "two", "-")),
)
BARE = "text\n<!-- t -->\nold\n<!-- end t -->\n<!-- words -->\n<!-- end words -->\nend\n"
PARTS = """
[some.t]
columns = ["value (95 %)", "what"]
rows.method = ["one"]
without.what = ["a"]
intervals = false

[some.left]
page = false

[said.words]
text = "{t|a|value (95 %)} of {t|b, one|value (95 %)}, {t|d|what}"

[unclear.words]
text = "{t|a|value (95 %)}"

[bad.t]
columns = ["valve (95 %)"]
"""


@pytest.fixture
def page(tmp_path, monkeypatch) -> Path:
    (tmp_path / "pages.toml").write_text(PARTS)
    monkeypatch.setattr(sections, "PARTS", tmp_path / "pages.toml")
    (tmp_path / "page.md").write_text(BARE)
    return tmp_path / "page.md"


def test_a_page_shows_its_part_of_a_table(page):
    fill_marks(page, "some", ({"words": "so \\1"}, {"t": TABLE, "left": TABLE}))
    shown = "| value (95 %) | what |\n|---|---|\n| 2 | b |"
    words = "<!-- words -->\nso \\1\n<!-- end words -->"
    assert page.read_text() == f"text\n<!-- t -->\n{shown}\n<!-- end t -->\n{words}\nend\n"
    fill_marks(page, "other", ({}, {"t": TABLE}))
    assert page.read_text().count("| one |") == 2
    assert "| a | one | .5 (.4 to .6) |" in page.read_text()


def test_a_sentence_takes_cells(page):
    fill_marks(page, "said", ({}, {"t": TABLE}))
    assert "<!-- words -->\n.5 of 2, (not measured)\n" in page.read_text()
    fill_marks(page, "said", ({}, {}))  # a part of the page's tables: the sentence stays
    with pytest.raises(ConfigError, match="2 rows begin with 'a'"):
        fill_marks(page, "unclear", ({}, {"t": (TABLE[0], TABLE[1] * 2)}))


def test_what_is_not_there_is_named_and_nothing_is_written(page):
    with pytest.raises(ConfigError, match="has no marks <!-- left -->"):
        fill_marks(page, "other", ({}, {"t": TABLE, "left": TABLE}))
    with pytest.raises(
        ConfigError, match=r"bad.t: no column 'valve \(95 %\)'; did you mean 'value"
    ):
        fill_marks(page, "bad", ({}, {"t": TABLE}))
    assert page.read_text() == BARE


def test_prose_is_wrapped_and_code_is_not(page):
    text = f"- {'word ' * 18}`a command of several words`.\n- next"
    fill_marks(page, "some", ({"words": text}, {}))
    lines = page.read_text().split("<!-- words -->\n")[1].splitlines()
    assert lines[:3] == [f"- {'word ' * 18}".strip(), "  `a command of several words`.", "- next"]


def test_a_table_for_a_terminal():
    assert text_table(("a", "bb"), [("ccc", "d")]) == "a    bb\nccc   d"
