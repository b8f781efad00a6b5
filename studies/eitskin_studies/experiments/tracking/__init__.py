"""The worth of tracking touches in time: starts confirmed, ids held, places smoothed; on streams
of moving fingers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments.experiment import ExperimentOutcome, Table, Workspace
from eitskin_studies.experiments.tracking.counted import TrackCount, total
from eitskin_studies.experiments.tracking.measured import Measurer, choices, counts, ways
from eitskin_studies.experiments.tracking.streams import (
    FRAMES,
    RATE_HZ,
    TouchStream,
    passing_streams,
    random_streams,
)
from eitskin_studies.harness.summary import summarise

TITLE = "tracking with birth and death: counts, ids, places and latency of touches in streams"
SNRS_DB = (40, 50, 60)
SPEEDS_MM_S = (0, 50, 200)
STREAMS, TUNING_STREAMS, PASSING = 16, 10, 12
COUNT_HEAD = (
    "exact count, % (95 %)",
    "mean of worst 10 %",
    "false a frame",
    "missed a frame",
    "MOTA, %",
    "id switches a finger",
)
PLACE_HEAD = ("median mm", "p95 mm", "reported, frames late", "ended, frames late")

Counts = Mapping[tuple[int, int, str], list[TrackCount]]


def run(workspace: Workspace) -> ExperimentOutcome:
    """All tables and pictures."""
    from eitskin_studies.pictures.tracking_pictures import draw_stream_told, draw_worth

    measurer, settings = Measurer(workspace), workspace.settings
    streams = _streams(settings.seed, "test", settings.count(STREAMS))
    done: dict[tuple[int, int, str], list[TrackCount]] = {}
    for snr_db in SNRS_DB:
        for speed in SPEEDS_MM_S:
            for way in ways(measurer.model):
                done[snr_db, speed, way.name] = counts(
                    measurer, streams[speed], snr_db, way, f"{snr_db} dB, {way.name}"
                )
    names = tuple(way.name for way in ways(measurer.model))
    shown = max(streams[50], key=lambda one: sum(int(finger.there.sum()) for finger in one.samples))
    ends = [way for way in ways(measurer.model) if way.name in ("off", "all")]
    both = {way.name: measurer.reported(shown, SNRS_DB[0], way.options)[0] for way in ends}
    tables = (
        _by_speed(done), _by_part(done, names),
        _chosen(measurer, settings.tuning_seed, settings.count(TUNING_STREAMS)),
        _passing(measurer, settings.seed, settings.count(PASSING)),
    )  # fmt: skip
    return ExperimentOutcome(
        tables=tables,
        data=_data(done, tables),
        pictures={
            "stream.png": lambda path: draw_stream_told(
                path, shown, both, f"{SNRS_DB[0]} dB, {RATE_HZ:g} frames a second"
            ),
            "worth.png": lambda path: draw_worth(
                path, {key: total(value) for key, value in done.items()}, SNRS_DB, SPEEDS_MM_S
            ),
        },
        words={"set": _set(settings.seed, settings.count(STREAMS))},
    )


def _streams(seed: int, role: str, count: int) -> dict[int, tuple[TouchStream, ...]]:
    outline = paper_skin().outline
    return {speed: random_streams(outline, seed, role, speed, count) for speed in SPEEDS_MM_S}


def _by_speed(done: Counts) -> Table:
    rows = [
        (
            f"{snr_db}",
            f"{speed}",
            name,
            *_count_words(done[snr_db, speed, name]),
            *_place_words(done[snr_db, speed, name]),
        )
        for snr_db in SNRS_DB
        for speed in SPEEDS_MM_S
        for name in ("off", "all")
    ]
    return Table("tracking", ("SNR, dB", "mm/s", "tracking", *COUNT_HEAD, *PLACE_HEAD), tuple(rows))


def _by_part(done: Counts, names: Sequence[str]) -> Table:
    rows = []
    for snr_db in SNRS_DB:
        for name in names:
            together = [one for speed in SPEEDS_MM_S for one in done[snr_db, speed, name]]
            whole = total(together)
            rows.append(
                (
                    f"{snr_db}",
                    name,
                    *_count_words(together),
                    *_place_words(together),
                    f"{whole.macs / whole.frames / 1e3:.0f} k",
                )
            )
    return Table(
        "parts", ("SNR, dB", "tracking", *COUNT_HEAD, *PLACE_HEAD, "MACs a frame"), tuple(rows)
    )


def _chosen(measurer: Measurer, seed: int, count: int) -> Table:
    """On tuning streams, each choice changed alone; every number is what choosing looked at."""
    streams = [one for some in _streams(seed, "tuning", count).values() for one in some]
    rows = []
    for way in choices(measurer.model):
        row = [way.name]
        for snr_db in SNRS_DB:
            whole = total(
                counts(measurer, streams, snr_db, way, f"choosing, {snr_db} dB, {way.name}")
            )
            numbers = (
                100 * whole.exact / whole.frames,
                100 * whole.mota,
                np.quantile(_some(whole), 0.95),
            )
            row += [f"{number:.2f}" for number in numbers]
        rows.append(tuple(row))
    head = [
        f"{what}, {snr_db} dB" for snr_db in SNRS_DB for what in ("exact %", "MOTA %", "p95 mm")
    ]
    return Table("choices", ("changed", *head), tuple(rows))


def _passing(measurer: Measurer, seed: int, count: int) -> Table:
    """Two fingers that pass one another: who is who."""
    rows = []
    for snr_db in SNRS_DB:
        for speed in SPEEDS_MM_S[1:]:
            streams = passing_streams(seed, speed, count)
            by: dict[str, list[TrackCount]] = {}
            for way in ways(measurer.model):
                if way.name in ("off", "all"):
                    by[way.name] = counts(
                        measurer, streams, snr_db, way, f"passing, {snr_db} dB, {way.name}"
                    )
            for name, some in by.items():
                whole = total(some)
                found = f"{100 * (1 - whole.missed / whole.true):.1f}"
                rows.append(
                    (f"{snr_db}", f"{speed}", name, found, f"{whole.switches / whole.fingers:.2f}")
                )
    return Table(
        "passing", ("SNR, dB", "mm/s", "tracking", "found, %", "id switches a finger"), tuple(rows)
    )


def _count_words(some: list[TrackCount]) -> tuple[str, ...]:
    whole, exact = total(some), summarise([100 * one.exact / one.frames for one in some])
    return (
        f"{exact.mean:.1f} ({exact.low:.1f} to {exact.high:.1f})",
        f"{exact.worst_tenth:.1f}",
        f"{whole.false_touches / whole.frames:.3f}",
        f"{whole.missed / whole.frames:.3f}",
        f"{100 * whole.mota:.1f}",
        f"{whole.switches / whole.fingers:.2f}",
    )


def _place_words(some: list[TrackCount]) -> tuple[str, ...]:
    whole = total(some)
    errors, late, ghost = _some(whole), whole.late or [0], whole.ghost or [0]
    return (
        f"{np.median(errors):.2f}",
        f"{np.quantile(errors, 0.95):.2f}",
        f"{np.mean(late):.2f}"
        + (f" ({whole.never} of {whole.fingers} never)" if whole.never else ""),
        f"{np.mean(ghost):.2f}",
    )


def _some(count: TrackCount) -> list[float]:
    return count.errors_mm or [float("nan")]


def _set(seed: int, count: int) -> str:
    return (
        f"{count} streams a speed of {FRAMES} frames at {RATE_HZ:g} a second, seed {seed}, one to"
        " four fingers of 6 to 12 mm and contrast 3 to 10 that come, press within 2.5 frames,"
        " move, lift; simulated on another mesh of 11,000 elements, 12 bits."
    )


def _data(done: Counts, tables: Sequence[Table]) -> dict[str, Any]:
    cells = []
    for (snr_db, speed, name), some in done.items():
        facts = total(some).as_dict()
        errors = facts.pop("errors_mm") or [float("nan")]
        places = {"median_mm": float(np.median(errors)), "p95_mm": float(np.quantile(errors, 0.95))}
        cells.append(
            {
                "snr_db": snr_db,
                "speed_mm_s": speed,
                "tracking": name,
                **facts,
                **places,
                "mota": total(some).mota,
            }
        )
    return {
        "cells": cells,
        "tables": {table.name: [list(table.head), *map(list, table.rows)] for table in tables},
    }
