"""All methods on the same scenes: parameters and thresholds fixed on training scenes, numbers from
test scenes.

For each family the parameter with the best training MIoU is taken, each value at its own best
threshold; with it goes the threshold. Positions come from the image by one rule for all
(``image_touches``), whose threshold is trained apart, or from the method if it reports touches
itself.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.errors import UsageError
from eitskin.fem.mesh import mesh_for_elements
from eitskin.progress import Progress, silent
from eitskin.scene.random_touches import TouchRules, TouchSet, random_touches
from eitskin.scene.simulate import ELEMENTS, Measurement, Simulated, simulate
from eitskin.scoring import metrics
from eitskin.scoring.matching import GATE_MM, Matching
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.solve.image_touches import touches_in_image
from eitskin_studies.compare.cost import Cost, cost
from eitskin_studies.compare.families import Family, FindsTouches, Learns, Method, Setup, setup_for
from eitskin_studies.compare.figures import Figures, figures, small_targets
from eitskin_studies.compare.methods import methods
from eitskin_studies.harness.summary import Summary, summarise
from eitskin_studies.harness.thresholds import (
    THRESHOLDS,
    best_threshold,
    best_touch_threshold,
    match_all,
    miou_curves,
)

TOUCH_THRESHOLDS = THRESHOLDS[4::5]


@dataclass(frozen=True)
class CompareSettings:
    """The methods that are compared, and the scenes.

    Attributes:
        scenes, train_scenes: how many to test on and to train on.
        seed: of both sets; their roles make them independent.
        measurement: imperfections of the simulated frames.
        rules: how touches are drawn.
        elements: about how many the mesh of the Jacobian has; frames come from one of
            ``simulated_elements``.
        raster_mm, lookup: of MIoU (``metrics``).
        gate_mm: how near a found touch must be to count.
    """

    scenes: int = 180
    train_scenes: int = 60
    seed: int = 1
    measurement: Measurement = field(default_factory=Measurement)
    rules: TouchRules = field(default_factory=TouchRules)
    elements: int = 6000
    simulated_elements: int = ELEMENTS
    raster_mm: float = metrics.RASTER_MM
    lookup: str = metrics.LOOKUP
    gate_mm: float = GATE_MM

    def __post_init__(self) -> None:
        if self.scenes < 1 or self.train_scenes < 1:
            raise UsageError("compare needs at least 1 scene to test on and 1 to train on")
        if self.lookup not in metrics.LOOKUPS:
            raise UsageError(
                f"lookup {self.lookup!r} is not known; use one of {', '.join(metrics.LOOKUPS)}"
            )


@dataclass(frozen=True, eq=False)
class CompareResult:
    """One method on the test scenes.

    Attributes:
        name: of the method.
        parameter, value: what was trained, and what came of it.
        threshold: t of MIoU, trained.
        touch_threshold: t of positions, trained; None where the method reports touches itself.
        train_miou: mean on the training scenes, at ``threshold``.
        miou: (k,) of each test scene.
        curve: (T,) mean test MIoU at each of ``THRESHOLDS``; no number in the table is
            chosen from it.
        matchings: of each test scene.
        images: (k, n) of the test scenes.
        found_mm: positions (t, 2) found in each test scene.
        figures: of GREIT, of small targets without noise.
        cost: on this computer; the only numbers that differ from run to run.
    """

    name: str
    parameter: str
    value: float
    threshold: float
    touch_threshold: float | None
    train_miou: float
    miou: FloatArray
    curve: FloatArray
    matchings: tuple[Matching, ...]
    images: FloatArray
    found_mm: tuple[FloatArray, ...]
    figures: Figures
    cost: Cost

    @property
    def miou_summary(self) -> Summary:
        """The statistics of ``miou``; the worst tenth is the lowest."""
        return summarise(self.miou)

    @property
    def position_summary(self) -> Summary:
        """The statistics of the position errors in mm of all hits; the worst tenth is the
        highest."""
        return summarise([d for m in self.matchings for d in m.distances_mm], worst="high")

    @property
    def exact_count(self) -> float:
        """Share of scenes with every touch within the gate and nothing else."""
        return float(np.mean([m.exact for m in self.matchings]))

    @property
    def hit_share(self) -> float:
        """Share of touches found within the gate."""
        hits = sum(m.hits for m in self.matchings)
        return hits / max(hits + sum(m.misses for m in self.matchings), 1)

    @property
    def false_per_scene(self) -> float:
        """Found touches that are none, a scene."""
        return sum(m.false_touches for m in self.matchings) / len(self.matchings)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything that was compared, and under which conditions.

    Attributes:
        settings, setup: the conditions.
        train, test: the simulated sessions.
        results: one a method.
        ceiling: mean test MIoU of the true part of each pixel that is touched, at its best test
            threshold ``ceiling_threshold``: what no image on this grid can do much better than.
    """

    settings: CompareSettings
    setup: Setup
    train: Simulated
    test: Simulated
    results: tuple[CompareResult, ...]
    ceiling: float
    ceiling_threshold: float


@dataclass(frozen=True, eq=False)
class Scenes:
    """The simulated sessions of a comparison: to train on, to test on, and the small targets of
    GREIT's figures."""

    train: Simulated
    test: Simulated
    targets: Simulated


@dataclass(frozen=True, eq=False)
class _Session:
    """Scenes with what judging needs of them."""

    simulated: Simulated
    dv: FloatArray
    truths: BoolArray
    centres_mm: tuple[FloatArray, ...]


def compare(
    skin: Skin,
    protocol: Protocol,
    settings: CompareSettings | None = None,
    *,
    families: Callable[[Setup], Sequence[Family]] = methods,
    only: Sequence[str] = (),
    progress: Progress = silent,
) -> Comparison:
    """Run the comparison; the same arguments give the same numbers.

    Args:
        skin, protocol: what is simulated and reconstructed.
        settings: None takes the defaults.
        families: what is compared, built from the setup.
        only: names of methods, or words in them; all methods without it.
        progress: wraps sequences of work, with what it is.

    Raises:
        UsageError, GeometryError, ProtocolError, MissingExtraError: from drawing, meshing and
            simulating, or no method has such a name.
    """
    how = CompareSettings() if settings is None else settings
    setup = setup_for(skin, protocol, elements=how.elements)
    chosen = named(families(setup), only)
    image_scorer = metrics.judge_for(skin.outline, setup.grid, how.raster_mm, how.lookup)
    scenes = simulated_scenes(skin, protocol, how, progress)

    def session(simulated: Simulated) -> _Session:
        return _Session(
            simulated,
            simulated.differences_v(),
            truth_masks(simulated.touches, image_scorer.raster.points_mm),
            tuple(scene.centres_mm() for scene in simulated.touches.scenes),
        )

    train, test = session(scenes.train), session(scenes.test)
    results = tuple(
        _run(family, setup, image_scorer, train, test, scenes.targets, how.gate_mm)
        for family in progress(chosen, "reconstructing")
    )
    perfect = np.array(
        [
            pixel_cover(setup.grid, scene.centres_mm(), scene.radii_mm())
            for scene in test.simulated.touches.scenes
        ]
    )
    ceiling = miou_curves(image_scorer, perfect, test.truths).mean(axis=0)
    best = int(np.argmax(ceiling))
    return Comparison(
        how,
        setup,
        train.simulated,
        test.simulated,
        results,
        float(ceiling[best]),
        THRESHOLDS[best],
    )


def simulated_scenes(
    skin: Skin, protocol: Protocol, how: CompareSettings, progress: Progress = silent
) -> Scenes:
    """Simulate the scenes of a comparison; the same arguments give the same frames.

    Raises:
        UsageError, GeometryError, MissingExtraError: from drawing, meshing and simulating.
    """
    mesh = mesh_for_elements(skin, how.simulated_elements)

    def session(role: str, count: int) -> Simulated:
        def watched(scenes: Sequence[Any]) -> Iterable[Any]:
            return progress(scenes, f"simulating ({role})")

        drawn = random_touches(skin.outline, how.seed, count, role, how.rules)
        return simulate(
            skin, protocol, drawn, measurement=how.measurement, mesh=mesh, progress=watched
        )

    return Scenes(
        session("train", how.train_scenes),
        session("test", how.scenes),
        small_targets(skin, protocol, mesh),
    )


def named(families: Sequence[Family], only: Sequence[str]) -> Sequence[Family]:
    """Return the families whose method's name has one of the words ``only`` in it, in any case.

    Raises:
        UsageError: a word is in no name.
    """
    names = [family.make(family.values[0]).name for family in families]
    for word in only:
        if not any(word.lower() in name.lower() for name in names):
            raise UsageError(f"--methods {word}: no method's name has that; {', '.join(names)}")
    return [
        family
        for family, name in zip(families, names, strict=True)
        if not only or any(word.lower() in name.lower() for word in only)
    ]


def truth_masks(touches: TouchSet, points_mm: FloatArray) -> BoolArray:
    """The touches of each scene on the raster's cells (p, 2): (k, p)."""
    return np.array([scene.mask(points_mm) for scene in touches.scenes])


def _run(
    family: Family,
    setup: Setup,
    image_scorer: metrics.ImageScorer,
    train: _Session,
    test: _Session,
    targets: Simulated,
    gate_mm: float,
) -> CompareResult:
    """Train a family, then test what came of it."""
    best: tuple[float, float, Method, FloatArray, FloatArray] | None = None
    for value in family.values:
        method = family.make(value)
        images = _images(method, train.simulated, train.dv, setup.grid.n_pixels)
        curves = miou_curves(image_scorer, images, train.truths)
        score = float(curves.mean(axis=0).max())
        if best is None or score > best[0] + 1e-12:
            best = score, value, method, images, curves
    if best is None:
        raise UsageError("a family of methods has no value to try")
    train_miou, value, method, train_images, train_curves = best
    threshold = best_threshold(train_curves)

    index, centres = setup.grid.index, setup.grid.centres_mm()
    touch_threshold = None
    if not isinstance(method, FindsTouches):
        touch_threshold = best_touch_threshold(
            train_images, train.centres_mm, index, centres, TOUCH_THRESHOLDS, gate_mm=gate_mm
        )
    images = _images(method, test.simulated, test.dv, setup.grid.n_pixels)
    if isinstance(method, FindsTouches):
        found = tuple(
            np.asarray(xy, dtype=np.float64).reshape(-1, 2) for xy in method.touches(test.dv)
        )
    else:
        assert touch_threshold is not None
        found = tuple(touches_in_image(image, index, centres, touch_threshold) for image in images)
    curves = miou_curves(image_scorer, images, test.truths)
    spent = cost(method, test.dv)
    small = _images(method, targets, targets.differences_v(), setup.grid.n_pixels)
    return CompareResult(
        name=method.name,
        parameter=family.parameter,
        value=value,
        threshold=threshold,
        touch_threshold=touch_threshold,
        train_miou=train_miou,
        miou=np.asarray(curves[:, THRESHOLDS.index(threshold)]),
        curve=np.asarray(curves.mean(axis=0)),
        matchings=tuple(match_all(test.centres_mm, found, gate_mm)),
        images=images,
        found_mm=found,
        figures=figures(setup.grid, small, targets),
        cost=spent,
    )


def _images(method: Method, session: Simulated, dv: FloatArray, n_pixels: int) -> FloatArray:
    if isinstance(method, Learns):
        method.learn(session.untouched_v)
    images = np.asarray(method.reconstruct(dv), dtype=np.float64)
    if images.shape != (len(dv), n_pixels) or not np.isfinite(images).all():
        raise UsageError(
            f"{method.name}: made images {images.shape} of {len(dv)} frames; they must be"
            f" finite, one value for each of {n_pixels} pixels"
        )
    return images
