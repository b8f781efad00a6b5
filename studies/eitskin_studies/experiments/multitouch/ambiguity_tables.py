"""Tables of the ambiguity: the present signal, the linear score, the numbers of each touch."""

from collections.abc import Sequence

import numpy as np

from eitskin_studies.experiments.experiment import Table
from eitskin_studies.experiments.multitouch.ambiguity import (
    FEATURES,
    ConfidenceCalibration,
    Reliability,
    ScoredFrame,
    calibration,
    reliability,
)
from eitskin_studies.experiments.multitouch.counts import auc
from eitskin_studies.experiments.multitouch.measure import Ambiguities
from eitskin_studies.experiments.multitouch.tables import NAMES, percent
from eitskin_studies.experiments.multitouch.test_data import SNRS_DB

HEAD = (
    "count right, not reported", "exact, not reported", "not reported", "count right, reported",
    "exact, reported",
    "wrong counts reported",
)  # fmt: skip


def ambiguity_table(ambiguities: Ambiguities) -> Table:
    """The core's ``crowded`` and the linear score on the same test frames."""
    rows = []
    for name in NAMES:
        for text, frames in (
            ("mixed", ambiguities.mixed[name]),
            ("cells", ambiguities.cells[name]),
        ):
            for snr_db in (*SNRS_DB, None):
                mine = [one for one in frames if snr_db in (None, one.snr_db)]
                at = "all" if snr_db is None else f"{snr_db:g}"
                rows.append((name, text, at, str(len(mine)), "crowded", *_cells(calibration(mine))))
                rows.append(
                    (
                        name,
                        text,
                        at,
                        str(len(mine)),
                        "score",
                        *_cells(calibration(mine, ambiguities.rule.says(mine))),
                    )
                )
    return Table("ambiguity", ("method", "set", "SNR, dB", "frames", "signal", *HEAD), tuple(rows))


def _cells(one: ConfidenceCalibration) -> tuple[str, ...]:
    return tuple(
        percent(share)
        for share in (
            one.right_not_said,
            one.exact_not_said,
            one.not_said,
            one.right_said,
            one.exact_said,
            one.wrong_said,
        )
    )


def rule_table(ambiguities: Ambiguities) -> Table:
    """The score's coefficients, as the core could take them."""
    rule = ambiguities.rule
    rows = [(text, f"{weight:.4g}") for text, weight in zip(FEATURES, rule.weights, strict=True)]
    rows += [("offset", f"{rule.offset:.4g}"), ("reported below a score of", f"{rule.bar:.3f}")]
    return Table("rule", ("feature", "coefficient"), tuple(rows))


def found_some(frames: Sequence[ScoredFrame]) -> list[ScoredFrame]:
    """Frames in which something was found: a score says nothing about the others."""
    return [one for one in frames if one.found > 0]


def reliabilities(ambiguities: Ambiguities, name: str) -> dict[str, Reliability]:
    """Return the calibration of the score's chances on test frames, by SNR in dB as text, and
    "all"."""
    result = {}
    for snr_db in (*SNRS_DB, None):
        mine = [one for one in found_some(ambiguities.mixed[name]) if snr_db in (None, one.snr_db)]
        exact = np.array([one.exact for one in mine], dtype=np.bool_)
        result["all" if snr_db is None else f"{snr_db:g}"] = reliability(
            ambiguities.rule.chances(mine), exact
        )
    return result


def chance_table(ambiguities: Ambiguities) -> Table:
    """How good the score's chances are."""
    rows = []
    for name in NAMES:
        for snr, one in reliabilities(ambiguities, name).items():
            mine = [
                f for f in found_some(ambiguities.mixed[name]) if snr in ("all", f"{f.snr_db:g}")
            ]
            exact = np.array([f.exact for f in mine], dtype=np.bool_)
            base = float(exact.mean()) if len(exact) else float("nan")
            area = auc(ambiguities.rule.scores(mine), exact)
            rows.append((name, snr, str(len(mine)), f"{100 * base:.0f}", f"{area:.3f}",
                f"{one.brier:.3f}",
                         f"{base * (1 - base):.3f}", f"{one.error:.3f}"))  # fmt: skip
    head = (
        "method",
        "SNR, dB",
        "frames",
        "exact, %",
        "area under ROC",
        "Brier score",
        "of the mean alone",
        "calibration error",
    )
    return Table("chance", head, tuple(rows))


def touch_score_table(ambiguities: Ambiguities) -> Table:
    """How well a touch's own numbers separate true from false touches."""
    rows = []
    for name in NAMES:
        one = ambiguities.touches[name]
        areas = (
            f"{auc(values, one.true):.3f}"
            for values in (one.explained, one.over_noise, one.strength)
        )
        rows.append((name, str(len(one.true)), str(int((~one.true).sum())), *areas))
    head = (
        "method",
        "found touches",
        "of these false",
        "explained",
        "its root over noise",
        "strength / greatest",
    )
    return Table("touch_scores", head, tuple(rows))
