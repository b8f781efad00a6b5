"""Output of the command line beside results: the time that is left, lists that end, completion."""

import subprocess

import pytest

from eitskin.cli.progress import lines
from eitskin.config import listed, nearest


def test_long_work_says_how_long_is_left(capsys):
    times = iter(range(0, 400, 4))  # four seconds an item
    assert list(lines(iter("abcdefgh"), "solving", 8, lambda: next(times))) == list("abcdefgh")
    found = capsys.readouterr().err.splitlines()
    assert found == ["eitskin: solving: 3 of 8, 00:20 left", "eitskin: solving: 6 of 8, 00:08 left"]
    times = iter(range(0, 400, 4))
    assert sum(lines([5, 5, 5, 5], "scenes", 40, lambda: next(times), int)) == 20
    assert capsys.readouterr().err == "eitskin: scenes: 15 of 40, 00:20 left\n"


def test_long_lists_are_cut():
    names = [f"frame {k:04d}" for k in range(1000)]
    assert listed(names[:3]) == "frame 0000, frame 0001, frame 0002"
    text = nearest("xyz", names)
    assert text.endswith("frame 0029 and 970 more") and len(text) < 500


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_knows_the_commands(shell, ran):
    script = ran(0, f"completion {shell}")[0]
    assert "reconstruct" in script and "stream" in script and "picture" in script
    if shell == "bash":
        subprocess.run(["bash", "-n"], input=script, text=True, check=True)
