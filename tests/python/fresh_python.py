"""A new Python process, for results that must not depend on what tests have imported before."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import eitskin

MAIN = "import sys\nfrom eitskin.cli.main import main\nsys.exit(main(sys.argv[1:]))\n"
# a background job of a shell ignores Ctrl-C, and so do the programs that it starts
INTERRUPTIBLE = f"import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n{MAIN}"


def words(*arguments: object) -> list[str]:
    """A command line's words; a text among ``arguments`` may hold several, as in a shell."""
    texts = (shlex.split(a) if isinstance(a, str) else [str(a)] for a in arguments)
    return [word for one in texts for word in one]


def without(*packages: str) -> str:
    """Code that makes ``packages`` unimportable, as if they were not installed."""
    return "import sys\n" + "".join(f"sys.modules[{name!r}] = None\n" for name in packages)


def run_python(
    code: str, *arguments: object, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    return run_command([sys.executable, "-c", code, *map(str, arguments)], cwd=cwd)


def run_command(command: list[str], cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run ``command`` with this project importable, one thread in BLAS."""
    path = os.pathsep.join(
        filter(None, [str(Path(eitskin.__file__).parents[1]), os.environ.get("PYTHONPATH")])
    )
    environment = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=cwd, timeout=120, check=False
    )
