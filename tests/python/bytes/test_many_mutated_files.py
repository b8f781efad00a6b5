"""Mutated files of every format: each read, or refused in a line, within 2 s and 500 MB, without a
number that is not finite. ``mutated_files.py`` sets the limits, in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SCRIPT = HERE / "mutated_files.py"


@pytest.mark.parametrize("count", [20, pytest.param(1000, marks=pytest.mark.long("20 files"))])
def test_each_is_read_or_refused_soon(count):
    done = subprocess.run(
        [sys.executable, SCRIPT, str(count)], env={**os.environ, "PYTHONPATH": str(HERE.parent)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    reported = json.loads(done.stdout)
    print(reported)
    peak_mb = reported.pop("peak_mb")
    assert len(reported) == 9 and peak_mb > 0
    for name, one in reported.items():
        assert one["files"] == count and one["opened"] > 0, name  # damage that is not seen, too
