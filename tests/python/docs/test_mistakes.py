"""mistakes.md: every mistake in it is made, and gets the answer that stands there.

``PYTHONPATH=tests/python python tests/python/docs/test_mistakes.py`` writes the answers again.
"""

import contextlib
import io
import os
import re
import shlex
import tempfile
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pytest

from eitskin.cli.main import main
from eitskin.frames.frames import save_frames
from small_models import session

PAGE = Path(__file__).with_name("mistakes.md")
ROW = re.compile(r"\| `eitskin (.*?)` \| (\d+) \| (.*) \|")
FILES = {
    "volts.csv": "0.1,0.2,0.3\n0.1,0.2,0.3\n",
    "typo.toml": "[skim]\nshape = 'disk'\n",
    "small.toml": "[skin]\ndiameter_mm = -194\n",
    "weights.csv": "press,grams\nfirst,heavy\n",
    "notes.txt": "the skin was dry\n",
    "cm.csv": "x_cm,y_cm\n1,2\n",
    "far.csv": "x_mm,y_mm\n1,2\n2e5,0\n",
    "deep.csv": "x_mm,y_mm,depth_mm\n1,2,-4\n",
    "counted.csv": "0,1,2,3,4\n0.1,0.2,0.3,0.4,0.5\n0.1,0.2,0.3,0.4,0.5\n",
    "labelled.txt": "k\n1 2 3\n4 5 6\nk\n1 2 3\n4 5 6\n",
    "two.txt": "mags: 1,2\nphases: 3,4\nmags: 5,6\nphases: 7,8\n",
    "german.csv": "a;b\n0,1;0,2\n0,3;x\n",
    "sheet.xlsx": "PK",
    "cut.get": "1234",
    "cut.eit": "18\n2\nname\n",
    "notes.eit": "hello\n",
    "full.csv": "\n".join([",".join(["0.5"] * 208)] * 4),
    "empty.csv": "",
    "nothing.toml": "",
    "layout.toml": "[lines]\nofset = 3\n",
    "ofs.toml": '[lines]\noffset = "mid"\n',
    "ring.svg": '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm"'
    ' viewBox="0 0 9 9"><path id="plate" d="M1 1H8V8H1Z M4 4H5V5H4Z"/></svg>',
    "hidden.svg": '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm"'
    ' viewBox="0 0 9 9"><path d="M1 1H8V8H1Z" display="none"/></svg>',
    "ring.toml": '[skin]\noutline = "ring.svg"\nelement = "plate"\nthickness_mm = 5.0\n'
    "[electrodes]\ncount = 16\nwidth_mm = 0.3\n",
    "hidden.toml": '[skin]\noutline = "hidden.svg"\nthickness_mm = 5.0\n'
    "[electrodes]\ncount = 16\nwidth_mm = 0.3\n",
    "old.eits": "",
    "fast.toml": "[scene]\nframes = 4\nquiet_frames = 8\nelements = 1500\nrate_hz = 60\n",
}


def rows() -> list[tuple[str, str, str]]:
    return [(one[1], one[2], one[3]) for one in ROW.finditer(PAGE.read_text(encoding="utf-8"))]


@contextlib.contextmanager
def in_a_folder_of_files() -> Iterator[None]:
    """Enter a folder with frames and with files that contain mistakes, without a serial port."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        save_frames("touched.npz", session().as_frames())
        for file, text in FILES.items():
            Path(file).write_text(text, encoding="utf-8")
        try:
            with patch("eitskin.device.ports.ports", list):
                yield
        finally:
            os.chdir(before)


def answered(command: str) -> tuple[int, str]:
    """The exit code, and the line on standard error."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(shlex.split(command))
    assert out.getvalue() == "", command
    lines = err.getvalue().splitlines()
    assert len(lines) == 1 and lines[0].startswith("eitskin: "), f"{command}: {lines}"
    return code, lines[0].removeprefix("eitskin: ")


def in_a_cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")


@pytest.fixture(scope="module")
def folder() -> Iterator[None]:
    with in_a_folder_of_files():
        yield


def test_there_are_forty_of_many_commands():
    commands = {command.split()[0] for command, _, _ in rows()}
    assert len(rows()) >= 40 and len(commands) >= 12


@pytest.mark.parametrize(("command", "code", "answer"), rows())
def test_a_mistake_gets_its_answer(folder, command, code, answer):
    before = sorted(Path.cwd().iterdir())
    got, line = answered(command)
    assert (str(got), in_a_cell(line)) == (code, answer)
    assert sorted(Path.cwd().iterdir()) == before


if __name__ == "__main__":
    with in_a_folder_of_files():
        made = {command: answered(command) for command, _, _ in rows()}

    def written(found: re.Match[str]) -> str:
        code, line = made[found[1]]
        return f"| `eitskin {found[1]}` | {code} | {in_a_cell(line)} |"

    PAGE.write_text(ROW.sub(written, PAGE.read_text(encoding="utf-8")), encoding="utf-8")
