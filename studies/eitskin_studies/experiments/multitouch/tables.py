"""Tables of the measurements: shares in %, with their 95 % intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eitskin_studies.experiments.experiment import Table
from eitskin_studies.experiments.multitouch.cells import (
    GEOMETRIES,
    MAX,
    MIN,
    NARROW,
    RING,
    SINGLE,
    UNEVEN,
    UNEVEN_MAX,
    WIDE,
)
from eitskin_studies.experiments.multitouch.counts import Quantile, Score, Share
from eitskin_studies.experiments.multitouch.measure import CountedScenes, Limit
from eitskin_studies.experiments.multitouch.test_data import CLASSICAL, HEADLINE_DB, SNRS_DB
from eitskin_studies.experiments.multitouch.variants import VARIANTS

SHORT = {CLASSICAL[0]: "Gauss-Newton", CLASSICAL[2]: "plain FISTA 300"}
NAMES = tuple(variant.name for variant in VARIANTS)


@dataclass(frozen=True)
class Asked:
    """A share of exact scenes that is asked for: ``least``, or as an ``aim``."""

    text: str
    geometry: str
    touches: int
    snr_db: float
    share: float
    aim: bool


ASKED = (
    Asked("4 radii apart, 80 dB", WIDE, 6, 80.0, 0.90, False),
    Asked("4 radii apart, 80 dB", WIDE, 8, 80.0, 0.90, True),
    Asked("2.5 radii apart, 60 dB", NARROW, 3, 60.0, 0.90, False),
    Asked("2.5 radii apart, 60 dB", NARROW, 5, 60.0, 0.80, True),
    Asked("ring, 60 dB", RING, 8, 60.0, 0.90, False),
    Asked("ring, 60 dB", RING, 10, 60.0, 0.90, True),
)
MIN_MM, AIM_MM = (1.0, 2.5), (0.5, 1.0)  # median and p95 of one touch at 60 dB


def percent(share: Share, digits: int = 0) -> str:
    """ "94 (88 to 97)"; "-" of nothing."""
    if share.count == 0:
        return "-"
    return (
        f"{100 * share.mean:.{digits}f} ({100 * share.low:.{digits}f} to"
        f" {100 * share.high:.{digits}f})"
    )


def millimetres(value: Quantile) -> str:
    """ "0.52 (0.44 to 0.61)"; "-" of nothing."""
    return (
        "-"
        if math.isnan(value.value)
        else f"{value.value:.2f} ({value.low:.2f} to {value.high:.2f})"
    )


def kmac(score: Score) -> str:
    """ "1376 / 2310": mean and most."""
    return "-" if math.isnan(score.kmac) else f"{score.kmac:.0f} / {score.most_kmac:.0f}"


def verdict(value: float, best: float, worst: float, asked: float, more: bool = True) -> str:
    """Return whether a value meets its requirement, and whether its interval does so at its
    ``worst`` end, or only at its ``best``."""
    sign = 1 if more else -1
    if sign * value >= sign * asked:
        return "yes" if sign * worst >= sign * asked else "yes, but not its whole interval"
    return "no, but its interval reaches it" if sign * best >= sign * asked else "no"


def asked_table(counted: CountedScenes) -> Table:
    """Asked and measured."""
    rows = []
    for one in ASKED:
        for name in NAMES:
            score = counted.scores.get((one.geometry, one.touches, name, one.snr_db))
            if score is None:
                continue
            e = score.exact
            rows.append((
                f"exact count, {one.text}, {one.touches} touches",
                f"{'aim' if one.aim else 'at least'} {100 * one.share:.0f} %",
                name, f"{percent(e, 1)} %", str(e.count), kmac(score),
                verdict(e.mean, e.high, e.low, one.share),
            ))  # fmt: skip
    for name in NAMES:
        score = counted.scores[SINGLE, 1, name, HEADLINE_DB]
        for at, value, least, aim in zip(
            ("median", "p95"), (score.median_mm, score.p95_mm), MIN_MM, AIM_MM, strict=True
        ):
            for text, asked in (("at least", least), ("aim", aim)):
                rows.append((
                    f"position of one touch, 60 dB, {at}", f"{text} {asked:g} mm", name,
                    f"{millimetres(value)} mm",
                    str(score.recall.hits), kmac(score),
                    verdict(value.value, value.low, value.high, asked, more=False),
                ))  # fmt: skip
    return Table(
        "asked",
        ("what", "asked", "method", "measured (95 %)", "scenes", "kMAC, mean / most", "met"),
        tuple(rows),
    )


def exact_table(counted: CountedScenes, geometry: str, name: str) -> Table:
    """Exact counts over the number of touches: the core at each SNR, the classical methods at 60
    dB."""
    columns = [(method, snr_db) for method in NAMES for snr_db in SNRS_DB] + [
        (method, HEADLINE_DB) for method in CLASSICAL
    ]
    rows = []
    for k in range(MIN, MAX + 1):
        if (geometry, k) in counted.unfit:
            rows.append((str(k), "do not fit on this skin", *[""] * len(columns)))
            continue
        scores = [counted.scores[geometry, k, method, snr_db] for method, snr_db in columns]
        rows.append(
            (str(k), str(scores[0].exact.count), *(percent(score.exact) for score in scores))
        )
    head = (f"{SHORT.get(method, method)}, {snr_db:g} dB" for method, snr_db in columns)
    return Table(name, ("touches", "scenes", *head), tuple(rows))


def detail_table(counted: CountedScenes) -> Table:
    """More of the same at 60 dB: how many are right, found, false, and where."""
    rows = []
    for geometry in GEOMETRIES:
        for k in (2, 3, 5, 6, 7, 8, 10, 12):
            if (geometry, k) in counted.unfit:
                continue
            for method in (NAMES[0], *NAMES[1:], CLASSICAL[0]):
                rows.append(
                    (
                        geometry,
                        *_details(counted.scores[geometry, k, method, HEADLINE_DB], k, method),
                    )
                )
    return Table("detail", ("places", *DETAIL_HEAD), tuple(rows))


def uneven_table(counted: CountedScenes) -> Table:
    """Touches of radius 6 to 12 mm and contrast 3 to 10 at once, at 60 dB."""
    methods = (*NAMES, *CLASSICAL)
    rows = [
        _details(counted.scores[UNEVEN, k, method, HEADLINE_DB], k, method)
        for k in range(MIN, UNEVEN_MAX + 1) if (UNEVEN,
        k) not in counted.unfit for method in methods
    ]  # fmt: skip
    return Table("uneven", DETAIL_HEAD, tuple(rows))


DETAIL_HEAD = (
    "touches", "method", "exact", "count right", "touches found", "false a scene",
    "median error, mm", "p95, mm",
    "kMAC, mean / most",
)  # fmt: skip


def _details(score: Score, touches: int, method: str) -> tuple[str, ...]:
    return (
        str(touches), SHORT.get(method, method), percent(score.exact), percent(score.right),
        percent(score.recall),
        f"{score.false_a_scene:.2f}", millimetres(score.median_mm), millimetres(score.p95_mm),
        kmac(score),
    )  # fmt: skip


def single_table(counted: CountedScenes) -> Table:
    """Return the errors of the place of a single touch."""
    rows = []
    for method in (*NAMES, *CLASSICAL):
        for snr_db in SNRS_DB:
            score = counted.scores.get((SINGLE, 1, method, snr_db))
            if score is not None:
                rows.append((
                    SHORT.get(method, method), f"{snr_db:g}", percent(score.exact),
                    f"{score.false_a_scene:.2f}",
                    millimetres(score.median_mm), millimetres(score.p95_mm), kmac(score),
                ))  # fmt: skip
    head = (
        "method",
        "SNR, dB",
        "exact",
        "false a scene",
        "median error, mm",
        "p95, mm",
        "kMAC, mean / most",
    )
    return Table("single", head, tuple(rows))


def limit_table(limits: Sequence[Limit]) -> Table:
    """Return a table of the limits of the count."""
    rows = []
    for one in limits:
        ours = (f"{d[name]}/{one.scenes}" for name in NAMES for d in (one.core, one.told))
        rows.append((
            one.geometry, str(one.touches), f"{one.snr_db:g}", *ours,
            f"{one.nonlinear}/{one.scenes}", f"{one.worst_mm:.1f}",
            f"{one.deviation_mm:.2f}",
        ))  # fmt: skip
    told = (text for name in NAMES for text in (name, f"{name}, from the true places"))
    head = (
        "places",
        "touches",
        "SNR, dB",
        *told,
        "nonlinear, from there",
        "its worst touch, mm",
        "by noise alone, mm",
    )
    return Table("ceiling", head, tuple(rows))
