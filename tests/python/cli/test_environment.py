"""Settings of the user for other programs change neither the output of the command line nor its
pictures."""

import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from eitskin.cli.main import main
from fresh_python import MAIN, run_python

RC = (
    "text.usetex: True\nfigure.facecolor: black\nfont.size: 30\nbackend: nonsense\nnosuchkey: 1\n"
    "svg.fonttype: none\n"
)
SETTINGS = {
    "a notebook's backend": {"MPLBACKEND": "module://matplotlib_inline_that_is_not_here.backend"},
    "another backend": {"MPLBACKEND": "nonsense"},
    "a matplotlibrc": {"MATPLOTLIBRC": "{folder}/rc"},
    "a locale that is not here": {"LC_ALL": "xx_YY.UTF-9", "LANG": "xx_YY"},
    "a locale of bytes": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "a locale with a decimal comma": {"LC_ALL": "de_DE.UTF-8", "LC_NUMERIC": "de_DE.UTF-8"},
    "warnings are errors": {"PYTHONWARNINGS": "error"},
    "warnings that cannot be": {"PYTHONWARNINGS": "nonsense::x"},
    "an unknown terminal": {"TERM": "no-such-terminal", "COLUMNS": "-3"},
    "no terminal": {"TERM": "", "COLUMNS": "x"},
    "a home that cannot be written": {"HOME": "/proc", "MPLCONFIGDIR": "/proc/none"},
    "no home": {"HOME": "", "XDG_CONFIG_HOME": "/dev/null"},
}
COMMANDS = [
    ["demo", "--picture", "{folder}/demo.png"],
    # a simulated skin would be meshed and solved in each process
    ["stream", "--device", "file:{recorded}", "--picture", "{folder}/stream.png"],
]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    path: Path = tmp_path_factory.mktemp("recorded") / "swipe.eits"
    assert main(["record", "--device", "sim:swipe", "--frames", "3", "-o", str(path)]) == 0
    return path


def run(folder: Path, command: list[str], setting: dict[str, str]) -> subprocess.CompletedProcess:
    arguments = [one.replace("{folder}", str(folder)) for one in command]
    given = {name: text.replace("{folder}", str(folder)) for name, text in setting.items()}
    return subprocess.run(
        [sys.executable, "-c", MAIN.replace("main(sys.argv[1:])", "main()"), *arguments],
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **given},
        cwd=folder,
        capture_output=True,
        timeout=120,
        check=False,
    )


@pytest.fixture(scope="module")
def commands(recorded) -> list[list[str]]:
    """COMMANDS with the recording's path."""
    return [[one.replace("{recorded}", str(recorded)) for one in words] for words in COMMANDS]


@pytest.fixture(scope="module")
def plain(commands, tmp_path_factory) -> Callable[[int], tuple[bytes, bytes]]:
    """The output and the picture of one of ``commands`` without such settings."""

    @cache
    def of(number: int) -> tuple[bytes, bytes]:
        folder = tmp_path_factory.mktemp("plain")
        done = run(folder, commands[number], {})
        assert done.returncode == 0, done
        picture = Path(commands[number][-1].replace("{folder}", str(folder)))
        return lines(done.stdout), picture.read_bytes()

    return of


def lines(printed: bytes) -> bytes:
    """Without times of this run, and names of files."""
    told = printed.splitlines()
    timed = (b"/", b" ms", b" s)", b" us")
    kept = [one for one in told if not any(mark in one for mark in timed)]
    return b"\n".join(kept)


# the others are of the same kinds: a backend, a locale, a terminal or a home
SHORT = ("a notebook's backend", "a locale with a decimal comma", "no home")


@pytest.mark.parametrize(
    "name",
    [
        name if name in SHORT else pytest.param(name, marks=pytest.mark.long("other settings"))
        for name in SETTINGS
    ],
)
def test_it_does_and_draws_the_same(name, commands, plain, tmp_path):
    (tmp_path / "rc").write_text(RC)
    if name == "a matplotlibrc":
        (tmp_path / "matplotlibrc").write_text(RC)
    for number in (0, 1) if name == "a matplotlibrc" else (1,):
        command, expected = commands[number], plain(number)
        done = run(tmp_path, command, SETTINGS[name])
        assert done.returncode == 0, done.stderr.decode()
        assert b"Traceback" not in done.stderr and b"Warning" not in done.stderr, done.stderr
        assert b"atplotlib" not in done.stderr, done.stderr
        assert lines(done.stdout) == expected[0]
        assert Path(command[-1].replace("{folder}", str(tmp_path))).read_bytes() == expected[1]


def test_a_program_keeps_its_own_backend_and_settings(tmp_path):
    code = (
        "import os, warnings\nos.environ['MPLBACKEND'] = 'svg'\n"
        "from eitskin.view.pictures import load_matplotlib\n"
        "m = load_matplotlib()\n"
        "assert os.environ['MPLBACKEND'] == 'svg' and m.rcParams['backend'] == 'svg'\n"
        "assert m.rcParams['font.size'] == 30\n"
    )
    (tmp_path / "matplotlibrc").write_text("font.size: 30\n")
    done = run_python(code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
