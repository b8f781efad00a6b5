"""Everything that the experiment measures, in the order of its page."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import GeometryError
from eitskin.scoring.matching import match
from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.multitouch import ceiling
from eitskin_studies.experiments.multitouch.ambiguity import (
    Rule,
    ScoredFrame,
    TouchScores,
    fit_rule,
    score_frame,
    touch_scores,
)
from eitskin_studies.experiments.multitouch.cells import (
    MIXED,
    NARROW,
    RING,
    WIDE,
    Cell,
    counting_cells,
    mixed_cells,
    single_cell,
    uneven_cells,
)
from eitskin_studies.experiments.multitouch.counts import Score, score
from eitskin_studies.experiments.multitouch.test_data import (
    CLASSICAL,
    CLASSICAL_SCENES,
    HEADLINE_DB,
    SNRS_DB,
    TouchData,
)
from eitskin_studies.experiments.multitouch.variants import VARIANTS, SeenFrame, TouchVariant
from eitskin_studies.harness.sessions import MeasuredFrames
from eitskin_studies.harness.snr import noise_deviation_v

CEILING_CELLS = (
    (WIDE, 6, 80.0), (WIDE, 8, 80.0), (WIDE, 12, 80.0), (NARROW, 3, 60.0), (NARROW, 5, 60.0),
    (NARROW, 8, 60.0),
    (RING, 8, 60.0), (RING, 10, 60.0), (RING, 12, 60.0),
)  # fmt: skip
CEILING_SCENES = 12


@dataclass(frozen=True)
class CountedScenes:
    """Scores by (geometry, touches, method, SNR in dB); ``unfit``: (geometry, touches) with why
    they cannot be drawn."""

    scores: dict[tuple[str, int, str, float], Score]
    unfit: dict[tuple[str, int], str]


@dataclass(frozen=True)
class Limit:
    """A cell's first scenes: how many the core has exactly, how many its fit that begins at the
    truth, how many the nonlinear fit that does; the nonlinear fit's worst place in the median
    scene, and what noise alone would give it, mm.
    """

    geometry: str
    touches: int
    snr_db: float
    scenes: int
    core: dict[str, int]
    told: dict[str, int]
    nonlinear: int
    worst_mm: float
    deviation_mm: float


@dataclass(frozen=True)
class Ambiguities:
    """Frames of every test cell and of the mixed test set, and each found touch of these, by
    variant; and the one rule that the tuning frames of all variants gave: the core has one."""

    rule: Rule
    cells: dict[str, list[ScoredFrame]]
    mixed: dict[str, list[ScoredFrame]]
    touches: dict[str, TouchScores]


def count_all(touch_data: TouchData, workspace: Workspace) -> CountedScenes:
    """The core at each SNR, and the classical methods at 60 dB."""
    counted = CountedScenes({}, {})
    for cell in workspace.progress(
        (*counting_cells(), single_cell(), *uneven_cells()), "counting touches"
    ):
        try:
            truths = touch_data.truths_mm(cell)
        except GeometryError as error:
            counted.unfit[cell.geometry, cell.touches] = str(error)
            continue
        for variant in VARIANTS:
            for snr_db in SNRS_DB:
                seen = touch_data.seen(cell, variant, snr_db)
                key = cell.geometry, cell.touches, variant.name, snr_db
                counted.scores[key] = score(
                    truths, [one.places_mm for one in seen], [one.macs for one in seen]
                )
        for name in CLASSICAL:
            found = touch_data.classical(cell, name)
            counted.scores[cell.geometry, cell.touches, name, HEADLINE_DB] = score(
                truths[:CLASSICAL_SCENES], found
            )
    return counted


def limits(touch_data: TouchData, workspace: Workspace) -> list[Limit]:
    """Return the results of ``CEILING_CELLS``; each one is kept."""
    found = []
    usual = {(cell.geometry, cell.touches): cell for cell in counting_cells()}
    for geometry, touches, snr_db in workspace.progress(CEILING_CELLS, "fitting from the truth"):
        cell, count = usual[geometry, touches], workspace.settings.count(CEILING_SCENES)
        facts = {
            **touch_data.facts("ceiling", cell, snr_db, False),
            "scenes": count,
            "variants": [v.facts() for v in VARIANTS],
        }
        found.append(
            Limit(
                **workspace.kept(
                    facts,
                    lambda cell=cell, snr=snr_db, n=count: asdict(  # type: ignore[misc]
                        _limit(touch_data, cell, snr, n)
                    ),
                )
            )
        )
    return found


def _limit(touch_data: TouchData, cell: Cell, snr_db: float, count: int) -> Limit:
    session, fits = touch_data.session(cell), ceiling.Truthful(touch_data.skin, touch_data.protocol)
    scenes, whole = session.touches.scenes[:count], session.measured(snr_db)
    measured = MeasuredFrames(whole.untouched_v, whole.frames_v[: len(scenes)])
    untouched_v, noise_v = (
        ceiling.untouched_mean(measured),
        noise_deviation_v(session.exact_untouched_v, snr_db),
    )
    fitted = [
        fits.fit(f, untouched_v, noise_v, s)
        for f, s in zip(measured.frames_v[:, -1], scenes, strict=True)
    ]
    core, told = {}, {}
    for variant in VARIANTS:
        seen = touch_data.seen(cell, variant, snr_db)[: len(scenes)]
        core[variant.name] = sum(
            match(s.centres_mm(), one.places_mm).exact for s, one in zip(scenes, seen, strict=True)
        )
        told[variant.name] = sum(ceiling.core_told(touch_data.model(variant), measured, scenes))
    return Limit(
        cell.geometry, cell.touches, snr_db, len(scenes), core, told,
        sum(one.exact for one in fitted),
        round(float(np.median([one.worst_mm for one in fitted])), 3),
        round(float(np.median([one.deviation_mm for one in fitted])), 4),
    )  # fmt: skip


def ambiguities(touch_data: TouchData, workspace: Workspace, counted: CountedScenes) -> Ambiguities:
    """The core's own signal on all that was counted, and on mixed scenes; the rule from mixed
    tuning scenes."""

    def frames(
        which: Sequence[Cell], variant: TouchVariant, tuning: bool = False
    ) -> list[ScoredFrame]:
        return [
            score_frame(seen, truth, snr_db, touch_data.seed_radius_mm(variant))
            for cell in which for snr_db in SNRS_DB for seen,
            truth in _pairs(touch_data, cell, variant, snr_db, tuning)
        ]  # fmt: skip

    cells = [
        c
        for c in (*counting_cells(), single_cell(), *uneven_cells())
        if (c.geometry, c.touches) not in counted.unfit
    ]
    parts = mixed_cells()
    found = Ambiguities(
        fit_rule([frame for variant in VARIANTS for frame in frames(parts, variant, tuning=True)]),
        {},
        {},
        {},
    )
    for variant in workspace.progress(VARIANTS, "judging doubt"):
        found.cells[variant.name], found.mixed[variant.name] = (
            frames(cells, variant),
            frames(parts, variant),
        )
        pairs = [
            pair
            for cell in parts
            for snr_db in SNRS_DB
            for pair in _pairs(touch_data, cell, variant, snr_db)
        ]
        found.touches[variant.name] = touch_scores(pairs)
    return found


def _pairs(
    touch_data: TouchData, cell: Cell, variant: TouchVariant, snr_db: float, tuning: bool = False
) -> list[tuple[SeenFrame, FloatArray]]:
    return list(
        zip(
            touch_data.seen(cell, variant, snr_db, tuning),
            touch_data.truths_mm(cell, tuning),
            strict=True,
        )
    )


def prepare_mixed(touch_data: TouchData, workspace: Workspace) -> None:
    """Solve and count mixed scenes part by part, so that an interrupted run continues with the next
    part."""
    for cell in workspace.progress(mixed_cells(), f"{MIXED} scenes"):
        for tuning in (True, False):
            for variant in VARIANTS:
                for snr_db in SNRS_DB:
                    touch_data.seen(cell, variant, snr_db, tuning)
