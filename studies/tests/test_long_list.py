"""The list of long tests fits the tests that there are."""

import re
from fnmatch import fnmatch
from pathlib import Path

HERE = Path(__file__).resolve().parent


def test_every_pattern_names_a_test():
    names = [
        f"{file.name}::{name}"
        for file in HERE.glob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    lines = (HERE / "long_tests.txt").read_text(encoding="utf-8").splitlines()
    patterns = [line.partition("(")[0] for line in lines if line and not line.startswith("#")]
    assert [p for p in patterns if not any(fnmatch(name, p) for name in names)] == []
