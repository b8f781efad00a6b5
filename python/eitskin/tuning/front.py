"""Measured points, and which of them to choose for a budget or an accuracy."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, fields
from importlib import resources
from pathlib import Path
from typing import Any

from eitskin.config import nearest
from eitskin.device.bank import BANK_BYTES, RECORD_BYTES
from eitskin.device.settings import SolverSettings
from eitskin.errors import ConfigError, FileError, UsageError
from eitskin.fileio import parse_json, read_bytes
from eitskin.tuning.configuration import Configuration, configuration_from
from eitskin.tuning.report_time import report_us

FORMAT, VERSION = "eitskin-tradeoff", 1
SHIPPED = "front.json"
F767_MHZ = 216
F767_RAM = 256 * 1024  # the linker script promises the workspace as much
DEFAULT_PERIOD_US = 20_800  # of the default scan
REPORT_US = "report_us"
MIN_SWEEPS = Configuration.touch_sweeps  # fewer save little, and at the cost of the discs
MEASURED = ("threshold", "force_scale", "costs", "instructions", "host_us")
SHORT_CELL = (
    "image.mean", "image.low", "image.high", "image.worst_tenth", "discs.mean", "exact_count",
    "solve_macs", "touch_macs", "most_macs",
)  # fmt: skip
MODEL_HOLDS = {"solver", "iterations", "lambda_rel", "touch_fit"}  # of the solver's settings


@dataclass(frozen=True)
class Budget:
    """A bound of a frame's solve and touches, ``unit`` "us", "MACs" or "instructions", or of the
    time from contact to report, "report_us"."""

    value: float
    unit: str

    def __str__(self) -> str:
        if self.unit.endswith("us"):
            return f"{self.value / 1000:.3g} ms"
        return f"{self.value / 1e6:.3g} million {self.unit}"


UNITS = {
    "us": (1.0, "us"), "ms": (1e3, "us"), "s": (1e6, "us"),
    "macs": (1.0, "MACs"), "kmacs": (1e3, "MACs"), "mmacs": (1e6, "MACs"),
    "instructions": (1.0, "instructions"), "kinstructions": (1e3, "instructions"),
    "minstructions": (1e6, "instructions"),
}  # fmt: skip


def read_budget(text: str) -> Budget:
    """A budget from "10ms", "800us", "600kMACs" or "2.5Minstructions"."""
    match = re.fullmatch(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?)\s*([A-Za-z]+)", text.strip())
    unit = None if match is None else match.group(2).lower()
    unit = unit if unit in UNITS or unit is None else f"{unit}s"
    if match is None or unit not in UNITS or not 0 < float(match.group(1)) < 1e15:
        raise UsageError(
            f"--budget {text}: give a number above 0 and a unit: 10ms, 800us, 600kMACs or"
            " 2.5Minstructions"
        )
    factor, kind = UNITS[unit]
    return Budget(float(match.group(1)) * factor, kind)


@dataclass(frozen=True, eq=False)
class Point:
    """A configuration as measured.

    Attributes:
        threshold, force_scale: what was trained.
        costs: ``flash_bytes``, ``ram_bytes``, ``pixels_kept``, ``acquisition_us``.
        instructions: of solve and touches on the Cortex-M7: ``kind`` ("counted" or "estimated"),
            ``mean``, ``most``...; or None.
        host_us: ``p50``, ``p99`` and ``most`` (``host_times``) of solve and touches; or None.
        scores: by set, then by SNR in dB as text.
    """

    configuration: Configuration
    threshold: float
    force_scale: float
    costs: dict[str, Any]
    instructions: dict[str, Any] | None
    host_us: dict[str, Any] | None
    scores: dict[str, dict[str, dict[str, Any]]]

    @property
    def name(self) -> str:
        """The configuration's."""
        return self.configuration.name

    def score(self, where: Conditions) -> dict[str, Any] | None:
        """The scores on a set at an SNR; None where that was not measured."""
        return self.scores.get(where.scenes, {}).get(f"{where.snr_db:g}")

    def accuracy(self, where: Conditions) -> float | None:
        """Mean MIoU there."""
        score = self.score(where)
        return None if score is None else float(score[where.judged]["mean"])

    def macs(self, where: Conditions) -> tuple[float, float] | None:
        """Mean and most MACs of solve and touches there."""
        score = self.score(where)
        if score is None:
            return None
        return score["solve_macs"][0] + score["touch_macs"][0], score["most_macs"]

    def cost(self, unit: str, board: str, where: Conditions, worst: bool = False) -> float | None:
        """Solve and touches of a frame in ``unit``: the mean (host: the median), or of the
        costliest frame that was counted or timed; None if unknown. ``report_us``: from contact to
        report (tuning.report_time). Times of the F767 are estimates:
        an instruction a cycle."""
        if unit == REPORT_US:
            solve_us = self.cost("us", board, where, worst)
            scan_us = float(self.costs["acquisition_us"])
            return None if solve_us is None else report_us(scan_us, solve_us, board)
        if unit == "MACs":
            macs = self.macs(where)
            return None if macs is None else macs[worst]
        if unit == "us" and board == "host":
            return None if self.host_us is None else float(self.host_us["most" if worst else "p50"])
        if self.instructions is None:
            return None
        return float(self.instructions["most" if worst else "mean"]) / (
            1 if unit == "instructions" else F767_MHZ
        )

    @property
    def fits_f767(self) -> bool:
        """Whether flash and RAM of the NUCLEO-F767ZI hold model and workspace, and model and SOLVER
        command the settings."""
        fits = self.costs["flash_bytes"] <= BANK_BYTES - RECORD_BYTES
        fits = bool(fits and self.costs["ram_bytes"] <= F767_RAM)
        return fits and not unusual(self.configuration) - MODEL_HOLDS - board_takes()


def unusual(one: Configuration) -> set[str]:
    """The names of the solver's settings in which ``one`` differs from the defaults."""
    usual = Configuration("").solver_settings
    return {name for name, value in one.solver_settings.items() if value != usual.get(name)}


def board_takes() -> set[str]:
    """The names of the solver's settings that a board can be told."""
    return {one.name for one in fields(SolverSettings)}


@dataclass(frozen=True)
class Conditions:
    """What accuracy means: which scenes, at which SNR, and whether images or discs are judged."""

    scenes: str = "random"
    snr_db: float = 60.0
    judged: str = "image"

    def __str__(self) -> str:
        return f"{self.judged} MIoU, {self.scenes} at {self.snr_db:g} dB"


@dataclass(frozen=True, eq=False)
class Front:
    """A file of results: what was measured under which ``settings``."""

    settings: dict[str, Any]
    points: tuple[Point, ...]
    where_from: str = "the shipped results"


def _cell(cell: Any) -> dict[str, Any]:
    """The scores of a set at an SNR: as they are, or from the numbers of the shipped results, which
    are in the order of ``SHORT_CELL``."""
    if isinstance(cell, dict):
        return cell
    scores: dict[str, Any] = {}
    for name, value in zip(SHORT_CELL, cell, strict=True):
        group, _, part = name.partition(".")
        if group in ("image", "discs"):
            scores.setdefault(group, {})[part] = value
        else:
            scores[group] = [value] if group in ("solve_macs", "touch_macs") else value
    return scores


def front_from(values: Any, where: str) -> Front:
    """Results from JSON values."""
    try:
        if values["format"] != FORMAT or values["version"] != VERSION:
            raise KeyError("format")
        points = []
        for one in values["points"]:
            parts = {name: one[name] for name in MEASURED}
            scores = {
                name: {snr: _cell(cell) for snr, cell in cells.items()}
                for name, cells in one["scores"].items()
            }
            configuration = configuration_from(one["configuration"], where)
            points.append(Point(configuration, **parts, scores=scores))
        return Front(dict(values["settings"]), tuple(points), where)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise ConfigError(
            f"{where}: no results of  eitskin tradeoff run  of version {VERSION}; run it again"
        ) from None


def load_front(path: Path | None = None) -> Front:
    """The results in ``path``, or those that ship with the package."""
    if path is not None:
        try:
            return front_from(parse_json(read_bytes(path, "results file")), str(path))
        except ValueError:
            raise ConfigError(
                f"{path}: not JSON; name the front.json that  eitskin tradeoff run  wrote"
            ) from None
    try:
        text = resources.files("eitskin.tuning").joinpath(SHIPPED).read_text(encoding="utf-8")
    except OSError:
        raise FileError(
            "the shipped results of  eitskin tradeoff run  are missing from this installation; name"
            " others with  --front"
        ) from None
    return front_from(json.loads(text), "the shipped results")


@dataclass(frozen=True)
class Target:
    """What is asked for: at most ``budget``, for the mean frame or the ``worst``, at least
    ``accuracy``, on ``board``; a frame measured within ``period_us``. ``compared_in``:
    in which unit cost is compared where there is no budget; ``name``: of a preset."""

    budget: Budget | None
    accuracy: float | None
    board: str
    where: Conditions
    period_us: float | None = None
    worst: bool = False
    compared_in: str = "us"
    name: str = ""

    @property
    def unit(self) -> str:
        """In which cost is compared."""
        return self.compared_in if self.budget is None else self.budget.unit

    @property
    def acquisition_us(self) -> float:
        """How long measuring may take: the period, or without one the longer of the budget and the
        default scan; any time where reports are compared, which it is part of."""
        if self.period_us is not None or self.unit == REPORT_US:
            return self.period_us or math.inf
        longest = self.budget.value if self.budget is not None and self.budget.unit == "us" else 0.0
        return max(longest, DEFAULT_PERIOD_US)


# What a preset asks for: the soonest report with the paper's .84; the most accurate whose report
# comes within so many ms of contact; the most accurate of all.
PRESET_ACCURACY = {"fast": 0.84}
PRESET_REPORT_MS = {"balanced": 45.0, "accurate": 1e6}
PRESETS = (*PRESET_ACCURACY, *PRESET_REPORT_MS)


def preset(name: str, board: str, where: Conditions | None = None) -> Target:
    """What the preset ``name`` asks for on ``board``."""
    if name not in PRESETS:
        raise UsageError(f"preset {name}: {nearest(name, PRESETS)}")
    ms = PRESET_REPORT_MS.get(name)
    budget = None if ms is None else Budget(1000 * ms, REPORT_US)
    accuracy = PRESET_ACCURACY.get(name)
    place = where or Conditions()
    return Target(budget, accuracy, board, place, compared_in=REPORT_US, name=name)


def check_wish(target: Target) -> Target:
    """``target`` if it can be."""
    if target.budget is None and target.accuracy is None:
        raise UsageError(
            "name what to choose by:  --preset balanced,  --budget 10ms  or  --accuracy 0.86"
        )
    if target.accuracy is not None and not 0 < target.accuracy < 1:
        raise UsageError(f"--accuracy {target.accuracy:g} is an MIoU; use above 0 to below 1")
    if target.period_us is not None and not target.period_us > 0:
        raise UsageError("--period must be above 0")
    if target.board == "host" and target.unit == "instructions":
        raise UsageError(
            "instructions are counted on the Cortex-M7; use a time or MACs for the host, or "
            " --board f767"
        )
    return target


def choose(points: Iterable[Point], target: Target, what: str = "measured point") -> Point:
    """With a budget the most accurate point within it; with an accuracy the cheapest that reaches
    it; with both the cheapest that does both. Points that save on the fit of touches are left out.
    ``what`` names the points in the refusal."""
    known = []
    for one in points:
        cost = one.cost(target.unit, target.board, target.where, target.worst)
        accuracy = one.accuracy(target.where)
        fits = target.board == "host" or one.fits_f767
        usable = fits and one.configuration.touch_sweeps >= MIN_SWEEPS
        if cost is not None and accuracy is not None and usable:
            known.append((cost, accuracy, one))
    if not known:
        raise UsageError(
            f"no {what} has {target.where} and a cost in {target.unit} on the {target.board}; run "
            " eitskin tradeoff run"
        )
    known = [row for row in known if row[2].costs["acquisition_us"] <= target.acquisition_us]
    if not known:
        raise UsageError(
            f"no {what} measures a frame within {target.acquisition_us / 1000:g} ms; allow more"
            " with  --period"
        )
    within = [row for row in known if target.budget is None or row[0] <= target.budget.value]
    if not within:
        least = min(known, key=lambda row: row[0])
        takes = Budget(least[0], target.unit)
        raise UsageError(
            f"no {what} keeps to {target.budget}; the cheapest, {least[2].name!r}, takes {takes}"
        )
    if target.accuracy is None:
        return min(within, key=lambda row: (-row[1], row[0]))[2]
    reached = [row for row in within if row[1] >= target.accuracy]
    if not reached:
        best = max(within, key=lambda row: row[1])
        bound = "" if target.budget is None else f" within {target.budget}"
        found = f"the best, {best[2].name!r}, has {best[1]:.3f} ({target.where})"
        raise UsageError(f"no {what} reaches {target.accuracy:g}{bound}; {found}")
    return min(reached, key=lambda row: (row[0], -row[1]))[2]
