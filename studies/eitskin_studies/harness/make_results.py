"""Make the numbers, tables and pictures of the results again: ``studies/run NAME...`` or ``--all``.

Each command fills its page and stores the numbers with the commit in ``results/numbers``. A study
that is stopped goes on where it was, in ``out``. At last the README's numbers are filled from the
pages. The folders of measured frames are named in the environment: TANKS (docs/guide/tank.md) and
PRESSES (results/teaching.md); without them the studies on them are left out, which is printed.
"""

import os
import shlex
import subprocess
import sys

from eitskin.config import nearest
from eitskin.errors import UsageError
from eitskin_emulator.core_on_qemu import checkout_root
from eitskin_studies.experiments.registry import EXPERIMENTS
from eitskin_studies.harness.sections import fill_readme

RESULTS = "studies/results"
# studies on measured frames, and who names them
DATA = {"tank": "TANKS", "teaching": "PRESSES", "taught-sessions": "PRESSES"}
SHARES = {"other-worlds": "0.5", "patterns": "0.3"}  # of the usual scenes, as the pages have them
OTHERS = {
    "tradeoff": "tradeoff run -o out/tradeoff --page {page}"
    " --recorded studies/eitskin_studies/tradeoff/front.json"
    " --front python/eitskin/tuning/front.json",
    "limit": "bench limit --scenes 60 --seed 1 --page {page}",
    "diagnostics": "bench diagnostics --scenes 320 --crowds 24 --imperfect 40 --seed 4001"
    " --page {page}",
    "gestures": "bench gestures --sessions 60 --seed 7001 --role judging --snr-db 60 40"
    " --page {page}",
    "peers": "bench peers --scenes 20 --seed 1 --page {page}",
    "scene-cost": "bench effects --frames 40 --page {page}",
    "latency": "bench latency --presses 200 --emulated 24 --seed 1 --order 'by 7' --page {page}",
    "board-cost": "bench board --scenes 180 --seed 1 --frames 12 --page {page}",
    "energy": "bench energy --page {results}/board-cost.md",
    "outputs": "bench outputs --taps 24 --seconds 20 --load 600 --seed 1 --page {page}",
    "growth": "bench growth --rounds 21 --page {results}/benchmarks.md",
}


def commands() -> dict[str, list[str]]:
    """The command of each study by name; of studies on measured frames only where there are
    some."""
    found = {}
    for name in EXPERIMENTS:
        words, page = f"study {name} -o out/{name}".split(), f"{RESULTS}/{name}.md"
        if (checkout_root() / page).is_file():
            words += ["--page", page]
        if name in SHARES:
            words += ["--share", SHARES[name]]
        if name in DATA:
            if not (folder := os.environ.get(DATA[name])):
                continue
            words += ["--data", folder]
        found[name] = ["eitskin", *words]
    for name, text in OTHERS.items():
        whole = text.format(page=f"{RESULTS}/{name}.md", results=RESULTS)
        found[name] = ["eitskin", *shlex.split(whole)]
    found["hard-cases"] = ["scripts/hard-cases"]
    return found


def main(words: list[str]) -> int:
    """Run the commands that ``words`` name.

    Raises:
        UsageError: a word names none, or there is no word.
    """
    known = commands()
    for name, variable in DATA.items():
        if name not in known:
            print(f"studies/run: {name} is left out; name the folder of its frames in {variable}")
    if words == ["--list"]:
        print("\n".join(f"{name:12} {shlex.join(command)}" for name, command in known.items()))
        return 0
    chosen = list(known) if words == ["--all"] else words
    if not chosen:
        raise UsageError("studies/run: name studies, or use --list or --all")
    for name in chosen:
        if name not in known:
            raise UsageError(f"studies/run: no study is named {name!r}; {nearest(name, known)}")
    root = checkout_root()
    for name in chosen:
        print(f"== {shlex.join(known[name])}", flush=True)
        done = subprocess.run(known[name], cwd=root, stdout=subprocess.DEVNULL, check=False)
        if done.returncode:
            return done.returncode
    fill_readme(root / "README.md", root / RESULTS)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except UsageError as error:
        sys.exit(str(error))
