"""How a dataset varies a scene: the table [dataset], and one drawn scene a number.

``[dataset.touches]`` draws touches again (in place of [[touch]]); ``[dataset.ranges]`` holds [low,
high] at the place of the number that is drawn: ``snr_db = [50, 70]`` in
``[dataset.ranges.effects.noise]``, ``radius_mm = [6, 9]`` in ``[dataset.ranges.touch.0]``. Scene k
of a dataset depends on (its description, the dataset's seed, k) only. Every range has a stream of
its own.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from eitskin.config import check_keys
from eitskin.errors import ConfigError, EitskinError, UsageError
from eitskin.scene.description import Scene
from eitskin.scene.laws import ShortCircuit
from eitskin.scene.random_touches import TouchRules, random_touches
from eitskin.scene.streams import stream
from eitskin.scene.touch_path import TouchTrack, always

TOUCH_NUMBERS = ("x_mm", "y_mm", "radius_mm", "contrast")


@dataclass(frozen=True)
class Range:
    """A number drawn evenly from [low, high], whole where both ends are; ``key`` is ("effects",
    "noise", "snr_db")."""

    key: tuple[str, ...]
    low: float
    high: float
    whole: bool

    @property
    def name(self) -> str:
        """``key`` with dots."""
        return ".".join(self.key)

    def draw(self, seed: int, number: int) -> float | int:
        """The value in scene ``number``."""
        generator = stream(seed, f"dataset range {self.name}", number)
        if self.whole:
            return int(generator.integers(int(self.low), int(self.high), endpoint=True))
        return float(generator.uniform(self.low, self.high))


@dataclass(frozen=True)
class Ranges:
    """The ranges that a dataset draws from; ``touches`` None keeps the scene's touches."""

    touches: TouchRules | None
    numbers: tuple[Range, ...]


def ranges_of(table: Mapping[str, Any], scene: Scene, where: str) -> Ranges:
    """The table [dataset] checked against the ``scene`` that it varies; ``where`` names its file.

    Raises:
        ConfigError: a key is unknown, a range is none, or the number that it varies is not there to
            be varied.
    """
    check_keys(table, ("touches", "ranges"), f"{where} [dataset]")
    rules = None
    if "touches" in table:
        place = f"{where} [dataset.touches]"
        check_keys(table["touches"], [one.name for one in fields(TouchRules)], place)
        if scene.touches:
            raise ConfigError(
                f"{place}: the scene has touches of its own; remove [[touch]], or use"
                " [dataset.ranges]"
            )
        rules = _rules(table["touches"], place)
    numbers = tuple(_walk(table.get("ranges", {}), (), f"{where} [dataset.ranges]"))
    for one in numbers:
        _check_target(one, scene, where)
    return Ranges(rules, numbers)


def _rules(table: Mapping[str, Any], where: str) -> TouchRules:
    given: dict[str, Any] = {}
    for key, value in table.items():
        if key in ("count", "radius_mm", "contrast", "aspect"):
            low, high, whole = _pair(value, f"{where}: {key}")
            if key == "count" and not whole:
                raise ConfigError(f"{where}: count = {value!r} must be two whole numbers")
            given[key] = (low, high) if key != "count" else (int(low), int(high))
        elif key == "shape":
            if not isinstance(value, str):
                raise ConfigError(f"{where}: shape must be text in quotes, not {value!r}")
            given[key] = value
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"{where}: {key} must be a number, not {value!r}")
        else:
            given[key] = value
    try:
        return TouchRules(**given)
    except UsageError as error:
        raise ConfigError(f"{where}: {error}") from None


def _pair(value: Any, what: str) -> tuple[float, float, bool]:
    numbers = isinstance(value, list) and all(
        isinstance(v, int | float) and not isinstance(v, bool) for v in value
    )
    if not numbers or len(value) != 2 or not value[0] <= value[1]:
        raise ConfigError(f"{what} must be a range [low, high], not {value!r}")
    return float(value[0]), float(value[1]), all(isinstance(v, int) for v in value)


def _walk(table: Any, key: tuple[str, ...], where: str) -> Iterator[Range]:
    if not isinstance(table, Mapping):
        raise ConfigError(f"{where}: it must be a table")
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _walk(value, (*key, name), where)
        else:
            own = (*key, name)
            yield Range(own, *_pair(value, f"{where}: {'.'.join(own)}"))


def _check_target(one: Range, scene: Scene, where: str) -> None:
    place, key = f"{where} [dataset.ranges]: {one.name}", one.key
    if key[0] == "effects" and len(key) == 3:
        if key[1] not in scene.effects:
            raise ConfigError(
                f"{place}: the scene does not name [effects.{key[1]}]; name it to vary it"
            )
        return
    if key[0] == "touch" and len(key) == 3 and key[1].isdigit() and key[2] in TOUCH_NUMBERS:
        number = int(key[1])
        if number >= len(scene.touches):
            raise ConfigError(
                f"{place}: the scene has {len(scene.touches)} touches, counted from 0"
            )
        if key[2] == "contrast" and not isinstance(scene.touches[number].law, ShortCircuit):
            raise ConfigError(f"{place}: touch {number} has no contrast to vary under its law")
        return
    raise ConfigError(
        f"{place}: cannot be varied; use effects.NAME.KEY, or touch.NUMBER.KEY with"
        f" {', '.join(TOUCH_NUMBERS)}"
    )


def drawn(scene: Scene, ranges: Ranges, seed: int, number: int) -> Scene:
    """Scene ``number`` of the dataset with ``seed``.

    Raises:
        EitskinError: what was drawn cannot be (touches that overlap, ...); the text names the
            scene's number.
    """
    try:
        effects = {name: dict(table) for name, table in scene.effects.items()}
        touches = list(scene.touches)
        if ranges.touches is not None:
            place = f"dataset {seed} {number}"
            found = (
                random_touches(scene.skin.outline, _seed(seed, number), 1, place, ranges.touches)
                .scenes[0]
                .touches
            )
            touches = [
                replace(
                    always(t.x_mm, t.y_mm, t.radius_mm, ShortCircuit(t.contrast)), shape=t.shape
                )
                for t in found
            ]
        for one in ranges.numbers:
            value = one.draw(seed, number)
            if one.key[0] == "effects":
                effects[one.key[1]][one.key[2]] = value
            else:
                touches[int(one.key[1])] = _varied(
                    touches[int(one.key[1])], one.key[2], float(value)
                )
        return replace(scene, effects=effects, touches=tuple(touches), seed=_seed(seed, number))
    except EitskinError as error:
        raise type(error)(f"dataset scene {number} (from 0): {error}") from None


def _seed(seed: int, number: int) -> int:
    """The seed of scene ``number``."""
    return int(stream(seed, "dataset scene", number).integers(0, 2**63 - 1))


def _varied(track: TouchTrack, key: str, value: float) -> TouchTrack:
    """``track`` with its law's contrast or its radius replaced, or moved so that its first keyframe
    has x or y."""
    if key == "contrast" and isinstance(track.law, ShortCircuit):
        return replace(track, law=replace(track.law, contrast=value))
    if key == "radius_mm":
        return replace(
            track, keyframes=tuple(replace(one, radius_mm=value) for one in track.keyframes)
        )
    shift = value - getattr(track.keyframes[0], key)
    moved = tuple(replace(one, **{key: getattr(one, key) + shift}) for one in track.keyframes)
    return replace(track, keyframes=moved)
