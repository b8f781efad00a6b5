"""Tables of the measurements of the shapes."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from eitskin.fem.grid import grid_for
from eitskin.scoring.matching import GATE_MM
from eitskin_studies.experiments.experiment import Table
from eitskin_studies.experiments.scored import hits_mm, number_text, score_text, share_text
from eitskin_studies.experiments.shapes.example_drawings import hand_region
from eitskin_studies.experiments.shapes.variants import ShapeVariant
from eitskin_studies.harness.summary import summarise

SKINS_HEAD = (
    "shape, electrodes", "area, cm2", "rim, mm", "electrodes' part of it", "touch radii, mm",
    "rank, pixels of mm", "rms(V0), mV",
    "sensitivity over the greatest: median, lowest 10 %",
)  # fmt: skip
FOUND_HEAD = (
    "shape, electrodes", "t", "image MIoU (95 %)", "mean of worst 10 %", "perfect image",
    "discs MIoU", "exact count (95 %)", "false a scene",
    "position, median / p95, mm", "of the size", "kMAC, mean / most",
)  # fmt: skip
LOST_HEAD = (
    "shape, electrodes", "where", "touches", "found (95 %)", "noticed", "position, median, mm",
    "sensitivity there, median",
)  # fmt: skip


def all_tables(measured: Mapping[str, tuple[ShapeVariant, Mapping[str, Any]]]) -> tuple[Table, ...]:
    """The skins, and the touches that were found on them."""
    both = list(measured.values())
    return (
        Table("skins", SKINS_HEAD, tuple(_skin_row(*one) for one in both)),
        Table("found", FOUND_HEAD, tuple(_found_row(*one) for one in both)),
        Table("lost", LOST_HEAD, tuple(row for one in both for row in _lost_rows(*one))),
    )


def _skin_row(variant: ShapeVariant, result: Mapping[str, Any]) -> tuple[str, ...]:
    outline, electrodes, about = variant.skin.outline, variant.skin.electrodes, result["about"]
    low, high = variant.rules.radius_mm
    worst, middle = np.quantile(about["sensitivity_log10"], [0.1, 0.5])
    return (
        variant.name,
        f"{outline.area_mm2 / 100:.0f}",
        f"{outline.perimeter_mm:.0f}",
        f"{100 * electrodes.count * electrodes.width_mm / outline.perimeter_mm:.0f} %",
        f"{low:.1f} to {high:.1f}",
        f"{about['rank']}, {about['pixels']} of {about['pixel_mm']:.2f}",
        f"{about['rms_v0_mv']:.2f}",
        f"1 / {10**-middle:.0f}, 1 / {10**-worst:.0f}",
    )


def _found_row(variant: ShapeVariant, result: Mapping[str, Any]) -> tuple[str, ...]:
    scores, errors = result["scores"], hits_mm(result["scores"])
    image = summarise(scores["image"])
    size = 2 * np.sqrt(variant.skin.outline.area_mm2 / np.pi)
    median, p95 = np.quantile(errors, [0.5, 0.95]) if len(errors) else (np.nan, np.nan)
    return (
        variant.name,
        f"{result['t']:g}",
        score_text(image),
        number_text(image.worst_tenth),
        number_text(result["about"]["ceiling"]),
        number_text(summarise(scores["discs"]).mean),
        share_text(scores["exact"]),
        f"{np.mean(scores['false']):.2f}",
        f"{median:.1f} / {p95:.1f}",
        f"{100 * median / size:.1f} / {100 * p95 / size:.1f} %",
        f"{np.mean(scores['kmac']):.0f} / {np.max(scores['kmac']):.0f}",
    )


def _lost_rows(variant: ShapeVariant, result: Mapping[str, Any]) -> list[tuple[str, ...]]:
    scores, about = result["scores"], result["about"]
    errors, places = scores["error_mm"], np.array(scores["place_mm"]).reshape(-1, 2)
    where = variant.regions(places, about["deepest_mm"])
    pixels = variant.regions(grid_for(variant.skin.outline).centres_mm(), about["deepest_mm"])
    noticed = _noticed(variant, scores)
    rows: list[tuple[str, ...]] = []
    for region in sorted(set(where), key=where.count, reverse=True):
        mine = [error for error, place in zip(errors, where, strict=True) if place == region]
        hits = [error for error in mine if error is not None]
        seen = [
            value
            for value, place in zip(about["sensitivity_log10"], pixels, strict=True)
            if place == region
        ]
        there = [seen for seen, place in zip(noticed, where, strict=True) if place == region]
        rows.append(
            (
                variant.name,
                region,
                f"{len(mine)}",
                share_text([error is not None for error in mine]),
                f"{100 * np.mean(there):.0f} %",
                f"{np.median(hits):.1f}" if hits else "-",
                f"1 / {10 ** -float(np.median(seen)):.0f}" if seen else "-",
            )
        )
    return rows


def _noticed(variant: ShapeVariant, scores: Mapping[str, Any]) -> list[bool]:
    """Return for each true touch whether anything was found on the same finger, however far along
    it, or within twice the gate."""
    gate_mm = 2 * GATE_MM * variant.scale
    noticed = []
    for scene, place in zip(scores["scene"], scores["place_mm"], strict=True):
        found = [(x, y) for x, y, _ in scores["found"][scene]]
        same = variant.hand and hand_region([place])[0] in set(hand_region(found)) - {"palm"}
        noticed.append(same or any(math.dist(place, one) <= gate_mm for one in found))
    return noticed
