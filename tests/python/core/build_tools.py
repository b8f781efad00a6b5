"""The compiler and its kin, for tests that build the C core themselves."""

import shutil
import subprocess
import sys
from pathlib import Path

from filelock import FileLock

ROOT = Path(__file__).resolve().parents[3]
CSRC = ROOT / "csrc"


def tool(*names: str) -> str:
    """The path of the first of these programs that is there, in PATH or beside this Python.

    Raises:
        AssertionError: none is; the core cannot be judged then, so the test fails.
    """
    for name in names:
        beside = Path(sys.executable).parent / name
        found = shutil.which(name) or (str(beside) if beside.exists() else None)
        if found:
            return found
    raise AssertionError(
        f"none of {', '.join(names)} is installed; the C core cannot be built and judged without it"
    )


def run(*command: str | Path) -> str:
    """Run the command and return its output.

    Raises:
        AssertionError: it fails; with what it said.
    """
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def build_core() -> Path:
    """``build/host`` with the static libraries of both widths brought up to date: the build of the
    C tests, one for all processes."""
    folder = ROOT / "build" / "host"
    cmake, ninja = tool("cmake"), tool("ninja")
    tool("cc", "gcc", "clang")
    folder.mkdir(parents=True, exist_ok=True)
    with FileLock(folder / "lock"):
        run(cmake, "-S", ROOT, "--preset", "host", f"-DCMAKE_MAKE_PROGRAM={ninja}")
        run(cmake, "--build", folder, "--target", "eitskin_f32", "eitskin_f64")
    return folder
