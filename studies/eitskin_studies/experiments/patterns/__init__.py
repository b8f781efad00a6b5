"""Compare drive patterns with noise in volts, from the converter, or both, with one gain or a gain
for each row: by the bound of a touch's place, and by the product's touches."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from eitskin.frames.front_end import SOURCE_REACH_V
from eitskin_studies.experiments.experiment import ExperimentOutcome, Table, Workspace
from eitskin_studies.experiments.patterns.measuring import (
    BOUND,
    PATTERNS,
    SNR_DB,
    TESTED,
    TUNING,
    PatternNoise,
    Scan,
)
from eitskin_studies.experiments.patterns.noise import NOISES
from eitskin_studies.experiments.scored import number_text, share_text
from eitskin_studies.harness.commit import last_commit
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.harness.sections import AS_EVERYWHERE
from eitskin_studies.pictures.patterns_pictures import draw_patterns

TITLE = "drive patterns on 16 electrodes, by where the noise comes from"
SOURCES = ("python", "csrc", "studies/eitskin_studies/experiments/patterns")
SAID = (
    "Seed {seed}: the bound of the touches of {bound} scenes, the product on {tested} others, of 1"
    " to 3 random touches. For each cell mu, lambda, iterations and t are the best of 18 settings,"
    " on {tuning} scenes of seed {tuning_seed}. Sigma is {sigma:.3g} V at 1 mA, {snr:g} dB below"
    " rms(V0) of the adjacent pattern, in the first six rows; the last two have what the front end"
    " makes. No converter steps and no clipping; models without model errors; else "
    + AS_EVERYWHERE
    + ". Commit {commit}."
)


def run(workspace: Workspace) -> ExperimentOutcome:
    """The bounds, and the product with every pattern at every noise."""
    study = PatternNoise(workspace)
    bounds = study.bounds_mm()
    cells = [(name, noise) for noise in NOISES for name in PATTERNS]
    found = {cell: study.found(*cell) for cell in workspace.progress(cells, "product")}
    scans = [study.scan(name) for name in PATTERNS]
    limits = {
        noise: {name: float(np.median(bounds[noise][name])) for name in PATTERNS}
        for noise in NOISES
    }
    medians = {noise: {name: _median(found[name, noise]) for name in PATTERNS} for noise in NOISES}
    beyond = {name: study.beyond_range(name) for name in PATTERNS}
    settings, commit = workspace.settings, last_commit(SOURCES)
    said = SAID.format(
        seed=settings.seed, tuning_seed=settings.tuning_seed, sigma=study.sigma_v, snr=SNR_DB,
        bound=settings.count(BOUND), tested=settings.count(TESTED), tuning=settings.count(TUNING),
        commit=commit,
    )  # fmt: skip
    data = {
        "commit": commit,
        "seed": settings.seed,
        "sigma_v": study.sigma_v,
        "scans": [{**asdict(scan), "beyond_row_range": beyond[scan.pattern]} for scan in scans],
        "cells": [
            {
                "pattern": name,
                "noise": noise,
                "noise_rms_v": float(np.sqrt(np.mean(study.noise_v(name, noise) ** 2))),
                "bound_mm": _quantiles(bounds[noise][name]),
                "error_mm": _quantiles(_errors(found[name, noise])),
                "exact": float(np.mean(found[name, noise]["scores"]["exact"])),
                "image": float(np.mean(found[name, noise]["scores"]["image"])),
                "chosen": found[name, noise]["chosen"],
            }
            for name, noise in cells
        ],
    }
    return ExperimentOutcome(
        (
            _grid("bound", limits),
            _grid("product", medians),
            _details(found),
            _scans(scans, beyond),
        ),
        data,
        {"patterns.svg": Drawing(draw_patterns, {"bound": limits, "product": medians})},
        {"conditions": said, "best": _best(limits, medians)},
    )


def _errors(found: Mapping[str, Any]) -> list[float]:
    return [value for value in found["scores"]["error_mm"] if value is not None]


def _median(found: Mapping[str, Any]) -> float:
    errors = _errors(found)
    return float(np.median(errors)) if errors else float("nan")


def _quantiles(values: list[float]) -> dict[str, float]:
    if not values:
        return {"median": float("nan"), "p95": float("nan")}
    median, p95 = np.quantile(values, [0.5, 0.95])
    return {"median": float(median), "p95": float(p95)}


def _grid(name: str, values: Mapping[str, Mapping[str, float]]) -> Table:
    rows = []
    for noise, by_pattern in values.items():
        least = min(by_pattern.values())
        texts = [number_text(value) for value in by_pattern.values()]
        marked = [
            f"**{text}**" if value == least else text
            for text, value in zip(texts, by_pattern.values(), strict=True)
        ]
        rows.append((noise, *marked))
    return Table(name, ("noise", *PATTERNS), tuple(rows))


def _details(found: Mapping[tuple[str, str], Mapping[str, Any]]) -> Table:
    head = (
        "noise", "pattern", "mu, lambda, iterations, t", "place, median / p95, mm",
        "exact (95 %)", "image MIoU",
    )  # fmt: skip
    rows = []
    for (name, noise), one in found.items():
        quantiles, scores = _quantiles(_errors(one)), one["scores"]
        rows.append(
            (
                noise,
                name,
                ", ".join(f"{value:g}" for value in one["chosen"].values()),
                f"{number_text(quantiles['median'])} / {number_text(quantiles['p95'])}",
                share_text(scores["exact"]),
                number_text(float(np.mean(scores["image"]))),
            )
        )
    return Table("details", head, tuple(rows))


def _scans(scans: list[Scan], beyond: Mapping[str, float]) -> Table:
    head = (
        "pattern", "rows", "independent", "rms(V0), V at 1 mA", "greatest, V at 1 mA",
        f"source at .5 mA, of {SOURCE_REACH_V:g} V", "converter at .5 mA and gain 3, of 1.65 V",
        "resistors that suit: mA, gain", "rows out of range, gain per row",
    )  # fmt: skip
    rows = tuple(
        (
            scan.pattern,
            f"{scan.rows}",
            f"{scan.independent}",
            f"{scan.rms_v:.2f}",
            f"{scan.greatest_v:.2f}",
            f"{scan.source_v:.1f}",
            f"{1.5 * scan.greatest_v:.2f}",
            f"{1e3 * scan.front_end.current_a:.3f}, {scan.front_end.gain:.2f}",
            f"{100 * beyond[scan.pattern]:.1f} %",
        )
        for scan in scans
    )
    return Table("scans", head, rows)


def _best(
    limits: Mapping[str, Mapping[str, float]], medians: Mapping[str, Mapping[str, float]]
) -> str:
    """Say for each noise which pattern has the least bound, and with which the product is best."""
    said = []
    for noise in NOISES:
        limit, product = limits[noise], medians[noise]
        first, ours = min(limit, key=limit.__getitem__), min(product, key=product.__getitem__)
        said.append(
            f"- {noise}: the bound is smallest with {first}, {number_text(limit[first])} mm"
            f" (adjacent: {number_text(limit['adjacent'])}); the product's error is smallest with"
            f" {ours}, {number_text(product[ours])} mm (adjacent:"
            f" {number_text(product['adjacent'])})"
        )
    return "\n".join(said)
