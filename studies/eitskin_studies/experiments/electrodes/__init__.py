"""More electrodes and other patterns on the paper's disk, at equal noise of a row and at equal time
of a frame."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from eitskin_studies.experiments.electrodes.measuring import (
    COUNTS,
    PAIR_MM,
    PAIRS,
    RANDOM,
    SIX,
    SNR_DB,
    TUNING,
    TUNING_SIX,
    PatternCase,
    PatternWorkspace,
    noise_v,
    scan_of,
    usual_case,
)
from eitskin_studies.experiments.electrodes.patterns import PATTERNS
from eitskin_studies.experiments.electrodes.tables import all_tables, is_usual
from eitskin_studies.experiments.electrodes.tuning import ITERATIONS, LAMBDAS, REGULARISATIONS
from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.scored import number_text
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.harness.sections import AS_EVERYWHERE
from eitskin_studies.harness.summary import summarise
from eitskin_studies.pictures.electrodes_pictures import Bar, draw_counts, draw_patterns

TITLE = "16, 32 and 64 electrodes and skip patterns, at equal noise and at equal time"
SWEEP = {16: (64, 104), 32: (64, 128, 192), 64: (64, 128, 192)}
GRIDS = (32, 40)
TRIES = len(REGULARISATIONS) * len(LAMBDAS) * len(ITERATIONS)
SAID = (
    "Seed {seed}: {random} scenes of 1 to 3 random touches, {six} of six touches of radius 9 mm at"
    " least 36 mm apart, {pairs} pairs of radius 9 mm at each distance. For each row mu, lambda and"
    " iterations are the best of {tries} settings, by image MIoU + disc MIoU + exact count, and t"
    " the best by image MIoU, on scenes of seed {tuning_seed} ({tuning} of 1 to 3 touches,"
    " {tuning_six} of six). Noise: sigma = {sigma:.3g} V in a row of 80 samples, {snr:g} dB below"
    " rms(V0) of 16 adjacent electrodes, the same for every pattern; no converter; else "
    + AS_EVERYWHERE
    + "."
)


def cases() -> list[PatternCase]:
    """Everything that is measured: patterns at equal noise and equal time, then ranks, grids and
    columns' weights."""
    usual = [
        usual_case(count, pattern, equal)
        for equal in ("noise", "time")
        for count in COUNTS
        for pattern in PATTERNS
    ]
    swept = [
        PatternCase(count, "adjacent", "noise", rank, pixels)
        for count in COUNTS
        for pixels in GRIDS
        for rank in SWEEP[count]
    ]
    flat = [
        PatternCase(count, "adjacent", "noise", max(SWEEP[count]), power=1.0) for count in COUNTS
    ]
    return list(dict.fromkeys([*usual, *swept, *flat]))


def run(workspace: Workspace) -> ExperimentOutcome:
    """Every case; scenes are solved once a number of electrodes."""
    shops = {count: PatternWorkspace(workspace, count) for count in COUNTS}
    sigma_v = noise_v(workspace)
    ordered = sorted(cases(), key=lambda case: case.electrodes)
    measured = {
        case: shops[case.electrodes].measured(case, sigma_v)
        for case in workspace.progress(ordered, "scans and models")
    }
    results = {case: measured[case] for case in cases()}
    bars = [_bar(case, result) for case, result in results.items() if is_usual(case)]
    settings = workspace.settings
    usual = {
        "random": RANDOM,
        "six": SIX,
        "pairs": PAIRS,
        "tuning": TUNING,
        "tuning_six": TUNING_SIX,
    }
    facts = {name: settings.count(count) for name, count in usual.items()} | {
        "seed": settings.seed,
        "tries": TRIES,
    }
    said = SAID.format(tuning_seed=settings.tuning_seed, sigma=sigma_v, snr=SNR_DB, **facts)
    data = [{"case": asdict(case), "samples": scan_of(case).samples,
        "rows": scan_of(case).protocol.n_rows, **result}
            for case, result in results.items()]  # fmt: skip
    return ExperimentOutcome(
        all_tables(results),
        {"seed": settings.seed, "noise_v": sigma_v, "cases": data},
        {
            "counts.svg": Drawing(draw_counts, [asdict(bar) for bar in bars]),
            "patterns.svg": Drawing(draw_patterns, [asdict(bar) for bar in bars]),
        },
        {"conditions": said, "best": _best(bars)},
    )


def _best(bars: Sequence[Bar]) -> str:
    """The best image at equal noise and at equal time, beside the usual scan's, in a sentence
    each."""
    said = []
    for equal, words in (("noise", "At equal noise"), ("time", "At equal time")):
        mine = [bar for bar in bars if bar.equal == equal]
        best = max(mine, key=lambda bar: bar.miou)
        usual = next(
            bar for bar in mine if (bar.electrodes, bar.pattern) == (COUNTS[0], "adjacent")
        )
        ours, theirs = (
            f"{number_text(one.miou)} ({number_text(one.low)} to {number_text(one.high)})"
            for one in (best, usual)
        )
        said.append(
            f"{words} the best of {len(mine)} images is that of {best.electrodes} electrodes,"
            f" {best.pattern}: {ours}. {usual.electrodes} adjacent electrodes have {theirs}."
        )
    return " ".join([*said, "The best of many results is always a little too good."])


def _bar(case: PatternCase, result: Any) -> Bar:
    scores = result["scores"]
    image = summarise(scores["random"]["image"])
    six = float(np.mean(scores["six"]["exact"]))
    pairs = tuple(
        (distance, float(np.mean(scores[f"pair {distance:g}"]["exact"]))) for distance in PAIR_MM
    )
    return Bar(
        case.electrodes, case.pattern, case.equal, image.mean, image.low, image.high, six, pairs
    )
