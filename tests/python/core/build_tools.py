"""The compiler and its kin, for tests that build the C core themselves."""

import fcntl
import shutil
import subprocess
import sys
from pathlib import Path

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
    """What the command prints.

    Raises:
        AssertionError: it fails; with what it said.
    """
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def build_core() -> Path:
    """``build/static``: the static libraries of both widths in ``built``, to be installed
    into ``installed``; one build for all tests, whichever process asks first."""
    compiler, cmake, folder = tool("cc", "gcc", "clang"), tool("cmake"), ROOT / "build" / "static"
    generator = (
        ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}"] if not shutil.which("make") else []
    )
    settings = [f"-DCMAKE_C_COMPILER={compiler}", "-DEITSKIN_TESTS=OFF", "-DEITSKIN_PYTHON=OFF"]
    places = [f"-DCMAKE_INSTALL_PREFIX={folder / 'installed'}", "-DCMAKE_INSTALL_LIBDIR=lib"]
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        run(cmake, "-S", ROOT, "-B", folder / "built", *generator, *settings, *places)
        targets = ["--target", "eitskin_f32", "eitskin_f64"]
        run(cmake, "--build", folder / "built", "--parallel", "2", *targets)
    return folder
