"""Score how well touches are found in sets of other worlds, by any method.

The rule is that of ``eitskin.scoring.matching``: touches are paired with true ones within 10 mm, as
many as possible, then the nearest; a scene is exact where nothing is left over on either side.
Without touches a scene is exact where none is reported.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Reconstruction
from eitskin.errors import FrameError
from eitskin.progress import Progress, silent
from eitskin.scoring.matching import match
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.experiments.multitouch.counts import Share, share
from eitskin_studies.worlds.simulate import WorldFactory, WorldScenes

DIGITS = 4


class FoundTouch(Protocol):
    """The properties of a found touch that scoring needs."""

    @property
    def x_mm(self) -> float:
        """Its middle."""

    @property
    def y_mm(self) -> float:
        """Its middle."""

    @property
    def radius_mm(self) -> float:
        """Its radius."""


Finder = Callable[[FloatArray, FloatArray, float], Sequence[FoundTouch]]
"""Touches of a frame (m,), given the untouched frames (q, m) of its session, in V, and a step of
its converter, 0 without; it may raise FrameError."""


@dataclass(frozen=True)
class WorldScore:
    """A set's numbers.

    Attributes:
        name, text, scenes: of the set.
        exact: the share of exact scenes.
        false_per_scene, missed_per_scene: touches.
        median_mm, p95_mm: distance of found touches from the true ones; None where none was found.
        radius_ratio: median of found over true radius.
        warned: of the scenes that are not exact, the share in which the finder names something
            wrong with the frame; None if it names nothing ever, or all are exact.
        refused: scenes whose frames the finder rejects; their touches count as missed.
    """

    name: str
    text: str
    scenes: int
    exact: Share
    false_per_scene: float
    missed_per_scene: float
    median_mm: float | None
    p95_mm: float | None
    radius_ratio: float | None
    warned: float | None
    refused: int

    def as_dict(self) -> dict[str, Any]:
        """Plain values fit for JSON."""
        values = dict(vars(self))
        values["exact"] = [round(v, DIGITS) for v in (self.exact.mean, *self.interval)]
        return {
            key: round(value, DIGITS) if isinstance(value, float) else value
            for key, value in values.items()
        }

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the share of exact scenes."""
        return self.exact.low, self.exact.high


class CoreFinder:
    """Return what ``solver`` finds: a tare on the untouched frames, then the frame, with nothing
    before it. ``diagnostics`` names what the core finds wrong with the last frame, and
    ``touch_macs`` is the cost of its touches in multiply-accumulates."""

    def __init__(self, solver: Reconstructor) -> None:
        self.solver, self._own_sign = solver, solver.options.sign
        self.diagnostics: tuple[str, ...] = ()
        self.touch_macs = 0
        self._result: Reconstruction | None = None

    def look_for(self, sign: str | None) -> None:
        """Changes of ``sign`` from now on; None: as the solver was reported at first."""
        self.solver.set_options(sign=sign or self._own_sign)

    def __call__(
        self, untouched_v: FloatArray, frame_v: FloatArray, step_v: float
    ) -> tuple[Touch, ...]:
        """As ``Finder``; a board tells its step, too (``BoardInfo.noise_floor_v``)."""
        self.diagnostics, self.touch_macs, self._result = (), 0, None
        self.solver.set_options(noise_floor_v=step_v / math.sqrt(12))
        self.solver.tare(untouched_v)
        self.solver.forget()
        result = self.solver.reconstruct(frame_v)
        self.diagnostics = tuple(result.info.diagnostics_by_name)
        self.touch_macs = result.info.touch_macs
        self._result = result
        return result.touches

    @property
    def result(self) -> Reconstruction:
        """The last frame's result; an AttributeError if there is none."""
        if self._result is None:
            raise AttributeError("no frame was reconstructed")
        return self._result


def score_set(found_by: Finder, of: WorldScenes) -> WorldScore:
    """The numbers of one set."""
    if isinstance(found_by, CoreFinder):
        found_by.look_for(of.world.sign)
    matchings, ratios, refused = [], [], 0
    warned: list[bool] = []
    for scene, *measured in zip(of.scenes, of.untouched_v, of.frames_v, of.step_v, strict=True):
        try:
            found = found_by(*measured)
        except FrameError:
            found, refused = (), refused + 1
        one = match(scene.centres_mm(), [(t.x_mm, t.y_mm) for t in found])
        matchings.append(one)
        if isinstance(found_by, CoreFinder) and not one.exact:
            warned.append(bool(found_by.diagnostics))
        ratios += [found[j].radius_mm / scene.touches[i].radius_mm for i, j in one.pairs]
    count = len(matchings)
    distances = [d for m in matchings for d in m.distances_mm]
    median, p95 = np.quantile(distances, [0.5, 0.95]) if distances else (None, None)
    return WorldScore(
        name=of.name,
        text=of.world.text,
        scenes=count,
        exact=share(sum(m.exact for m in matchings), count),
        false_per_scene=sum(m.false_touches for m in matchings) / count,
        missed_per_scene=sum(m.misses for m in matchings) / count,
        median_mm=None if median is None else float(median),
        p95_mm=None if p95 is None else float(p95),
        radius_ratio=float(np.median(ratios)) if ratios else None,
        warned=float(np.mean(warned)) if warned else None,
        refused=refused,
    )


def score_worlds(
    found_by: Finder,
    factory: WorldFactory,
    names: Sequence[str],
    count: int,
    seed: int,
    *,
    family: str = "tuning",
    snr_db: float | None = None,
    progress: Progress = silent,
) -> list[WorldScore]:
    """Every set of ``names``, ``count`` scenes each.

    Raises:
        UsageError, GeometryError, MissingExtraError: from simulating.
    """
    return [
        score_set(
            found_by,
            factory.scenes(name, count, seed, snr_db, family=family, progress=progress),
        )
        for name in names
    ]


def as_text(scores: Sequence[WorldScore]) -> str:
    """The table."""
    width = max(len(one.name) for one in scores)
    lines = [
        f"{'set':<{width}} scenes  exact %  (95 %)      false  missed  median mm  p95 mm  radius"
    ]
    for one in scores:
        low, high = (100 * v for v in one.interval)
        numbers = [
            "     -" if value is None else f"{value:6.2f}"
            for value in (one.median_mm, one.p95_mm, one.radius_ratio)
        ]
        lines.append(
            f"{one.name:<{width}} {one.scenes:>6} {100 * one.exact.mean:>7.1f}"
            f"   ({low:3.0f} to {high:3.0f}) {one.false_per_scene:>8.2f}"
            f" {one.missed_per_scene:>7.2f}     {numbers[0]}  {numbers[1]}  {numbers[2]}"
            + (f"  {one.refused} frames rejected" if one.refused else "")
        )
    return "\n".join(lines)
