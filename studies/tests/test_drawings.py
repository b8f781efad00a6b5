"""Pictures are drawn again from the numbers that are stored with them."""

import json

import pytest

from eitskin.cli.main import main
from eitskin.errors import ConfigError, FileError
from eitskin_studies.harness.drawings import Drawing, draw_again, file_of, keep_drawings
from eitskin_studies.pictures.worlds_pictures import draw_shares
from test_stored_numbers import RESULTS

SHARES = [
    {"name": "fingers", "exact": [0.9, 0.8, 0.95], "false_per_scene": 0.1},
    {"name": "drift_2_percent_light", "exact": (0.7, 0.6, 0.8), "false_per_scene": 0.0},
]


def test_a_picture_is_drawn_again_from_its_numbers(tmp_path):
    page, drawing = tmp_path / "some.md", Drawing(draw_shares, SHARES)
    drawing(tmp_path / "first.svg")
    keep_drawings(page, {"pictures/some/shares.svg": drawing})
    (again,) = draw_again(page)
    assert again == tmp_path / "pictures" / "some" / "shares.svg"
    assert again.read_bytes() == (tmp_path / "first.svg").read_bytes()


def test_what_cannot_be_drawn_again_is_refused(tmp_path):
    page = tmp_path / "some.md"
    with pytest.raises(FileError, match="the study stores it"):
        draw_again(page)
    keep_drawings(page, {"shares.svg": Drawing(draw_shares, SHARES)})
    text = file_of(page).read_text()
    file_of(page).write_text(text.replace("draw_shares", "draw_none"))
    with pytest.raises(ConfigError, match="draw_none draws nothing any more"):
        draw_again(page)
    file_of(page).write_text("{}")
    with pytest.raises(ConfigError, match="run its study"):
        draw_again(page)
    assert main(["draw", "page", "nowhere"]) != 0


@pytest.mark.parametrize(
    "path", sorted((RESULTS / "numbers" / "pictures").glob("*.json")), ids=lambda one: one.stem
)
def test_the_stored_pictures_exist_and_their_pages_show_them(path):
    page = RESULTS / f"{path.stem}.md"
    text = page.read_text(encoding="utf-8")
    for file, one in json.loads(path.read_text(encoding="utf-8"))["pictures"].items():
        assert (RESULTS / file).is_file() and f"({file})" in text
        assert not one["commit"].endswith("-dirty")
