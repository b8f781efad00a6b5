"""The pages of results show every picture, and pictures are compressed."""

import re
from pathlib import Path

HERE = Path(__file__).resolve().parent


def test_every_picture_is_shown_and_compressed():
    """Matplotlib writes an alpha channel, which oxipng removes from an opaque picture; README.md of
    the results has the command."""
    results = HERE.parent / "results"
    shown = set()
    for page in results.glob("*.md"):
        shown |= set(re.findall(r"\]\((pictures/[^)]+)\)", page.read_text(encoding="utf-8")))
    pictures = [path for path in (results / "pictures").rglob("*") if path.is_file()]
    assert {path.relative_to(results).as_posix() for path in pictures} == shown
    with_alpha = [
        path.name for path in pictures if path.suffix == ".png" and path.read_bytes()[25] == 6
    ]
    assert with_alpha == [], "compress them without loss: see studies/results/README.md"
