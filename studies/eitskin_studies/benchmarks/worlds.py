"""``eitskin bench worlds`` and ``bench columns``: touches counted in sets of other worlds by the C
core."""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, get_type_hints

from eitskin.arrays import FloatArray
from eitskin.config import nearest
from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Options
from eitskin.errors import UsageError
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.progress import Progress, silent
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.harness.sections import Filling, Tabular, text_table
from eitskin_studies.worlds.score import CoreFinder, WorldScore, score_set, score_worlds
from eitskin_studies.worlds.simulate import WorldFactory
from eitskin_studies.worlds.worlds import WORLDS

LIMITS = (0, 200, 30)  # of columns; 0 is none
LIMITED_SETS = (
    "discs_1_to_3", "five_at_2_5_radii", "drift_2_percent_light", "ellipses", "fingers",
    "two_fingers_16_to_24_mm",
)  # fmt: skip


@dataclass(frozen=True)
class Settings:
    """The settings of a run."""

    scenes: int
    seed: int
    family: str
    sets: tuple[str, ...]
    snr_db: float | None = None
    model: Path | None = None
    changes: tuple[str, ...] = ()
    cache: Path | None = None


def run(settings: Settings, progress: Progress = silent) -> list[WorldScore]:
    """Score the sets by the C core in float32, with the model and the options given.

    Raises:
        UsageError: an option is unknown or out of range.
        FileError, ModelError: from the model's file.
        GeometryError, MissingExtraError: from simulating.
    """
    model, blob, _ = load_or_prebuilt(settings.model)
    solver = Reconstructor(model, blob=blob)
    solver.set_options(**option_values(settings.changes))
    factory = WorldFactory(model.skin, model.protocol, settings.cache)
    return score_worlds(
        CoreFinder(solver),
        factory,
        settings.sets,
        settings.scenes,
        settings.seed,
        family=settings.family,
        snr_db=settings.snr_db,
        progress=progress,
    )


class _Counting(CoreFinder):
    """Also keeps the multiply-accumulates of each frame's touches."""

    def __init__(self, solver: Reconstructor) -> None:
        super().__init__(solver)
        self.macs: list[int] = []

    def __call__(
        self, untouched_v: FloatArray, frame_v: FloatArray, step_v: float
    ) -> tuple[Touch, ...]:
        found = super().__call__(untouched_v, frame_v, step_v)
        self.macs.append(self.touch_macs)
        return found


@dataclass(frozen=True)
class Limited:
    """The scores of ``LIMITED_SETS`` if the touch test may compute ``columns``, and the
    multiply-accumulates of the touches of all their frames."""

    columns: int
    scores: tuple[WorldScore, ...]
    macs_mean: float
    macs_most: int


@dataclass(frozen=True)
class ColumnLimits:
    """All that ``eitskin bench columns`` measures."""

    settings: Settings
    rows: tuple[Limited, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        rows = [
            vars(row) | {"scores": [score.as_dict() for score in row.scores]} for row in self.rows
        ]
        return {"scenes": self.settings.scenes, "seed": self.settings.seed, "rows": rows}


def run_limits(settings: Settings, progress: Progress = silent) -> ColumnLimits:
    """Score the sets with each of ``LIMITS`` as the option ``test_columns``.

    Raises:
        GeometryError, MissingExtraError: from simulating.
    """
    model, blob, _ = load_or_prebuilt(settings.model)
    factory = WorldFactory(model.skin, model.protocol, settings.cache)
    drawn = [
        factory.scenes(
            name, settings.scenes, settings.seed, family=settings.family, progress=progress
        )
        for name in settings.sets
    ]
    rows = []
    for columns in LIMITS:
        finder = _Counting(Reconstructor(model, blob=blob))
        finder.solver.set_options(test_columns=columns)
        scores = tuple(score_set(finder, scenes) for scenes in drawn)
        rows.append(Limited(columns, scores, sum(finder.macs) / len(finder.macs), max(finder.macs)))
    return ColumnLimits(settings, tuple(rows))


def limits_table(result: ColumnLimits) -> Tabular:
    """Millions of multiply-accumulates, and the share of exact scenes in each set."""
    head = ("`test_columns`", "mean", "worst", *(f"`{name}`" for name in result.settings.sets))
    rows = []
    for row in result.rows:
        shares = [
            f"{100 * score.exact.mean:.0f} % ({100 * score.interval[0]:.0f} to"
            f" {100 * score.interval[1]:.0f})"
            for score in row.scores
        ]
        limit = f"{row.columns}" if row.columns else "0 (no limit)"
        rows.append((limit, f"{row.macs_mean / 1e6:.2f}", f"{row.macs_most / 1e6:.2f}", *shares))
    return head, rows


def limits_text(result: ColumnLimits) -> str:
    """For a terminal."""
    return text_table(*limits_table(result))


def limits_for_page(result: ColumnLimits, command: str) -> Filling:
    """The marks of studies/results/board-cost.md."""
    how = result.settings
    run = (
        f"By `{command}`: {how.scenes} scenes of each set, {how.family} family, seed {how.seed},"
        " the prebuilt model with its other options as they are."
    )
    return {"columns-run": run}, {"columns": limits_table(result)}


def chosen_sets(text: str | None) -> tuple[str, ...]:
    """The sets of "a,b*": names, or patterns of names; all of None.

    Raises:
        UsageError: one fits no set.
    """
    if text is None:
        return tuple(WORLDS)
    chosen: list[str] = []
    for wanted in text.split(","):
        fitting = [name for name in WORLDS if fnmatchcase(name, wanted)]
        if not fitting:
            raise UsageError(f"worlds: no set is named {wanted!r}; {nearest(wanted, WORLDS)}")
        chosen += [name for name in fitting if name not in chosen]
    return tuple(chosen)


def listed() -> str:
    """The sets by name."""
    width = max(map(len, WORLDS))
    return "\n".join(f"{name:<{width}}  {world.text}" for name, world in WORLDS.items())


def option_values(changes: tuple[str, ...]) -> dict[str, Any]:
    """NAME=VALUE of options of the core, as their types are.

    Raises:
        UsageError: one is not such a pair, or its name is unknown.
    """
    kinds = get_type_hints(Options)
    values: dict[str, Any] = {}
    for change in changes:
        name, equals, text = change.partition("=")
        if not equals or name not in kinds:
            raise UsageError(f"--option {change}: use NAME=VALUE; {nearest(name, kinds)}")
        try:
            values[name] = _value(text, kinds[name])
        except ValueError:
            raise UsageError(f"--option {change}: {text!r} is no {kinds[name].__name__}") from None
    return values


def _value(text: str, kind: type[Any]) -> Any:
    if kind is bool:
        if text.lower() not in ("true", "false", "1", "0"):
            raise ValueError(text)
        return text.lower() in ("true", "1")
    return kind(text)
