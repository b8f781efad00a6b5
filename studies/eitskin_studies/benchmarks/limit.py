"""``eitskin bench limit``: the error of the core's touches beside the Cramer-Rao bound, by place,
contrast, noise, kind of touch and drive pattern.

Frames are exact, so no mesh disturbs them, and each scene has contacts of its own. A found touch is
paired with a true one by the rule of ``eitskin.scoring.matching``.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import FrameError, UsageError
from eitskin.fileio import write_bytes
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import encode_model, load_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.progress import Progress, silent
from eitskin.scene.random_touches import TrueTouch, rim_distance_mm
from eitskin.scene.simulate import Measurement
from eitskin.scoring.matching import match
from eitskin.skin.protocol import pattern as protocol_of
from eitskin.skin.skin import Skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.benchmarks.limit_bound import Bound, ExactScene, bounds
from eitskin_studies.benchmarks.limit_scenes import CONTACT_SPREAD, SETS, exact_scenes
from eitskin_studies.experiments.electrodes.patterns import from_transfer
from eitskin_studies.experiments.multitouch.counts import Share, share
from eitskin_studies.harness.commit import last_commit
from eitskin_studies.worlds.score import CoreFinder
from eitskin_studies.worlds.simulate import measured_frames
from eitskin_studies.worlds.worlds import World

CONTACT_SD = CONTACT_SPREAD / math.sqrt(3)
CHI2_90 = -2 * math.log(0.1)  # of two degrees of freedom
RINGS_MM = (0.0, 20.0, 30.0, 50.0, math.inf)
CONTRASTS = {
    "insulating": (0.1, 0.25, 0.5),
    "light": (1.15, 1.5, 2.0),
    "discs": (3.0, 4.0, 6.0, 10.0),
}
OWN_DB, VOLTS = "60 dB of its own rms", "the same noise in volts"
PATTERNS = ("adjacent", "skip-3", "opposite")
CODE = ("csrc", "tables", "python/eitskin", "studies/eitskin_studies/benchmarks")
DIGITS = 4


@dataclass(frozen=True)
class Settings:
    """The settings that the command was given. ``samples`` is the number of random skins for the
    model errors of the models that are built for other patterns; None takes the skin's."""

    scenes: int
    seed: int
    sets: tuple[str, ...] = tuple(SETS)
    patterns: tuple[str, ...] = PATTERNS
    model: Path | None = None
    cache: Path | None = None
    samples: int | None = None


@dataclass(frozen=True, eq=False)
class TouchResult:
    """A true touch with its bound, and the errors of the touch that was found for it; None if none
    was found, or if the core gives no covariance. ``rim_mm`` is the distance of its centre from the
    rim."""

    true: TrueTouch
    rim_mm: float
    bound: Bound
    error_mm: float | None = None
    radius_error_mm: float | None = None
    covered: bool | None = None


@dataclass(frozen=True, eq=False)
class SceneResult:
    """The touches of a scene, whether they were counted exactly, and the cost of finding them."""

    touches: tuple[TouchResult, ...]
    exact: bool
    touch_macs: int


@dataclass(frozen=True)
class Row:
    """The numbers of one line of a table.

    Attributes:
        table, name: where it stands.
        scenes, touches: how many there are, and ``found``, the share of touches with a partner.
        exact: the share of scenes without a missed or a false touch; None if the line has only
            some of the touches of its scenes.
        median_mm, p95_mm: errors of the found touches; nan if there are none, here and below.
        bound_mm: the median of the bounds of the same touches. A touch's bound is the median
            distance of a normal error with the least covariance.
        bound_p95_mm: the 95th percentile of such errors of all these touches.
        covered: the share of the found touches whose true centre lies in the 90 % ellipse that the
            core's covariance gives; its count is that of the touches with a covariance.
        radius_bias_mm, radius_error_mm: medians of found less true radius, and of its size.
        radius_bound_mm: the median of the bounds of the radius, as the median size of a normal
            error.
        macs_mean, macs_worst: multiply-accumulates of the touches per frame; None as ``exact``.
    """

    table: str
    name: str
    scenes: int
    touches: int
    found: Share
    exact: Share | None
    median_mm: float
    p95_mm: float
    bound_mm: float
    bound_p95_mm: float
    covered: Share
    radius_bias_mm: float
    radius_error_mm: float
    radius_bound_mm: float
    macs_mean: float | None
    macs_worst: int | None

    @property
    def ratio(self) -> float:
        """The median error over the median bound."""
        return self.median_mm / self.bound_mm

    def as_dict(self) -> dict[str, Any]:
        """Plain values fit for JSON."""
        values = asdict(self)
        values["ratio"] = self.ratio
        for name in ("found", "exact", "covered"):
            one: Share | None = getattr(self, name)
            values[name] = None if one is None else [one.mean, one.low, one.high]
        return {key: _plain(value) for key, value in values.items()}


@dataclass(frozen=True)
class LimitResult:
    """All lines, and the conditions of their measurement."""

    settings: Settings
    model: str
    commit: str
    rows: tuple[Row, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain values fit for JSON."""
        return {
            "seed": self.settings.seed,
            "scenes": self.settings.scenes,
            "model": self.model,
            "commit": self.commit,
            "rows": [row.as_dict() for row in self.rows],
        }

    def table(self, name: str) -> list[Row]:
        """The lines of one table."""
        return [row for row in self.rows if row.table == name]


def run(settings: Settings, progress: Progress = silent) -> LimitResult:
    """Measure the core in float32 with default options beside the bound.

    Raises:
        UsageError: no such set or pattern.
        GeometryError: the model's skin is not round.
        FileError, ModelError: from the model's file and the cache.
        MissingExtraError: a model must be built, and the mesher is not installed.
    """
    for kind, given, known in (
        ("set", settings.sets, tuple(SETS)),
        ("pattern", settings.patterns, PATTERNS),
    ):
        for name in given:
            if name not in known:
                raise UsageError(f"limit: no {kind} is named {name!r}; use {', '.join(known)}")
    model, blob, name = load_or_prebuilt(settings.model)
    bench = _Bench(settings, model, blob, progress)
    rows = tuple(_rows(bench))
    return LimitResult(settings, name, last_commit(CODE), rows)


@dataclass(eq=False)
class _Bench:
    """Measures cases: a set at an SNR with a pattern."""

    settings: Settings
    model: Model
    blob: bytes
    progress: Progress

    def __post_init__(self) -> None:
        self._scenes: dict[str, list[ExactScene]] = {}

    @cached_property
    def skin(self) -> Skin:
        """The skin of the model."""
        return self.model.skin

    def scenes(self, name: str) -> list[ExactScene]:
        """The scenes of a set."""
        if name not in self._scenes:
            how = self.settings
            self._scenes[name] = exact_scenes(
                self.skin, name, how.scenes, how.seed, how.cache, self.progress
            )
        return self._scenes[name]

    def measured(
        self, name: str, snr_db: float, pattern: str = "adjacent", noise: str = OWN_DB
    ) -> list[SceneResult]:
        """Return what the core finds in the scenes of a set. With ``VOLTS``, sigma is that of the
        adjacent pattern, and the converter has no steps."""
        finder = self._finder(pattern)
        finder.look_for(SETS[name].sign)
        world = World(name, snr_db=snr_db, adc_bits=0 if noise == VOLTS else None)
        protocol, own = finder.solver.model.protocol, self.model.protocol
        results = []
        scenes = self.progress(self.scenes(name), f"{name}, {pattern}, {snr_db:g} dB")
        for k, scene in enumerate(scenes):
            exact = from_transfer(np.array([scene.untouched_v, scene.touched_v]), protocol)
            if noise == VOLTS:
                louder = _rms(exact[0]) / _rms(from_transfer(scene.untouched_v, own))
                world = replace(world, snr_db=snr_db + 20 * math.log10(louder))
            assert world.snr_db is not None
            frames = measured_frames(exact[None], world, self.settings.seed, f"limit {name} {k}")
            untouched, frame, step = (part[0] for part in frames)
            sigma_v = math.hypot(
                _rms(exact[0]) * 10 ** (-world.snr_db / 20), float(step) / math.sqrt(12)
            )
            own_bounds = bounds(
                scene,
                protocol,
                sigma_v,
                Measurement.quiet_frames,
                CONTACT_SD,
                SETS[name].amplitude_sd,
            )
            results.append(_scored(finder, self.skin, scene, own_bounds, untouched, frame, step))
        return results

    def _finder(self, pattern: str) -> CoreFinder:
        if pattern == "adjacent":
            return CoreFinder(Reconstructor(self.model, blob=self.blob))
        model, blob = self._built(pattern)
        return CoreFinder(Reconstructor(model, blob=blob))

    def _built(self, pattern: str) -> tuple[Model, bytes]:
        """The model of another pattern, which the cache keeps."""
        protocol = protocol_of(self.skin.electrodes.count, pattern)
        how = BuildSettings(samples=self.settings.samples)
        folder = self.settings.cache
        digest = hashlib.sha256(repr((self.skin, protocol.hash, how)).encode()).hexdigest()[:16]
        path = None if folder is None else folder / f"limit-{pattern}-{digest}.eitm"
        if path is not None and path.is_file():
            return load_model(path)
        model = build_model(self.skin, protocol, how, progress=self.progress)
        blob = encode_model(model)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, blob)
        return model, blob


def _scored(
    finder: CoreFinder,
    skin: Skin,
    scene: ExactScene,
    own_bounds: Sequence[Bound],
    untouched_v: FloatArray,
    frame_v: FloatArray,
    step_v: float,
) -> SceneResult:
    found: Sequence[Touch]
    try:
        found = finder(untouched_v, frame_v, step_v)
    except FrameError:
        found = ()
    places = np.array([(one.x_mm, one.y_mm) for one in scene.touches])
    rims = rim_distance_mm(skin.outline, places)
    touches = [
        TouchResult(*one) for one in zip(scene.touches, rims.tolist(), own_bounds, strict=True)
    ]
    matching = match(places, [(one.x_mm, one.y_mm) for one in found])
    for (i, j), distance in zip(matching.pairs, matching.distances_mm, strict=True):
        touches[i] = replace(
            touches[i],
            error_mm=distance,
            radius_error_mm=found[j].radius_mm - scene.touches[i].radius_mm,
            covered=_covered(scene.touches[i], found[j]),
        )
    return SceneResult(tuple(touches), matching.exact, finder.touch_macs)


def _covered(true: TrueTouch, found: Touch) -> bool | None:
    """Return whether the true centre lies in the 90 % ellipse of the found one."""
    if not found.x_variance_mm2 or not found.y_variance_mm2:
        return None
    cross = found.xy_covariance_mm2 or 0.0
    covariance = np.array([[found.x_variance_mm2, cross], [cross, found.y_variance_mm2]])
    off = np.array([found.x_mm - true.x_mm, found.y_mm - true.y_mm])
    return bool(off @ np.linalg.solve(covariance, off) <= CHI2_90)


def _rows(bench: _Bench) -> Iterable[Row]:
    """All lines of all tables."""
    how = bench.settings
    main = {name: bench.measured(name, SETS[name].snr_db[0]) for name in how.sets}
    for name, results in main.items():
        yield row("touches", f"{name}, {SETS[name].snr_db[0]:g} dB", results)
    if "discs" not in main:
        return
    discs = main["discs"]
    for low, high in pairwise(RINGS_MM):
        name = f"{low:g} to {high:g} mm" if math.isfinite(high) else f"{low:g} mm and more"
        yield row("place", name, discs, _between(lambda touch: touch.rim_mm, low, high))
    for name, edges in CONTRASTS.items():
        for low, high in pairwise(edges) if name in main else ():
            yield row(
                "contrast",
                f"{low:g} to {high:g}",
                main[name],
                _between(lambda touch: touch.true.contrast, low, high),
            )
    for snr_db in sorted(SETS["discs"].snr_db):
        results = discs if snr_db == SETS["discs"].snr_db[0] else bench.measured("discs", snr_db)
        yield row("snr", f"{snr_db:g} dB", results)
    for pattern in how.patterns:
        for noise in (OWN_DB, VOLTS):
            results = bench.measured("discs", SETS["discs"].snr_db[0], pattern, noise)
            yield row("pattern", f"{pattern}, {noise}", results)


def _between(
    of: Callable[[TouchResult], float], low: float, high: float
) -> Callable[[TouchResult], bool]:
    """Return whether a number of a touch is from ``low`` to below ``high``."""
    return lambda touch: low <= of(touch) < high


def row(
    table: str,
    name: str,
    results: Sequence[SceneResult],
    wanted: Callable[[TouchResult], bool] | None = None,
) -> Row:
    """The numbers of the ``wanted`` touches of ``results``; None wants all."""
    chosen = [[one for one in scene.touches if wanted is None or wanted(one)] for scene in results]
    touches = [one for scene in chosen for one in scene]
    found = [one for one in touches if one.error_mm is not None]
    known = [one.covered for one in found if one.covered is not None]
    errors = np.array([one.error_mm for one in found], dtype=np.float64)
    radii = np.array([one.radius_error_mm for one in found], dtype=np.float64)
    radius_bounds = [0.6745 * one.true.radius_mm * one.bound.log_radius_sd for one in found]
    limits = [one.bound.distances_mm for one in found]
    macs = [scene.touch_macs for scene in results]
    return Row(
        table=table,
        name=name,
        scenes=sum(bool(scene) for scene in chosen),
        touches=len(touches),
        found=share(len(found), len(touches)),
        exact=share(sum(s.exact for s in results), len(results)) if wanted is None else None,
        median_mm=_quantile(errors, 0.5),
        p95_mm=_quantile(errors, 0.95),
        bound_mm=_quantile([one.bound.median_mm for one in found], 0.5),
        bound_p95_mm=_quantile(np.concatenate(limits) if limits else [], 0.95),
        covered=share(sum(known), len(known)),
        radius_bias_mm=_quantile(radii, 0.5),
        radius_error_mm=_quantile(np.abs(radii), 0.5),
        radius_bound_mm=_quantile(radius_bounds, 0.5),
        macs_mean=float(np.mean(macs)) if wanted is None else None,
        macs_worst=max(macs) if wanted is None else None,
    )


def _quantile(values: Sequence[float] | FloatArray, level: float) -> float:
    return float(np.quantile(values, level)) if len(values) else math.nan


def _rms(values_v: FloatArray) -> float:
    return float(np.sqrt(np.mean(values_v**2)))


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, DIGITS) if math.isfinite(value) else None
    return [_plain(one) for one in value] if isinstance(value, list) else value
