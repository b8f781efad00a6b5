"""The source archive: all sources, little else, and metadata that lead to them."""

import re
import shutil
import subprocess
import sys
import tarfile
from email import message_from_bytes
from fnmatch import fnmatch
from pathlib import Path

import pytest
from test_wheel import ROOT

from eitskin.config import load_toml

MAX_BYTES = 3_000_000
NOT_SOURCES = (".venv/pyvenv.cfg", "build/host/core.o", "python/eitskin/__pycache__/errors.pyc")


def tracked() -> list[str]:
    done = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    """The archive of a copy of the tree with a file of each kind that is not a source. In the tree
    itself, all files of its virtual environment would be looked at."""
    copy, folder = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("archive")
    for name in tracked():
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, copy / name)
    for name in NOT_SOURCES:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text("not a source")
    code = f"from scikit_build_core.build import build_sdist; build_sdist({str(folder)!r})"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=copy, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (made,) = folder.iterdir()
    return made


def test_it_holds_every_source_in_little_room(archive):
    with tarfile.open(archive) as tar:
        held = {name.partition("/")[2] for name in tar.getnames()}
    left_out = load_toml(ROOT / "pyproject.toml", "project")["tool"]["scikit-build"]["sdist"]
    expected = {
        name
        for name in tracked()
        if not any(
            fnmatch(name, f"{one.replace('**/', '').lstrip('/')}*") for one in left_out["exclude"]
        )
    }
    assert expected - held == set() == held & set(NOT_SOURCES)
    assert archive.stat().st_size < MAX_BYTES


def test_its_metadata_lead_to_the_sources(archive):
    with tarfile.open(archive) as tar:
        file = tar.extractfile(f"{archive.name.removesuffix('.tar.gz')}/PKG-INFO")
        assert file is not None
        facts = message_from_bytes(file.read())
    source = load_toml(ROOT / "pyproject.toml", "project")["project"]["urls"]["Source"]
    urls = dict(one.split(", ") for one in facts.get_all("Project-URL"))
    assert urls["Source"] == source and {"Documentation", "Changelog", "Issues"} < set(urls)
    assert all(one.startswith(source) for one in urls.values())
    text = facts.get_payload()
    targets = re.findall(r"\]\(([^)]+)\)", text)
    assert len(targets) > 20 and all(one.startswith("https://") for one in targets)
    for one in targets:  # what they name is in the tree
        path = re.match(rf"{source}/(?:blob|raw)/main/([^#]+)", one)
        assert path is None or (ROOT / path[1]).exists(), one
