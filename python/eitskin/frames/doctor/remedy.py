"""The options of ``eitskin import`` that repair bad rows, and how the remedies of several findings
are combined."""

from collections.abc import Iterable
from typing import Any

from eitskin.frames.doctor.case import Case, numbers
from eitskin.frames.repair import partners

ROW_LISTS = ("--flip-channels", "--impute-channels", "--drop-channels", "--drop-electrodes")


def row_remedy(case: Case, rows: Any) -> str:
    """Return the options that fill ``rows`` from their reciprocal rows if those are trusted,
    and leave out the others."""
    bad = set(numbers(rows))
    partner = partners(case.rows, case.n_electrodes)
    fill = sorted(
        k for k in bad if k in partner and partner[k][0] not in bad and case.trusted[partner[k][0]]
    )
    leave = sorted(bad - set(fill))
    return _joined({"--impute-channels": fill, "--drop-channels": leave})


def names_numbers(remedy: str) -> bool:
    """Return whether ``remedy`` names rows or electrodes, whose numbers another numbering would
    change."""
    return any(option in remedy for option in (*ROW_LISTS, "--swap"))


def combined_remedy(case: Case, remedies: Iterable[str]) -> str:
    """Return one set of options from those of several findings. Lists are merged, and no row is
    filled from a bad one."""
    lists: dict[str, set[int]] = {option: set() for option in ROW_LISTS}
    others: list[str] = []
    for remedy in remedies:
        words = remedy.split()
        while words:
            option = words.pop(0)
            value = words.pop(0) if words and not words[0].startswith("--") else ""
            if option in lists:
                lists[option] |= {int(number) for number in value.split(",")}
            elif (given := f"{option} {value}".strip()) not in others:
                others.append(given)
    gone = {
        row
        for row, electrodes in enumerate(case.rows.tolist())
        if lists["--drop-electrodes"].intersection(electrodes)
    }
    lists["--drop-channels"] -= gone
    lists["--impute-channels"] -= gone | lists["--drop-channels"]
    partner = partners(case.rows, case.n_electrodes)
    bad = lists["--impute-channels"] | lists["--drop-channels"]
    hopeless = {k for k in lists["--impute-channels"] if partner.get(k, (k, 1))[0] in bad}
    lists["--drop-channels"] |= hopeless
    lists["--impute-channels"] -= hopeless
    listed = _joined({option: sorted(values) for option, values in lists.items()})
    return " ".join([*others, *([listed] if listed else [])])


def _joined(lists: dict[str, list[int]]) -> str:
    return " ".join(
        f"{option} {','.join(map(str, values))}" for option, values in lists.items() if values
    )
