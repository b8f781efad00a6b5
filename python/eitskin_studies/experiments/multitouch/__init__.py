"""Two to twelve touches: counts, positions, and when the core says that it cannot tell (the paper's
Fig. 12 and Table 1)."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from eitskin_studies.experiments.experiment import Outcome, Workspace
from eitskin_studies.experiments.multitouch import doubt_tables, tables
from eitskin_studies.experiments.multitouch.cells import NARROW, RING, WIDE
from eitskin_studies.experiments.multitouch.gallery import gallery
from eitskin_studies.experiments.multitouch.lab import Lab
from eitskin_studies.experiments.multitouch.measure import (
    Counted,
    Doubts,
    Limit,
    count_all,
    doubts,
    limits,
    prepare_mixed,
)
from eitskin_studies.experiments.multitouch.words import closing, conditions

TITLE = "Many touches at once: how many, where, and when to say that it cannot be told"


def run(workspace: Workspace) -> Outcome:
    """All of it; what the workspace has kept is not computed again.

    Raises:
        FileError: the workspace's folder cannot be written.
        MissingExtraError: scipy or netgen is not installed.
    """
    from eitskin_studies.pictures import multitouch_pictures as pictures

    lab = Lab(workspace)
    prepare_mixed(lab, workspace)
    counted = count_all(lab, workspace)
    limited = limits(lab, workspace)
    doubted = doubts(lab, workspace, counted)
    examples = gallery(lab, workspace)
    made = (
        tables.asked_table(counted),
        tables.exact_table(counted, RING, "exact-ring"),
        tables.exact_table(counted, WIDE, "exact-4-radii"),
        tables.exact_table(counted, NARROW, "exact-2.5-radii"),
        tables.detail_table(counted),
        tables.single_table(counted),
        tables.uneven_table(counted),
        tables.limit_table(limited),
        doubt_tables.doubt_table(doubted),
        doubt_tables.rule_table(doubted),
        doubt_tables.chance_table(doubted),
        doubt_tables.confidence_table(doubted),
    )
    return Outcome(
        made,
        data(counted, limited, doubted),
        {
            "exact.png": lambda path: pictures.draw_counts(path, counted),
            "gallery.png": lambda path: pictures.draw_gallery(path, lab.skin, examples),
            "doubt.png": lambda path: pictures.draw_doubt(path, doubted),
            "confidence.png": lambda path: pictures.draw_confidence(path, doubted),
        },
        {"conditions": conditions(lab, workspace), "closing": closing(counted, limited, doubted)},
    )


def data(counted: Counted, limited: list[Limit], doubted: Doubts) -> dict[str, Any]:
    """Everything, for JSON."""
    return {
        "counts": [
            {
                "places": geometry,
                "touches": touches,
                "method": method,
                "snr_db": snr_db,
                **asdict(score),
            }
            for (geometry, touches, method, snr_db), score in counted.scores.items()
        ],
        "do not fit": [
            {"places": geometry, "touches": k, "why": why}
            for (geometry, k), why in counted.unfit.items()
        ],
        "ceiling": [asdict(one) for one in limited],
        "rule": asdict(doubted.rule),
        "reliability": {
            name: {
                snr: asdict(one) for snr, one in doubt_tables.reliabilities(doubted, name).items()
            }
            for name in doubted.mixed
        },
        "tables": {
            table.name: [dict(zip(table.head, row, strict=True)) for row in table.rows]
            for table in (doubt_tables.doubt_table(doubted), doubt_tables.confidence_table(doubted))
        },
    }
