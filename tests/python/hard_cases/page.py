"""studies/results/hard-cases.md: what the catalogue is, and its pictures. ``scripts/hard-cases``
runs it and makes the page."""

import json
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pictures
from catalogue import CASES, GROUPS, HERE, ROOT, file_of

PAGE = ROOT / "studies" / "results" / "hard-cases.md"
PICTURES = ROOT / "studies" / "results" / "pictures"

PEERS = PAGE.parent / "peers.md"
MARGINS = HERE / "margins.json"

HEAD = """# Hard cases

This page lists what can make the numbers of an EIT skin go wrong, what eitskin promises in each
case, and how near to breaking the promise the worst measurement came. Each case has tests that fail
if the promise is broken ([cases.toml](../../tests/python/hard_cases/cases.toml)).

**How to read a margin.** Each promise has a bound, and a margin is the share of the bound that the
worst measurement used. 0 % is perfect, 100 % is at the bound, and above it a test fails. The
parentheses say what was measured, and the bound. A case without a number is either right or wrong,
such as a file that must be rejected. A *sound* result has finite numbers only; its objective,
residual and duality gap are no worse than those of a zero image, and they are what float64
arithmetic finds for that image.

**What a margin shows.** The tests try the same frames in every run; [counts and
seeds](#counts-and-seeds) says how many. Bounds of places, counts and rows hold for every frame, and
most bounds of the MIoU and of peaks for the mean over the scenes. A margin says little about the
rate of failures in other frames: if none of 6 frames fails, the 95 % interval of that rate is 0 to
39 %; for 24 frames it is 0 to 14 %, and for 200 frames 0 to 1.9 % (Wilson's intervals).
[Diagnostics](diagnostics.md) and [other worlds](other-worlds.md) measure rates.

**Words.** A frame has 208 *rows*; each is one voltage at one pair of electrodes, while current
flows through another pair. V0 is the frame of the untouched skin, and rms(V0) the root of its mean
square. A *tare* takes untouched frames as the reference. The *contrast* of a touch is the
conductivity inside over that outside. *MIoU* is the overlap of an image with the truth, from 0 to 1
([definition](../../docs/reference/metrics.md#miou)). The solver has reduced data y and a reduced
matrix S; it looks for the image x with the least norm(y - S x)²/2 + lambda sum abs(x), which is the
*objective*. From *lambda_max* on the image is zero, and *lambda_noise* is the lambda_max of noise
alone. The *duality gap* is a bound of the distance from the least objective. FISTA, working set and
active set are the core's three [solvers](../../docs/reference/options.md). *Warm* frames begin with
the image of the frame before them. The [glossary](../../docs/reference/glossary.md) has all other
words.

**Where it runs.** Cases about numbers run in float32 on the host, with vector kernels and with
plain C kernels, and on an emulated Cortex-M7. All three give the same bits, so they share one
margin. The same tests also run in float64 on the host, with the same frames and the same bounds. If
float64 has a far smaller margin, rounding to float32 uses up most of the bound; if both are about
equal, it is the method that does. A "-" in the column of float64 marks cases that are about float32
itself (where its range ends, and how far it is from float64), about tracking, or about bytes and
counters. Cases about tracking, bytes and counters run on the host alone.

**Other programs** are numpy (one Gauss-Newton step), scikit-learn (Lasso) and pyEIT. They were
given the frames of {given} of the {cases} cases; "-" stands for the others. None of them is made to
judge frames. *Worse* means that the MIoU of the image fell, and that the program reported nothing;
*right* means that it fell by at most .02; the number is the image's MIoU. [Peers](peers.md) has the
conditions, and what eitskin does.

`scripts/hard-cases` runs all cases, and writes this page, its pictures and the measured margins
([margins.json](../../tests/python/hard_cases/margins.json)). The margins were measured at
commit {commit}.

{groups}
"""

COUNTED = """Frames of *frames* are of 6 random scenes of 1 to 3 touches (seed 9) on the paper's
skin, at 60 dB, after 16 untouched frames, with the prebuilt model; MIoU and peaks are means over
the scenes. Those of *physics* are simulated on another mesh than the model's, at 60 dB and 12 bits,
after 64 untouched frames (seed 1). *Problem* has made-up matrices, most of 20 rows and 64 columns,
with data of two columns and 5 % noise; each is solved with each solver and, in most cases, with
each of the three signs. *Time* has the linear answers of a small skin with noise of 0.001 rms(V0).
Hypothesis draws the inputs of *bytes* in the same way in every run, and
[`scripts/fuzz`](../../scripts/fuzz) looks for new ones with libFuzzer."""

SAID = {
    "frames": "faults of the voltages, from NaN to exchanged wires",
    "physics": "touches on electrodes, in crowds, of any size and contrast",
    "problem": "the solver's lambda, units, columns, precision and step",
    "time": "long runs, counters that wrap, changes while frames arrive, tracking",
    "bytes": "damaged models, packets, recordings and files",
}


def margins() -> dict[str, dict[str, tuple[float, str]]]:
    """Return the worst share of the bound and its text, by case and target."""
    found: dict[str, dict[str, tuple[float, str]]] = {}
    for case, target, used, text in stored()["margins"]:
        found.setdefault(case, {})[target] = (used, text)
    return found


def stored() -> dict[str, Any]:
    """Return what a run of the hard cases wrote: the margins, and the commit that it measured."""
    found: dict[str, Any] = json.loads(MARGINS.read_text(encoding="utf-8"))
    return found


def used(of: dict[str, tuple[float, str]], targets: tuple[str, ...]) -> str:
    """Say how much of the bound was used on ``targets``, and of what: once if all agree."""
    said: dict[str, list[str]] = {}
    for target in targets:
        if target in of:
            share, text = of[target]
            percent = f"{100 * share:.0f}" if share >= 0.1 else f"{100 * share:.2g}"
            said.setdefault(f"{percent} % ({text})", []).append(target)
    if len(said) == 1:
        ((text, on),) = said.items()
        return text if tuple(on) == targets else f"{', '.join(on)} alone: {text}"
    return "; ".join(f"{', '.join(on)}: {text}" for text, on in said.items()) or "-"


def peers() -> dict[str, dict[str, str]]:
    """Return what each other program does in each row of the page of peers, in a word."""
    lines = PEERS.read_text(encoding="utf-8").split("<!-- peers -->\n")[1].splitlines()
    head, *rows = [[cell.strip() for cell in line.strip("|").split("|")]
                   for line in lines if line.startswith("|")]  # fmt: skip
    names = [name.split(",")[0] for name in head[1:-1]]
    return {row[0]: dict(zip(names, map(_in_a_word, row[1:-1]), strict=True)) for row in rows[1:]}


def _in_a_word(cell: str) -> str:
    """Return the text of a cell without the exception's name and the MIoU of clean frames."""
    return cell.split(":")[0].split(" (clean")[0].replace(", MIoU", ",")


def others(rows: list[str], found: dict[str, dict[str, str]]) -> str:
    """Say what the other programs do in these rows."""
    said = []
    for row in rows:
        does = "; ".join(f"{name} {what}" for name, what in found[row].items())
        said.append(f"{row}: {does}" if len(rows) > 1 else does)
    return "<br>".join(said) or "-"


def table(group: str, measured: dict[str, dict[str, tuple[float, str]]]) -> list[str]:
    """Return the lines of the table of a group."""
    head = ("case", "what goes wrong", "promise", "float32: host and M7", "float64: host",
            "other programs")  # fmt: skip
    lines, found = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)], peers()
    for case in CASES:
        if case.group == group:
            test = f"../../{file_of(case.tests[0])}"
            name = f"[{case.id.split('/')[1]}]({test})"
            of = measured.get(case.id, {})
            cells = (name, case.what, case.promise, used(of, ("host f32", "M7")),
                     used(of, ("host f64",)), others(case.peers, found))  # fmt: skip
            lines.append(f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |")
    return lines


def page_text() -> str:
    """Return the page."""
    measured = margins()
    sizes = {group: sum(case.group == group for case in CASES) for group in GROUPS}
    groups = "\n".join(f"- **{group}** ({sizes[group]}): {SAID[group]}" for group in GROUPS)
    given = sum(bool(case.peers) for case in CASES)
    lines = [HEAD.format(groups=groups, given=given, cases=len(CASES), commit=stored()["commit"])]
    lines[0] = lines[0].rstrip()
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
    lines += ["", "## Counts and seeds", "", COUNTED, "", "| case | tried |", "|---|---|"]
    lines += [f"| {case.id} | {case.tried} |" for case in CASES]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page_text(), encoding="utf-8")
    for case in CASES:
        if case.picture is not None:
            pictures.draw(case.picture, PICTURES / case.picture)
