"""Sentences with numbers in them, for the page's marks."""

from __future__ import annotations

from collections.abc import Sequence

from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, SIMULATED_ELEMENTS, Desk
from eitskin_studies.experiments.multitouch.cells import (
    GEOMETRIES,
    LEAST,
    MIXED_PARTS,
    MIXED_SCENES,
    MOST,
    RING,
    SINGLE,
    WIDE,
)
from eitskin_studies.experiments.multitouch.counts import Share
from eitskin_studies.experiments.multitouch.doubt import calibration
from eitskin_studies.experiments.multitouch.lab import CLASSICAL, HEADLINE_DB, TRAINING_PARTS, Lab
from eitskin_studies.experiments.multitouch.measure import Counted, Doubts, Limit
from eitskin_studies.experiments.multitouch.tables import NAMES, SHORT

PAPER_TOUCHES, GOOD = 7, 0.90


def conditions(lab: Lab, desk: Desk) -> str:
    """What all tables share."""
    settings = desk.settings
    mixed = MIXED_PARTS * settings.count(MIXED_SCENES, 3)
    methods = [(SHORT.get(name, name), lab.trained(name)) for name in CLASSICAL]
    trained = "; ".join(
        f"{name}: {one.value:g} and t' = {one.threshold:g}" for name, one in methods
    )
    return (
        f"Seed {settings.seed}; frames from a mesh of about {SIMULATED_ELEMENTS} elements, contacts"
        f" +-20 %, models and Jacobians from one of about {MODEL_ELEMENTS}. SNR as everywhere in"
        " these studies: 20 log10(rms(V0) / sigma) at 80 samples, a converter of 12 bits, from 70"
        " dB on of 16. The core has its models' own defaults; no threshold of it was chosen here."
        " The classical methods' parameter and threshold t' were chosen together, for most exact"
        f" counts, on {TRAINING_PARTS * settings.count(MIXED_SCENES, 3)} mixed tuning scenes at 60"
        f" dB (seed {settings.tuning_seed}): {trained}. The score of the last section was fitted on"
        f" {mixed} mixed tuning scenes at 40, 60 and 80 dB. Brackets are 95 % intervals: Wilson's"
        " for shares, bootstrap for errors."
    )


def closing(counted: Counted, limited: Sequence[Limit], doubted: Doubts) -> str:
    """What agrees with the paper, what not, and why."""
    parts = [_agreement(counted, name) for name in NAMES]
    single = counted.scores[SINGLE, 1, NAMES[0], HEADLINE_DB]
    told = {name: sum(one.told[name] for one in limited) for name in NAMES}
    core = {name: sum(one.core[name] for one in limited) for name in NAMES}
    whole = sum(one.scenes for one in limited)
    seen = "; ".join(
        f"{name} {core[name]} as it is and {told[name]} when told where the touches are"
        for name in NAMES
    )
    parts.append(
        f"One touch at 60 dB is found within {single.median_mm.value:.2f} mm (median). Of {whole}"
        f" frames of the ceiling's cells the core has exactly: {seen}; the nonlinear fit that is"
        f" told has {sum(one.nonlinear for one in limited)}."
    )
    for name in NAMES:
        frames = [one for one in doubted.mixed[name] if one.snr_db >= HEADLINE_DB]
        now, new = calibration(frames), calibration(frames, doubted.rule.says(frames))
        parts.append(
            f"{name}, mixed test scenes at 60 and 80 dB: `crowded` is not said of"
            f" {_pc(now.not_said)} of the frames, and of these {_pc(now.right_not_said)} have the"
            f" right count; the score passes {_pc(new.not_said)}, and of these"
            f" {_pc(new.right_not_said)}."
        )
    return "\n".join(f"- {part}" for part in parts)


def _agreement(counted: Counted, name: str) -> str:
    """How far a method counts in each geometry at 60 dB."""
    far = "; ".join(f"{geometry}: {_far(counted, geometry, name)}" for geometry in GEOMETRIES)
    ring, wide = (
        counted.scores.get((geometry, PAPER_TOUCHES, name, HEADLINE_DB))
        for geometry in (RING, WIDE)
    )
    seven = ", ".join(
        f"{_pc(score.exact)} {text}"
        for score, text in ((ring, "on the ring"), (wide, "4 radii apart"))
        if score
    )
    return (
        f"{name}: the paper's {PAPER_TOUCHES} touches are counted exactly in {seven} at 60 dB. Most"
        f" touches up to which at least {100 * GOOD:.0f} % of the scenes are exact: {far}."
    )


def _far(counted: Counted, geometry: str, name: str) -> str:
    most = LEAST - 1
    for k in range(LEAST, MOST + 1):
        score = counted.scores.get((geometry, k, name, HEADLINE_DB))
        if score is None or score.exact.mean < GOOD:
            break
        most = k
    return str(most)


def _pc(share: Share) -> str:
    return (
        f"{100 * share.mean:.0f} % ({100 * share.low:.0f} to {100 * share.high:.0f})"
        if share.count
        else "none"
    )
