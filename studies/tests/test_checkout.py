"""The list of long tests fits the tests that there are; pages show every picture; pictures are
compressed."""

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


def test_every_picture_is_shown_and_compressed():
    """Matplotlib writes an alpha channel, which oxipng removes from an opaque picture; README.md of
    the results has the command."""
    results = HERE.parent / "results"
    shown = set()
    for page in results.glob("*.md"):
        shown |= set(re.findall(r"\]\((pictures/[^)]+)\)", page.read_text(encoding="utf-8")))
    pictures = [path for path in (results / "pictures").rglob("*") if path.is_file()]
    assert {path.relative_to(results).as_posix() for path in pictures} == shown
    with_alpha = [path.name for path in pictures if path.read_bytes()[25] == 6]
    assert with_alpha == [], "compress them without loss: see studies/results/README.md"
