"""``eitskin compare`` from its arguments to its files."""

import argparse
import json

import pytest

from eitskin.errors import ConfigError, FileError, UsageError
from eitskin_studies.cli import cmd_compare

FEW = ["--scenes", "3", "--train", "2", "--seed", "4"]


def run(*arguments: str) -> int:
    parser = argparse.ArgumentParser()
    cmd_compare.add_parser(parser.add_subparsers())
    options = parser.parse_args(["compare", *arguments])
    return int(options.run(options))


@pytest.mark.long("test_compare.py")
def test_table_files_and_pictures(tmp_path, capsys):
    files = [tmp_path / name for name in ("scenes.png", "curves.png", "numbers.csv")]
    drawn = ["--picture", str(files[0]), "--curves", str(files[1]), "--csv", str(files[2])]
    status = run(*FEW, *drawn, "--snr-db", "50", "--lookup", "nearest")
    shown = capsys.readouterr()
    assert status == 0 and shown.err == ""
    assert "test-s4-n3 (seed 4)" in shown.out and "50 dB" in shown.out and "nearest" in shown.out
    rows = shown.out.rstrip().splitlines()
    assert sum(" | " in row for row in rows) >= 9
    assert all(file.stat().st_size > 1000 for file in files)
    assert files[0].read_bytes()[1:4] == files[1].read_bytes()[1:4] == b"PNG"


@pytest.mark.long("test_compare.py")
def test_json_has_every_method_and_only_json(capsys):
    assert run(*FEW, "--json", "--lookup", "bilinear") == 0
    values = json.loads(capsys.readouterr().out)
    assert values["settings"]["lookup"] == "bilinear"
    names = {method["name"] for method in values["methods"]}
    assert {"NOSER", "plain FISTA 300, non-negative"} <= names
    assert all(0.4 < method["miou"]["mean"] < 1 for method in values["methods"])


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        (["--scenes", "0"], UsageError, "at least 1 scene"),
        (["--snr-db", "nan"], UsageError, "--snr-db"),
        (["--seed", "-1"], UsageError, "--seed"),
        (["--csv", "/nowhere/at/all.csv"], FileError, "make it first"),
        (["--skin", "nowhere.toml"], FileError, "nowhere.toml"),
        (["--give", "frames.csv"], UsageError, "ends with"),
        (["--give", "frames.mat", "--images", "mine.mat"], UsageError, "a later run"),
    ],
)
def test_bad_arguments_are_refused_before_the_work(arguments, error, text, capsys):
    with pytest.raises(error, match=text) as caught:
        run(*arguments)
    assert "\n" not in str(caught.value)
    assert capsys.readouterr().out == ""


@pytest.mark.long("test_compare.py")
def test_own_skin(tmp_path, capsys):
    skin = tmp_path / "skin.toml"
    skin.write_text(
        '[skin]\nname = "square"\npolygon_mm = [[0, 0], [150, 0], [150, 150], [0, 150]]\n'
    )
    assert run(*FEW, "--skin", str(skin)) == 0
    assert "square, 16 electrodes" in capsys.readouterr().out
    skin.write_text("[skin]\ndiametre_mm = 3\n")
    with pytest.raises(ConfigError, match="diameter_mm"):
        run(*FEW, "--skin", str(skin))
