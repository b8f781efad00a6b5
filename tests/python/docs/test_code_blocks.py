"""Every shell and Python block of the README and of pages that promise it runs, in order, in one
folder a page."""

import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import eitskin
from eitskin.cli.main import main

ROOT = Path(__file__).resolve().parents[3]
PYTHON_PAGE = ROOT / "docs" / "site" / "python.rst"
# pages that a short run leaves out, and what stands for them there
CLI = pytest.mark.long("tests/python/cli runs these commands one by one")
SCENES = pytest.mark.long("tests/python/scene")
TEACHING = pytest.mark.long("teaching/test_guide.py, test_a_whole_session, and test_update.py")
SINKS = pytest.mark.long("tests/python/sinks and tests/python/robot")
API = pytest.mark.long("the README's Python, package/test_public.py, the tests of each module")
PAGES = (
    "README.md",
    pytest.param("docs/guide/tutorial.md", marks=CLI),
    pytest.param("docs/guide/gallery.md", marks=CLI),
    "docs/guide/import-and-doctor.md",
    pytest.param("docs/guide/scenes.md", marks=SCENES),
    pytest.param("docs/guide/shapes.md", marks=CLI),
    pytest.param("docs/guide/surfaces.md", marks=CLI),
    pytest.param("docs/guide/build-a-skin.md", marks=CLI),
    pytest.param("docs/guide/teaching.md", marks=TEACHING),
    pytest.param("docs/guide/calibration.md", marks=CLI),
    pytest.param("docs/guide/board.md", marks=CLI),
    pytest.param("docs/guide/gestures.md", marks=CLI),
    pytest.param("docs/guide/touches-out.md", marks=SINKS),
    pytest.param("docs/guide/robot.md", marks=SINKS),
    pytest.param("docs/guide/your-board.md", marks=CLI),
    pytest.param("docs/reference/python-api.md", marks=API),
    "docs/reference/frames-format.md",
)
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SET_UP = {"scripts/demo", "scripts/test"}


def blocks(page: str) -> list[tuple[str, str]]:
    return BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES)
def test_blocks_run(page, tmp_path):
    ran = 0
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for language, text in blocks(page):
        set_up = SET_UP & set(text.split("\n"))
        for command in set_up:
            assert os.access(ROOT / command, os.X_OK), f"{page} names {command}; it cannot be run"
        if set_up:
            continue
        # a model's errors take half a minute; cli/test_cli_model.py draws some
        text = text.replace("eitskin model build ", "eitskin model build --samples 0 ")
        command = ["sh", "-e", "-c", text] if language == "sh" else [sys.executable, "-c", text]
        done = subprocess.run(
            command, cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True,
            text=True, timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{page}:\n{text}\n{done.stdout}\n{done.stderr}"
        ran += 1
    assert ran >= 1


def test_the_sites_python_page_has_every_public_name():
    page = PYTHON_PAGE.read_text(encoding="utf-8")
    for name in eitskin.__all__:
        assert f":: eitskin.{name}\n" in page, name


@API
def test_the_examples_of_the_sites_python_page_run(tmp_path, monkeypatch):
    """One after the other, as one program, with a frames file and the tutorial's skin."""
    monkeypatch.chdir(tmp_path)
    assert main(["scene", "run", "two_touch", "-o", "touched.npz"]) == 0
    skin = re.search("<<'END'\n(.*?)END\n", blocks("docs/guide/tutorial.md")[0][1], re.DOTALL)
    assert skin is not None
    Path("patch.toml").write_text(skin[1], encoding="utf-8")
    page = PYTHON_PAGE.read_text(encoding="utf-8")
    examples = re.findall(r"^\.\. code-block:: python\n\n((?:   .*\n|\n)+)", page, re.MULTILINE)
    assert len(examples) >= 5
    program = compile("".join(map(textwrap.dedent, examples)), str(PYTHON_PAGE), "exec")
    exec(program, {})
    assert Path("touches.png").stat().st_size > 1000


def test_pages_link_to_files_that_exist():
    for page in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("studies/**/*.md")]:
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
            there = "://" in target or (page.parent / target).exists()
            assert there, f"{page.relative_to(ROOT)} links to {target}, which is not there"


def test_paths_that_pages_name_exist():
    """Files and folders of the tree, but for those with a placeholder in capitals."""
    named = re.compile(
        r"`((?:csrc|python|firmware|studies|tests|scripts|examples|tables)/[\w./-]+)`"
    )
    for page in [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("studies/**/*.md")]:
        for path in named.findall(page.read_text(encoding="utf-8")):
            if not re.search(r"[A-Z]{4}", path):
                name = page.relative_to(ROOT)
                assert (ROOT / path).exists(), f"{name} names {path}, which is not there"
