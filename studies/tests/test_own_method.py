"""A method of another package joins the comparison by its entry point."""

import json
import os
import shutil
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import pytest

from eitskin.config import load_toml
from eitskin.errors import UsageError
from eitskin_studies.compare import methods

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "python" / "own_method"
COMPARE = """
import json
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare.methods import own_methods
from eitskin_studies.compare.run import CompareSettings, compare
settings = CompareSettings(scenes=3, train_scenes=3, elements=900, simulated_elements=1500)
done = compare(paper_skin(), adjacent(16), settings, families=own_methods)
print(json.dumps([[one.name, one.value, one.miou_summary.mean] for one in done.results]))
"""


def table_of_modules(package: Path) -> list[str]:
    return list(
        load_toml(package / "pyproject.toml", "project")["tool"]["setuptools"]["py-modules"]
    )


def install_by_hand(package: Path, site: Path) -> None:
    """Modules and entry points of a package as an installer leaves them, without one."""
    table = load_toml(package / "pyproject.toml", "project")["project"]
    info = site / f"own_method-{table['version']}.dist-info"
    info.mkdir(parents=True)
    for module in table_of_modules(package):
        shutil.copy(package / f"{module}.py", site)
    (info / "METADATA").write_text(f"Name: {table['name']}\nVersion: {table['version']}\n")
    lines = []
    for group, names in table["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in names.items())]
    (info / "entry_points.txt").write_text("\n".join(lines))


def test_the_example_is_installed_and_compared(tmp_path, monkeypatch):
    install_by_hand(EXAMPLE, tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    done = subprocess.run(
        [sys.executable, "-c", COMPARE], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    ((name, value, miou),) = json.loads(done.stdout)
    assert name == "truncated SVD" and value in (20, 40, 60, 80) and 0.6 < miou < 1


def test_the_page_shows_the_example():
    page = (ROOT / "docs" / "guide" / "own-method.md").read_text(encoding="utf-8")
    assert "(../../examples/python/own_method/own_method.py)" in page
    table = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    named = '[project.entry-points."eitskin.methods"]\ntruncated-svd = "own_method:family"\n'
    assert named in table and f"```toml\n{named}```" in page


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("nowhere:family", "No module named 'nowhere'"),
        ("math:sqrt", "must be real number"),
        ("builtins:repr", "returned no Family"),
    ],
)
def test_what_is_no_method_is_refused_by_name(value, said, monkeypatch):
    entry = EntryPoint("mine", value, methods.ENTRY_POINT_GROUP)
    monkeypatch.setattr(methods, "entry_points", lambda group: [entry])
    with pytest.raises(UsageError, match=f"method 'mine' .*{said}"):
        methods.own_methods(SimpleNamespace())
