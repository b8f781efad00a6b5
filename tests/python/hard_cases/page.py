"""studies/results/hard-cases.md: what the catalogue is, and its pictures. ``scripts/hard-cases``
runs it and makes the page."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pictures
from catalogue import CASES, GROUPS, ROOT

PAGE = ROOT / "studies" / "results" / "hard-cases.md"
PICTURES = ROOT / "studies" / "results" / "pictures"

HEAD = """# Hard cases

What makes an EIT skin's numbers go wrong, and what eitskin promises then:
[cases.toml](../../tests/python/hard_cases/cases.toml) has {count} cases with both, and with
the test that fails where the promise does not hold. Unless a case is about bytes or counters, it
runs in float32 on the host (vector and plain C kernels) and on an emulated Cortex-M7; all three
give the same bits. `scripts/hard-cases` runs them, says how much of each bound is used, and writes
this page.

{groups}
"""

SAID = {
    "frames": "what is wrong with the voltages, from NaN to exchanged wires",
    "physics": "touches on electrodes, in crowds, of any size and contrast",
    "problem": "lambda, units, columns, precision and step of the solve",
    "time": "long runs, wrapped counters, changes in midstream, tracking",
    "bytes": "damaged models, packets, recordings and files",
}


def page_text() -> str:
    sizes = {group: sum(case.group == group for case in CASES) for group in GROUPS}
    groups = "\n".join(f"- **{group}** ({sizes[group]}): {SAID[group]}" for group in GROUPS)
    lines = [HEAD.format(count=len(CASES), groups=groups).rstrip()]
    for case in CASES:
        if case.picture is not None:
            picture = f"![{case.id}](pictures/{case.picture})"
            lines += ["", f"`{case.id}`: {case.promise}", "", picture]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page_text(), encoding="utf-8")
    for case in CASES:
        if case.picture is not None:
            pictures.draw(case.picture, PICTURES / case.picture)
