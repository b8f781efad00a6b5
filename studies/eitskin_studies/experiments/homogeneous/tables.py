"""The results as tables, sentences and plain values."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_studies.experiments.experiment import ExperimentSettings, Table
from eitskin_studies.experiments.homogeneous.cases import INSTRUMENT, UNTOUCHED_FRAMES
from eitskin_studies.experiments.homogeneous.measured import FILE, SOURCE
from eitskin_studies.experiments.homogeneous.uniformity import Uniformity
from eitskin_studies.harness.summary import summarise

MEASURES = ("spread", "worst", "reciprocity", "mirror")
HEAD = (
    "what is uneven",
    "spread over drives",
    "largest at a position",
    "reciprocity",
    "mirror",
    "sessions",
)


@dataclass(frozen=True, eq=False)
class Row:
    """A case in all its sessions.

    Attributes:
        folded_v: (s, drives, positions) mean untouched frames in V.
        uniformities: of each session.
        findings: (name, severity) of each session.
        measured: the doctor's numbers of each session.
        fault: whether something is broken.
    """

    name: str
    folded_v: FloatArray
    uniformities: tuple[Uniformity, ...]
    findings: tuple[tuple[tuple[str, str], ...], ...]
    measured: tuple[Mapping[str, Any], ...]
    fault: bool = False

    def values(self, measure: str) -> list[float]:
        """Return the values of each session, in percent."""
        return [float(getattr(one, measure)) for one in self.uniformities]

    def said(self) -> str:
        """The doctor's findings with the number of sessions that have each: "swapped-electrodes
        (fault) 8 of 8"."""
        count = Counter(name for one in self.findings for name in sorted(set(one)))
        if not count:
            return "nothing"
        return ", ".join(
            f"{name} ({severity}) {k} of {len(self.findings)}"
            for (name, severity), k in count.most_common()
        )


def tables(rows: Sequence[Row]) -> tuple[Table, ...]:
    """The evenness of each case, and the doctor's findings."""
    even = tuple(
        (row.name, *(_interval(row.values(m)) for m in MEASURES), str(len(row.uniformities)))
        for row in rows
    )
    said = tuple((row.name, row.said(), _doctors_numbers(row)) for row in rows)
    return (
        Table("uniformity", HEAD, even),
        Table(
            "doctor",
            (
                "what is uneven",
                "the doctor finds",
                "and measures, median: gains' spread, reciprocity, SNR",
            ),
            said,
        ),
    )


def words(
    rows: Sequence[Row], settings: ExperimentSettings, sessions: int, measured: bool
) -> dict[str, str]:
    """The conditions, and whether a measured tank is among the rows."""
    usual = next(row for row in rows if row.name == INSTRUMENT)
    broken = [row for row in rows if row.fault]
    named = sum(_faulty(row) for row in broken)
    seed = 1000 * settings.seed
    conditions = (
        f"{sessions} sessions for each line (one for the line without any effect), seeds {seed} to"
        f" {seed + sessions - 1}, each with contacts, places, gains and noise of its own; means of"
        f" {UNTOUCHED_FRAMES} frames; numbers in percent. The simulated skins have contacts that"
        " differ by 20 %, noise of 60 dB and 12 bits, and each line adds the one thing that it"
        " names."
    )
    reading = (
        f"An instrument with nothing wrong has a spread of {np.mean(usual.values('spread')):.2f} %."
        f" The doctor names a fault in {named} of {sum(len(row.findings) for row in broken)}"
        f" sessions with something broken, and in {_faulty(usual)} of {len(usual.findings)} of that"
        " instrument."
    )
    tank = (
        f"`{FILE}` in the folder of `--data` is the saline reference of {SOURCE}: one frame, so its"
        " noise is unknown."
        if measured
        else f"The measured tank was left out: run with `--data FOLDER`, a folder with `{FILE}`."
    )
    return {"conditions": conditions, "reading": reading, "measured": tank}


def data(rows: Sequence[Row]) -> dict[str, Any]:
    """Everything, for JSON."""
    return {
        "cases": [
            {
                "name": row.name,
                "uniformity_percent": [vars(one) for one in row.uniformities],
                "findings": [[list(finding) for finding in one] for one in row.findings],
                "doctor": [dict(one) for one in row.measured],
                "folded_v": row.folded_v.tolist(),
            }
            for row in rows
        ]
    }


def _faulty(row: Row) -> int:
    """In how many sessions the doctor names a fault."""
    return sum(any(severity == "fault" for _, severity in one) for one in row.findings)


def _interval(values: Sequence[float]) -> str:
    of = summarise(values)
    return f"{of.mean:.2f}" if of.count == 1 else f"{of.mean:.2f} [{of.low:.2f}, {of.high:.2f}]"


def _doctors_numbers(row: Row) -> str:
    reported = []
    for key, form in (
        ("gain_spread", "{:.1%}"),
        ("reciprocity_rms", "{:.2%}"),
        ("snr_db", "{:.1f} dB"),
    ):
        values = [one[key] for one in row.measured if one.get(key) is not None]
        reported.append(form.format(float(np.median(values))).replace("%", " %") if values else "-")
    return ", ".join(reported)
