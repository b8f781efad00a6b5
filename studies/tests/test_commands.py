"""The commands of the studies: ``eitskin`` finds them, they refuse mistakes in one line, and the
checks that ``tables/constants.toml`` names are theirs."""

import io
import shlex
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from eitskin.cli.main import ENTRY_POINT_GROUP, STUDIES, main
from eitskin.config import load_toml
from eitskin_studies.experiments.registry import EXPERIMENTS

ROOT = Path(__file__).resolve().parents[2]
MAIN = "from eitskin.cli.main import main; sys.exit(main(sys.argv[1:]))"


def test_the_product_knows_the_commands_by_name():
    ours = (e.name for e in entry_points(group=ENTRY_POINT_GROUP) if "eitskin_studies" in e.value)
    assert sorted(ours) == sorted(STUDIES)


@pytest.mark.parametrize(
    ("command", "code", "answer"),
    [
        ("study papper", 2, "study: no experiment is named 'papper'; did you mean 'paper'?"),
        ("study paper --page lost.md", 3, "lost.md: no such page; check the path"),
        ("study paper --page odd.md", 4, "odd.md: not UTF-8 text, so not a page"),
        ("compare --skin none", 3, "none: no such skin description; check the path"),
        ("compare --csv no/a.csv", 3, "no/a.csv: the folder no does not exist; make it first"),
        ("bench latency --presses 0", 2, "bench: --presses 0 is out of range; use 1 to 10000"),
    ],
)
def test_a_mistake_gets_its_answer(command, code, answer, tmp_path, monkeypatch):
    (tmp_path / "odd.md").write_bytes(b"\xff")
    monkeypatch.chdir(tmp_path)
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        assert main(shlex.split(command)) == code
    assert (out.getvalue(), err.getvalue()) == ("", f"eitskin: {answer}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["odd.md"]


@pytest.mark.parametrize(
    ("package", "extra", "option"),
    [("netgen", "model", "--csv"), ("matplotlib", "plot", "--picture")],
)
def test_missing_extras_are_named(package, extra, option, tmp_path):
    code = f"import sys; sys.modules[{package!r}] = None; {MAIN}"
    words = ["compare", "--scenes", "2", "--train", "2", option, "out.png"]
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (9, "")
    assert package in done.stderr and done.stderr.count("\n") == 1
    assert done.stderr.endswith(f"run  pip install 'eitskin[{extra}]'\n")
    assert list(tmp_path.iterdir()) == []


def test_the_checks_of_constants_are_commands_of_ours():
    tables = load_toml(ROOT / "tables" / "constants.toml", "table")["module"]
    files = (ROOT / "studies" / "eitskin_studies" / "cli").glob("bench_*.py")
    benches = "".join(path.read_text(encoding="utf-8") for path in files)
    for group in (group for table in tables for group in table["group"]):
        words = shlex.split(group["check"])
        if words[:2] == ["eitskin", "study"]:
            assert words[2] in EXPERIMENTS
        elif words[:2] == ["eitskin", "bench"]:
            assert f"def run_{words[2]}(" in benches
