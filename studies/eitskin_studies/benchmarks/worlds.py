"""``eitskin bench worlds``: touches counted in sets of other worlds by the C core."""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, get_type_hints

from eitskin.config import nearest
from eitskin.core.results import Options
from eitskin.errors import UsageError
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.progress import Progress, silent
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.worlds.score import CoreFinder, WorldScore, score_worlds
from eitskin_studies.worlds.simulate import WorldFactory
from eitskin_studies.worlds.worlds import WORLDS


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
