"""The commit that a result was measured with."""

import subprocess
from collections.abc import Sequence

from eitskin.errors import UsageError

# results of the trade-off that stand among the code, but are no code
RESULTS = ("python/eitskin/tuning/front.json", "studies/eitskin_studies/tradeoff/front.json")


def last_commit(paths: Sequence[str]) -> str:
    """Return the last commit that changed ``paths`` of the checkout, ``RESULTS`` apart, with
    "-dirty" if they have changes that are not committed; "unknown" without a checkout."""
    from eitskin_emulator.core_on_qemu import checkout_root  # needs numpy, which help does not

    try:
        root = str(checkout_root())
    except UsageError:
        return "unknown"
    words = ("--", *paths, *(f":(exclude){path}" for path in RESULTS))
    changed = _git(root, "status", "--porcelain", *words)
    last = _git(root, "log", "-1", "--format=%h", *words)
    return (last or "unknown") + ("-dirty" if changed else "")


def _git(root: str, *words: str) -> str:
    command = ["git", "-C", root, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
