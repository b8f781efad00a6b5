"""Tables of the measurements of electrodes and patterns."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from eitskin.tuning.configuration import BASE_SAMPLES
from eitskin_studies.experiments.electrodes.measuring import (
    COUNTS,
    PAIR_MM,
    PatternCase,
    resolved_mm,
    scan_of,
    usual_case,
)
from eitskin_studies.experiments.electrodes.patterns import (
    PATTERNS,
    scan_ms,
    unique_rows,
    within_time,
)
from eitskin_studies.experiments.experiment import Table
from eitskin_studies.experiments.scored import hits_mm, number_text, score_text, share_text
from eitskin_studies.harness.summary import summarise

FOUND = (
    "mu, lambda, iterations, t", "image MIoU (95 %)", "mean of worst 10 %", "discs MIoU",
    "exact, 1 to 3 (95 %)",
    "exact, six apart (95 %)", "false a scene of six", "position, median / p95, mm",
    "pairs resolved from, mm", "kMAC, mean / most",
)  # fmt: skip
NOISE_HEAD = (
    "electrodes, pattern",
    "rows",
    "of them unique",
    "scan, ms",
    "rms(V0), mV",
    "rank",
    *FOUND,
)
TIME_HEAD = (
    "electrodes, pattern",
    "rows",
    "drives",
    "samples",
    "scan, ms",
    "sigma, relative",
    "rank",
    *FOUND,
)
RANKS_HEAD = ("electrodes", "rank", "pixels across", "p", "model, kB", *FOUND)
SCANS_HEAD = (
    "electrodes, pattern", "rows", "scan of 80 samples, ms", "of 20 samples, ms",
    "unique rows", "of 80 samples, ms", "of 20 samples, ms", "drives in 20.8 ms",
)  # fmt: skip

Results = Mapping[PatternCase, Mapping[str, Any]]


def all_tables(results: Results) -> tuple[Table, ...]:
    """Equal noise, equal time, ranks and grids, times of scans."""
    adjacent = [case for case in results if case.equal == "noise" and case.pattern == "adjacent"]
    swept = sorted(adjacent, key=lambda case: (case.electrodes, case.power, case.pixels, case.rank))
    main = {
        equal: [case for case in results if case.equal == equal and is_usual(case)]
        for equal in ("noise", "time")
    }
    return (
        Table(
            "noise", NOISE_HEAD, tuple(_noise_row(case, results[case]) for case in main["noise"])
        ),
        Table("time", TIME_HEAD, tuple(_time_row(case, results[case]) for case in main["time"])),
        Table("ranks", RANKS_HEAD, tuple(_rank_row(case, results[case]) for case in swept)),
        Table(
            "scans",
            SCANS_HEAD,
            tuple(_scan_row(count, pattern) for count in COUNTS for pattern in PATTERNS),
        ),
    )


def is_usual(case: PatternCase) -> bool:
    """Return whether a case has the rank and the grid that its number of electrodes has in the
    tables of patterns."""
    return case == usual_case(case.electrodes, case.pattern, case.equal)


def _name(case: PatternCase) -> str:
    return f"{case.electrodes}, {case.pattern}"


def _found(result: Mapping[str, Any]) -> tuple[str, ...]:
    scores, errors = result["scores"], hits_mm(result["scores"]["random"])
    image = summarise(scores["random"]["image"])
    median, p95 = np.quantile(errors, [0.5, 0.95]) if len(errors) else (np.nan, np.nan)
    reported, kmac = resolved_mm(scores), scores["random"]["kmac"]
    chosen = result["chosen"]
    return (
        ", ".join(f"{value:g}" for value in chosen.values()),
        score_text(image),
        number_text(image.worst_tenth),
        number_text(summarise(scores["random"]["discs"]).mean),
        share_text(scores["random"]["exact"]),
        share_text(scores["six"]["exact"]),
        f"{np.mean(scores['six']['false']):.2f}",
        f"{median:.1f} / {p95:.1f}",
        f"{reported:g}" if np.isfinite(reported) else f"beyond {PAIR_MM[-1]:g}",
        f"{np.mean(kmac):.0f} / {np.max(kmac):.0f}",
    )


def _noise_row(case: PatternCase, result: Mapping[str, Any]) -> tuple[str, ...]:
    scan = scan_of(case)
    unique = len(scan.protocol.reciprocal_pairs().first)
    head = (
        _name(case),
        f"{scan.protocol.n_rows}",
        f"{unique}",
        f"{scan.ms:.1f}",
        f"{result['rms_v0_mv']:.0f}",
        f"{case.rank}",
    )
    return (*head, *_found(result))


def _time_row(case: PatternCase, result: Mapping[str, Any]) -> tuple[str, ...]:
    scan = scan_of(case)
    drives = len(np.unique(scan.protocol.drive_measure[:, :2], axis=0))
    relative = (BASE_SAMPLES / scan.samples) ** 0.5
    head = (
        _name(case),
        f"{scan.protocol.n_rows}",
        f"{drives}",
        f"{scan.samples}",
        f"{scan.ms:.1f}",
        f"{relative:.2f}",
    )
    return (*head, f"{case.rank}", *_found(result))


def _rank_row(case: PatternCase, result: Mapping[str, Any]) -> tuple[str, ...]:
    head = (
        f"{case.electrodes}",
        f"{case.rank}",
        f"{case.pixels}",
        f"{case.power:g}",
        f"{result['model_bytes'] / 1000:.0f}",
    )
    return (*head, *_found(result))


def _scan_row(electrodes: int, pattern: str) -> tuple[str, ...]:
    whole = PATTERNS[pattern](electrodes)
    unique, fitting = unique_rows(whole), within_time(whole)
    times = [
        f"{scan_ms(scan.n_rows, samples):.1f}"
        for scan in (whole, unique)
        for samples in (BASE_SAMPLES, 20)
    ]
    left = "all" if fitting.every == 1 else f"every {fitting.every}th"
    fits = f"{left}, {fitting.samples} samples"
    return (
        f"{electrodes}, {pattern}",
        f"{whole.n_rows}",
        *times[:2],
        f"{unique.n_rows}",
        *times[2:],
        fits,
    )
