"""Measured operating points, and the choice of one by a preset, a limit or an accuracy."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
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
F767_RAM = 368 * 1024  # of 384 kB for the workspace; the rest is for frames
MEASURED_DB = (40.0, 60.0, 80.0)  # the SNRs of the shipped results
DEFAULT_PERIOD_US = 20_800  # duration of the default scan
REPORT_US = "report_us"
HOST_NOISE = 0.05  # times on a host that differ by this part count as equal
MIN_SWEEPS = Configuration.touch_sweeps  # fewer sweeps save little, and make discs worse
MEASURED = ("threshold", "force_scale", "costs", "instructions", "host_us")
SHORT_CELL = (
    "image.mean", "image.low", "image.high", "image.worst_tenth", "drawn.mean", "discs.mean",
    "exact_count", "solve_macs", "touch_macs", "most_macs",
)  # fmt: skip
MODEL_HOLDS = {
    "solver",
    "iterations",
    "lambda_rel",
    "lambda_noise_factor",
    "touch_fit",
}  # stored in a model


@dataclass(frozen=True)
class Limit:
    """A limit on the cost of a frame's solve and touches, with ``unit`` "us", "MACs" or
    "instructions", or on the time from contact to report, "report_us"."""

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


def read_limit(text: str) -> Limit:
    """Return the limit in a text such as "10ms", "800us", "600kMACs" or "2.5Minstructions".

    Raises:
        UsageError: the text is not a limit.
    """
    match = re.fullmatch(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?)\s*([A-Za-z]+)", text.strip())
    unit = None if match is None else match.group(2).lower()
    unit = unit if unit in UNITS or unit is None else f"{unit}s"
    if match is None or unit not in UNITS or not 0 < float(match.group(1)) < 1e15:
        raise UsageError(
            f"--budget {text}: give a number above 0 and a unit: 10ms, 800us, 600kMACs or"
            " 2.5Minstructions"
        )
    factor, kind = UNITS[unit]
    return Limit(float(match.group(1)) * factor, kind)


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """A configuration with what was measured for it.

    Attributes:
        threshold, force_scale: the trained values.
        costs: ``flash_bytes``, ``ram_bytes``, ``pixels_kept``, ``acquisition_us``.
        instructions: those of solve and touches on the Cortex-M7: ``kind`` ("counted" or
            "estimated"), ``mean``, ``most`` and more; or None.
        host_us: ``p50``, ``p99`` and ``most`` of solve and touches on the host (``host_times``); or
            None.
        scores: the scores by set, then by SNR in dB as text.
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
        """The name of the configuration."""
        return self.configuration.name

    def score(self, where: Conditions) -> dict[str, Any] | None:
        """Return the scores on a set at an SNR, or None if they were not measured."""
        return self.scores.get(where.scenes, {}).get(f"{where.snr_db:g}")

    def accuracy(self, where: Conditions) -> float | None:
        """Return the mean MIoU under these conditions, or None."""
        score = self.score(where)
        return None if score is None else float(score[where.judged]["mean"])

    def macs(self, where: Conditions) -> tuple[float, float] | None:
        """Return the mean and the greatest number of MACs of solve and touches under these
        conditions, or None."""
        score = self.score(where)
        if score is None:
            return None
        return score["solve_macs"][0] + score["touch_macs"][0], score["most_macs"]

    def cost(self, unit: str, board: str, where: Conditions, worst: bool = False) -> float | None:
        """Return the cost of solve and touches of a frame in ``unit``, or None if unknown.

        It is the mean (host: the median), or with ``worst`` that of the most expensive frame that
        was counted or timed. ``report_us`` is the time from contact to report (tuning.report_time).
        Times of the F767 are estimates with one instruction per cycle.
        """
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
        """Return whether model and workspace fit into flash and RAM of the NUCLEO-F767ZI, and all
        settings can be stored in the model or sent by the SOLVER command."""
        fits = self.costs["flash_bytes"] <= BANK_BYTES - RECORD_BYTES
        fits = bool(fits and self.costs["ram_bytes"] <= F767_RAM)
        return fits and not unusual(self.configuration) - MODEL_HOLDS - board_takes()


def unusual(one: Configuration) -> set[str]:
    """Return the names of the solver's settings in which ``one`` differs from the defaults."""
    defaults = Configuration("").solver_settings
    return {name for name, value in one.solver_settings.items() if value != defaults.get(name)}


def board_takes() -> set[str]:
    """Return the names of the solver's settings that can be sent to a board."""
    return {one.name for one in fields(SolverSettings)}


@dataclass(frozen=True)
class Conditions:
    """The conditions of an accuracy: the scenes, the SNR, and what is scored: the solver's
    "image", the "drawn" image that is shown, or touches as "discs"."""

    scenes: str = "random"
    snr_db: float = 60.0
    judged: str = "image"

    def __str__(self) -> str:
        return f"{self.judged} MIoU, {self.scenes} at {self.snr_db:g} dB"


@dataclass(frozen=True, eq=False)
class Front:
    """A file of results: the operating points that were measured with ``settings``."""

    settings: dict[str, Any]
    points: tuple[OperatingPoint, ...]
    where_from: str = "the shipped results"


def _cell(cell: Any) -> dict[str, Any]:
    """Return the scores of a set at an SNR, either as they are, or from the numbers of the shipped
    results, which are in the order of ``SHORT_CELL``."""
    if isinstance(cell, dict):
        return cell
    scores: dict[str, Any] = {}
    for name, value in zip(SHORT_CELL, cell, strict=True):
        group, _, part = name.partition(".")
        if group in ("image", "drawn", "discs"):
            scores.setdefault(group, {})[part] = value
        else:
            scores[group] = [value] if group in ("solve_macs", "touch_macs") else value
    return scores


def front_from(values: Any, where: str) -> Front:
    """Return the results in JSON values; ``where`` names them in errors."""
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
            points.append(OperatingPoint(configuration, **parts, scores=scores))
        return Front(dict(values["settings"]), tuple(points), where)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise ConfigError(
            f"{where}: not results of  eitskin tradeoff run  of version {VERSION}; run it again"
        ) from None


def load_front(path: Path | None = None) -> Front:
    """Return the results in the file ``path``, or those that ship with the package.

    Raises:
        FileError: the file cannot be read.
        ConfigError: it does not hold results.
    """
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
class Preset:
    """The requirements by which an operating point is chosen: a named preset, or limits given to
    ``eitskin recommend``.

    The cost is at most ``limit``, for the mean frame or the ``worst``, and the accuracy is at least
    ``accuracy``, on ``board`` under the conditions ``where``; a frame is measured within
    ``period_us``. Without a limit, costs are compared in the unit ``compared_in``. ``name`` is
    empty unless it is a named preset. ``snr_known`` says that ``where`` has the SNR of the user's
    instrument.
    """

    limit: Limit | None
    accuracy: float | None
    board: str
    where: Conditions
    period_us: float | None = None
    worst: bool = False
    compared_in: str = "us"
    name: str = ""
    snr_known: bool = False

    @property
    def unit(self) -> str:
        """The unit in which costs are compared."""
        return self.compared_in if self.limit is None else self.limit.unit

    def at_snr(self, snr_db: float | None) -> Preset:
        """Return the same preset for an instrument with the SNR ``snr_db``: its conditions are the
        nearest of ``MEASURED_DB``. None leaves it as it is."""
        if snr_db is None:
            return self
        nearest_db = min(MEASURED_DB, key=lambda one: (abs(one - snr_db), one))
        return replace(self, where=replace(self.where, snr_db=nearest_db), snr_known=True)

    @property
    def acquisition_us(self) -> float:
        """The longest time that measuring a frame may take: the period if it is given, otherwise
        the longer of the limit and the default scan. If reports are compared, any time is allowed,
        as it is part of them."""
        if self.period_us is not None or self.unit == REPORT_US:
            return self.period_us or math.inf
        longest = self.limit.value if self.limit is not None and self.limit.unit == "us" else 0.0
        return max(longest, DEFAULT_PERIOD_US)


# "fast" has the earliest report with the paper's accuracy of .84, "balanced" is the most accurate
# with a report within 45 ms of contact, and "accurate" is the most accurate of all. The last two
# are at least as accurate as the defaults (``no_worse``).
PRESET_ACCURACY = {"fast": 0.84}
PRESET_REPORT_MS = {"balanced": 45.0, "accurate": 1e6}
PRESETS = (*PRESET_ACCURACY, *PRESET_REPORT_MS)
IMAGES = ("image", "drawn")


def named_preset(
    name: str, board: str, where: Conditions | None = None, snr_db: float | None = None
) -> Preset:
    """Return the preset ``name`` for ``board``. ``snr_db`` is the measured SNR, or None if it is
    not known.

    Raises:
        UsageError: there is no such preset.
    """
    if name not in PRESETS:
        raise UsageError(f"preset {name}: {nearest(name, PRESETS)}")
    ms = PRESET_REPORT_MS.get(name)
    limit = None if ms is None else Limit(1000 * ms, REPORT_US)
    accuracy = PRESET_ACCURACY.get(name)
    place = where or Conditions()
    return Preset(limit, accuracy, board, place, compared_in=REPORT_US, name=name).at_snr(snr_db)


def checked_preset(preset: Preset) -> Preset:
    """Return ``preset``, or raise a UsageError if its limits are not valid."""
    if preset.limit is None and preset.accuracy is None:
        raise UsageError(
            "state what to choose by:  --preset balanced,  --budget 10ms  or  --accuracy 0.86"
        )
    if preset.accuracy is not None and not 0 < preset.accuracy < 1:
        raise UsageError(f"--accuracy {preset.accuracy:g} is an MIoU; use above 0 to below 1")
    if preset.period_us is not None and not preset.period_us > 0:
        raise UsageError("--period must be above 0")
    if preset.board == "host" and preset.unit == "instructions":
        raise UsageError(
            "instructions are counted on the Cortex-M7; use a time or MACs for the host, or "
            " --board f767"
        )
    return preset


def no_worse(
    points: Iterable[OperatingPoint], default: OperatingPoint, preset: Preset
) -> list[OperatingPoint]:
    """Return the points whose images, the solver's and the one that is shown, are on average at
    least as accurate as those of the ``default`` settings: at the SNR of ``preset`` if it is that
    of the user's instrument, otherwise at each of ``MEASURED_DB``."""
    snrs_db = (preset.where.snr_db,) if preset.snr_known else MEASURED_DB
    places = [
        replace(preset.where, snr_db=snr_db, judged=judged)
        for snr_db in snrs_db
        for judged in IMAGES
    ]
    least = [(place, default.accuracy(place)) for place in places]
    return [
        one
        for one in points
        if all(known is None or (one.accuracy(place) or 0.0) >= known for place, known in least)
    ]


def default_point(points: Iterable[OperatingPoint]) -> OperatingPoint | None:
    """Return the point with the default settings, or None if it is not among ``points``."""
    return next((p for p in points if replace(p.configuration, name="") == Configuration("")), None)


def choose(
    points: Iterable[OperatingPoint],
    preset: Preset,
    what: str = "operating point",
    default: OperatingPoint | None = None,
) -> OperatingPoint:
    """Return the most accurate point within the limit if there is a limit, the cheapest point that
    reaches the accuracy if there is an accuracy, and the cheapest that does both if there are both.
    The cheapest of equally accurate points is taken, too. Times on a host that differ by less than
    ``HOST_NOISE`` count as equal, and the fewest MACs decide.

    Points with fewer sweeps of the touch fit than the default are left out. The presets "balanced"
    and "accurate" also leave out those that are less accurate than the ``default`` settings
    (``no_worse``). ``what`` names the points in errors.

    Raises:
        UsageError: no point fulfils the preset.
    """
    if default is not None and preset.name in PRESET_REPORT_MS:
        points = no_worse(points, default, preset)
    known = []
    for one in points:
        cost = one.cost(preset.unit, preset.board, preset.where, preset.worst)
        accuracy = one.accuracy(preset.where)
        fits = preset.board == "host" or one.fits_f767
        usable = fits and one.configuration.touch_sweeps >= MIN_SWEEPS
        if cost is not None and accuracy is not None and usable:
            known.append((cost, accuracy, one))
    if not known:
        raise UsageError(
            f"no {what} has {preset.where} and a cost in {preset.unit} on the {preset.board}; run "
            " eitskin tradeoff run"
        )
    known = [row for row in known if row[2].costs["acquisition_us"] <= preset.acquisition_us]
    if not known:
        raise UsageError(
            f"no {what} measures a frame within {preset.acquisition_us / 1000:g} ms; allow more"
            " with  --period"
        )
    within = [row for row in known if preset.limit is None or row[0] <= preset.limit.value]
    if not within:
        least = min(known, key=lambda row: row[0])
        takes = Limit(least[0], preset.unit)
        raise UsageError(
            f"no {what} keeps to {preset.limit}; the cheapest, {least[2].name!r}, takes {takes}"
        )
    if preset.accuracy is None:
        most_accurate = max(row[1] for row in within)
        return _cheapest([row for row in within if row[1] == most_accurate], preset)
    reached = [row for row in within if row[1] >= preset.accuracy]
    if not reached:
        best = max(within, key=lambda row: row[1])
        bound = "" if preset.limit is None else f" within {preset.limit}"
        found = f"the best, {best[2].name!r}, has {best[1]:.3f} ({preset.where})"
        raise UsageError(f"no {what} reaches {preset.accuracy:g}{bound}; {found}")
    return _cheapest(reached, preset)


def _cheapest(rows: list[tuple[float, float, OperatingPoint]], preset: Preset) -> OperatingPoint:
    """Return the cheapest point of ``rows`` (cost, accuracy, point). Among times on a host that are
    equal within their noise, the fewest MACs decide, because these are the same in each run."""
    timed = preset.board == "host" and preset.unit in ("us", REPORT_US)
    most = min(row[0] for row in rows) * (1 + HOST_NOISE if timed else 1)

    def work(row: tuple[float, float, OperatingPoint]) -> tuple[float, float, float]:
        cost, accuracy, one = row
        macs = one.cost("MACs", preset.board, preset.where, preset.worst)
        return (math.inf if macs is None else macs, -accuracy, cost)

    return min((row for row in rows if row[0] <= most), key=work)[2]
