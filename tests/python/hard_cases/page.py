"""studies/results/hard-cases.md: what the catalogue is, and its pictures. ``scripts/hard-cases``
runs it and makes the page."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pictures
from catalogue import CASES, GROUPS, HERE, ROOT, file_of

PAGE = ROOT / "studies" / "results" / "hard-cases.md"
PICTURES = ROOT / "studies" / "results" / "pictures"

MARGINS = HERE / "margins.json"

HEAD = """# Hard cases

What makes the numbers of an EIT skin go wrong, what eitskin promises then, and how near each
promise came to its bound. Each case has tests that fail where the promise does not hold
([cases.toml](../../tests/python/hard_cases/cases.toml)). Unless a case is about bytes or counters,
it runs in float32 on the host (vector and plain C kernels) and on an emulated Cortex-M7; all three
give the same bits. Where float64 was measured, it stands beside them.

`scripts/hard-cases` runs all cases and writes this page, its pictures and
[margins.json](../../tests/python/hard_cases/margins.json) with what was measured. *Used* is the
share of the bound that the worst measurement took: 0 % is perfect, 100 % is at the bound, and a
test fails above it. Hardly any bound is statistical; seeds are in the tests. Cases without a number
are right or wrong, such as a file that is refused. [Peers](peers.md) shows what other programs do
in some of these cases.

{groups}
"""

SAID = {
    "frames": "what is wrong with the voltages, from NaN to exchanged wires",
    "physics": "touches on electrodes, in crowds, of any size and contrast",
    "problem": "lambda, units, columns, precision and step of the solve",
    "time": "long runs, wrapped counters, changes in midstream, tracking",
    "bytes": "damaged models, packets, recordings and files",
}


WHERE = {
    ("M7", "host f32"): "float32",
    ("M7", "host f32", "host f64"): "all",
    ("host f32",): "float32, host",
    ("host f64",): "float64",
    ("M7",): "float32, M7",
    ("host f32", "host f64"): "host",
}


def margins() -> dict[str, dict[str, tuple[float, str]]]:
    """Return the worst share of the bound and its text, by case and target."""
    found: dict[str, dict[str, tuple[float, str]]] = {}
    for case, target, used, text in json.loads(MARGINS.read_text(encoding="utf-8")):
        found.setdefault(case, {})[target] = (used, text)
    return found


def used(of: dict[str, tuple[float, str]]) -> str:
    """Say how much of the bound was used on each target, and of what."""
    said: dict[str, list[str]] = {}
    for target, (share, text) in of.items():
        said.setdefault(f"{100 * share:.2g} % ({text})", []).append(target)
    return "; ".join(f"{WHERE[tuple(sorted(on))]} {text}" for text, on in said.items())


def table(group: str, measured: dict[str, dict[str, tuple[float, str]]]) -> list[str]:
    """Return the lines of the table of a group."""
    lines = ["| case | what goes wrong | promise | used, at worst |", "|---|---|---|---|"]
    for case in CASES:
        if case.group == group:
            test = f"../../{file_of(case.tests[0])}"
            name = f"[{case.id.split('/')[1]}]({test})"
            cells = (name, case.what, case.promise, used(measured.get(case.id, {})) or "-")
            lines.append(f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |")
    return lines


def page_text() -> str:
    """Return the page."""
    measured = margins()
    sizes = {group: sum(case.group == group for case in CASES) for group in GROUPS}
    groups = "\n".join(f"- **{group}** ({sizes[group]}): {SAID[group]}" for group in GROUPS)
    lines = [HEAD.format(groups=groups).rstrip()]
    for group in GROUPS:
        lines += [
            "",
            f"## {group.capitalize()}",
            "",
            f"{SAID[group][0].upper()}{SAID[group][1:]}.",
            "",
        ]
        lines += table(group, measured)
        for case in CASES:
            if case.group == group and case.picture is not None:
                picture = f"![{case.promise.rstrip('.')}](pictures/{case.picture})"
                lines += ["", f"`{case.id}`: {case.promise}", "", picture]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page_text(), encoding="utf-8")
    for case in CASES:
        if case.picture is not None:
            pictures.draw(case.picture, PICTURES / case.picture)
