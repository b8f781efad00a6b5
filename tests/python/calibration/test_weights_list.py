"""Lists of weights: what is read, and the line that each mistake gets."""

from pathlib import Path

import pytest

from eitskin.calibration.weights import Weight, load_weights
from eitskin.errors import ConfigError, FileError


def written(tmp_path: Path, text: str, name: str = "w.csv") -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_csv_and_toml_say_the_same(tmp_path):
    table = written(tmp_path, "first, last, weight_g, x_mm, y_mm\n0,3,100,1.5,-2\n\n4,,200,,\n")
    first = "[[press]]\nfirst = 0\nlast = 3\nforce_n = 0.980665\nx_mm = 1.5\ny_mm = -2\n"
    tables = written(tmp_path, first + "[[press]]\nfirst = 4\nweight_g = 200\n", "w.toml")
    one, other = load_weights(table), load_weights(tables)
    first, second = Weight(0, 3, pytest.approx(0.980665), (1.5, -2.0)), pytest.approx(1.96133)
    assert one == other == [first, Weight(4, 4, second, None)]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "lists no weight; give the frames and the force of each"),
        ("first,weight_g\n", "lists no weight"),
        ("first,weight_kg\n0,1\n",
         "its first line: unknown key 'weight_kg'; did you mean 'weight_g'?"),
        ("first,weight_g\n0\n", "row 1 below the header: 1 cells under 2 names; give as many"),
        ("first,weight_g\n0,many\n",
         "row 1 below the header: weight_g must be a number, not 'many'"),
        ("first,weight_g\n0,nan\n", "weight_g = nan is out of range"),
        ("first,weight_g\n0,0\n", "weight_g = 0.0 is out of range; it must be above 0"),
        ("first,weight_g\n0,\n",
         "give the force either as weight_g (grams) or as force_n (newtons)"),
        ("first,weight_g,force_n\n0,1,1\n", "give the force either"),
        ("first,weight_g,x_mm\n0,1,1\n", "a place needs x_mm and y_mm; give both or none"),
        ("first,weight_g\n-1,5\n", "first = -1.0 is out of range"),
        ("first,last,weight_g\n5,4,5\n", "last = 4.0 is out of range; it must be at least 5"),
        ("weight_g\n5\n", "the key 'first' is required"),
        ("first,weight_g\n0.5,5\n", "first = 0.5 must be a whole number"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_in_a_line(tmp_path, text, line):
    with pytest.raises(ConfigError) as caught:
        load_weights(written(tmp_path, text))
    said = str(caught.value)
    assert line in said and said.startswith(str(tmp_path)) and "\n" not in said


def test_toml_of_another_form(tmp_path):
    with pytest.raises(ConfigError, match=r"press must be tables; write \[\[press\]\]"):
        load_weights(written(tmp_path, "press = 3\n", "w.toml"))
    with pytest.raises(ConfigError, match="unknown key 'presses'"):
        load_weights(written(tmp_path, "[[presses]]\nfirst = 1\n", "w.toml"))


def test_no_file_and_no_text(tmp_path):
    with pytest.raises(FileError):
        load_weights(tmp_path / "none.csv")
    (tmp_path / "w.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not UTF-8 text"):
        load_weights(tmp_path / "w.csv")
