"""Fronts as ``tradeoff run`` makes them: what nothing beats, estimates, files of results."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from eitskin.errors import UsageError
from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import (
    FORMAT,
    MEASURED,
    PRESETS,
    SHORT_CELL,
    VERSION,
    Front,
    OperatingPoint,
    choose,
    default_point,
    load_front,
    named_preset,
)

RECORDED = Path(__file__).with_name("front.json")
SCORES = (
    "scenes", "image", "drawn", "discs", "exact_count", "position_mm", "force_error", "solve_macs",
    "touch_macs", "most_macs",
)  # fmt: skip


def recorded_front() -> Front:
    """The results that studies/results/tradeoff.md shows, and that the package ships in short.

    Raises:
        FileError, ConfigError: they are missing or damaged.
    """
    return load_front(RECORDED)


def chosen_presets(points: Sequence[OperatingPoint], board: str) -> dict[str, OperatingPoint]:
    """The point of each preset on ``board`` where the SNR is not known; none where no point
    fulfils it."""
    found, default = {}, default_point(points)
    for name in PRESETS:
        try:
            found[name] = choose(points, named_preset(name, board), default=default)
        except UsageError:
            continue
    return found


def as_dict(front: Front) -> dict[str, Any]:
    """A front as JSON values; :func:`eitskin.tuning.front.front_from` reads them."""
    points = [
        {"configuration": one.configuration.as_dict()}
        | {name: getattr(one, name) for name in (*MEASURED, "scores")}
        for one in front.points
    ]
    return {"format": FORMAT, "version": VERSION, "settings": front.settings, "points": points}


def to_json(values: dict[str, Any]) -> str:
    """JSON with a line a configuration, so that differences can be read."""
    points = values["points"]
    head = json.dumps({**values, "points": 0}, indent=1).removesuffix("0\n}")
    lines = (json.dumps(one, separators=(",", ":")) for one in points)
    return head + "[\n" + ",\n".join(lines) + "\n]}\n"


def kept_cells(front: Front) -> Front:
    """Return what is recorded: numbers to four decimals."""
    kept = []
    for one in front.points:
        scores = {
            name: {
                snr: {key: _rounded(score[key]) for key in SCORES} for snr, score in cells.items()
            }
            for name, cells in one.scores.items()
        }
        kept.append(OperatingPoint(**{**vars(one), "scores": scores}))
    return Front(front.settings, tuple(kept), front.where_from)


def in_short(front: Front) -> dict[str, Any]:
    """Return what the package ships of a recorded front: the part that ``recommend`` and
    ``--preset`` read. Configurations omit the keys that have their default; cells are numbers;
    other methods are left out."""
    usual = Configuration("").as_dict()
    points = []
    for one in front.points:
        settings = one.configuration.as_dict()
        points.append(
            {
                "configuration": {k: v for k, v in settings.items() if v != usual[k]},
                "threshold": one.threshold,
                "force_scale": one.force_scale,
                "costs": one.costs,
                "instructions": _only(one.instructions, ("kind", "mean", "most")),
                "host_us": _only(one.host_us, ("p50", "most")),
                "scores": {
                    name: {
                        snr: [_number(cell, key) for key in SHORT_CELL]
                        for snr, cell in cells.items()
                    }
                    for name, cells in one.scores.items()
                },
            }
        )
    settings = {name: value for name, value in front.settings.items() if name != "peers"}
    return {**as_dict(front), "settings": settings, "points": points}


def _only(values: dict[str, Any] | None, names: tuple[str, ...]) -> dict[str, Any] | None:
    return None if values is None else {name: values[name] for name in names}


def _number(cell: dict[str, Any], key: str) -> Any:
    """The number that ``key`` of ``SHORT_CELL`` names; of MACs the mean."""
    group, _, part = key.partition(".")
    value = cell[group][part] if part else cell[group]
    return value[0] if isinstance(value, list) else value


def _rounded(value: Any) -> Any:
    """Numbers to four decimals."""
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    return round(value, 4) if isinstance(value, float) else value


def pareto(
    points: Sequence[OperatingPoint],
    cost: Callable[[OperatingPoint], float | None],
    accuracy: Callable[[OperatingPoint], float | None],
    least_gain: float = 0.0,
) -> list[OperatingPoint]:
    """Return the points that no other beats: none that costs no more is as accurate, less
    ``least_gain``. The cheapest comes first."""
    known = [
        (c, -a, k)
        for k, p in enumerate(points)
        if (c := cost(p)) is not None and (a := accuracy(p)) is not None
    ]
    best = float("-inf")
    kept: list[OperatingPoint] = []
    for _, negative, k in sorted(known):
        if -negative > best + (least_gain if kept else 0.0):
            best = -negative
            kept.append(points[k])
    return kept


def estimated_instructions(
    points: Sequence[OperatingPoint], one: Configuration, macs: tuple[float, float]
) -> dict[str, Any] | None:
    """Instructions from MACs by the counted points of the same storage and solver (their mean
    instructions a MAC); None if there are none. An estimate, and called so."""
    same = [
        p.instructions["mean"] / p.instructions["macs_mean"]
        for p in points
        if p.instructions is not None
        and p.instructions["kind"] == "counted"
        and (p.configuration.storage, p.configuration.solver) == (one.storage, one.solver)
    ]
    if not same:
        return None
    ratio = sum(same) / len(same)
    rounded = {
        "mean": round(ratio * macs[0]),
        "most": round(ratio * macs[1]),
        "instructions_per_mac": round(ratio, 3),
    }
    return {"kind": "estimated", **rounded}
