"""docs/results/hard-cases.md: the catalogue. ``scripts/hard-cases`` runs it and makes the page."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pictures
from catalogue import CASES, GROUPS, ROOT, Case

PAGE = ROOT / "docs" / "results" / "hard-cases.md"
PICTURES = ROOT / "docs" / "results" / "pictures"
UP = "../../"

HEAD = """# Hard cases

What makes an EIT skin's numbers go wrong, and what eitskin promises then. Each case is a test, to
which its name links, that fails where the promise does not hold;
[cases.toml](../../tests/python/hard_cases/cases.toml) says what goes wrong in each. Unless the case
is about bytes or counters, it runs in float32 on the host (vector and plain C kernels) and on an
emulated Cortex-M7; all three give the same bits. `scripts/hard-cases` runs them, says how much of
each bound is used, and writes this page. *Sound*: finite; objective, residual and gap no worse than
at zero, and reported as float64 finds them.
"""


def _row(case: Case) -> str:
    return f"- [`{case.id}`]({UP}{case.files[0]}): {case.promise}"


def page_text() -> str:
    """The whole page."""
    lines = [HEAD.rstrip()]
    for group in GROUPS:
        of_group = [case for case in CASES if case.group == group]
        lines += ["", f"## {group.capitalize()}", "", *map(_row, of_group)]
        for case in of_group:
            if case.picture is not None:
                lines += ["", f"![{case.id}](pictures/{case.picture})"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page_text(), encoding="utf-8")
    for case in CASES:
        if case.picture is not None:
            pictures.draw(case.picture, PICTURES / case.picture)
