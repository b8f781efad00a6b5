"""A drawing of what MIoU measures, and images of one scene near MIoU .75, .85 and .95."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.fem.grid import Grid
from eitskin.model.prebuilt import load_prebuilt
from eitskin.progress import Progress, silent
from eitskin.scene.random_touches import TouchScene, random_touches
from eitskin.scoring import metrics
from eitskin.skin.skin import Skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, Panel, draw_panel, load_matplotlib
from eitskin_studies.compare.baselines import gauss_newton
from eitskin_studies.compare.families import setup_for
from eitskin_studies.harness.sessions import SceneSolver
from eitskin_studies.harness.thresholds import best_threshold, miou_curves
from eitskin_studies.pictures.comparison_pictures import truth_marks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TARGETS = {"Gauss-Newton": 0.75, "eitskin, solver's image": 0.85, "eitskin, image shown": 0.95}
SCENES, SNR_DB, SEED, ELEMENTS = 400, 60.0, 1, 6000
BOTH, FALSE, MISSED = "#0072b2", "#e69f00", "#8a8a8a"
LABELS = {"in both": BOTH, "only in the image": FALSE, "only in the truth": MISSED}


@dataclass(frozen=True, eq=False)
class _Shown:
    """An image of a scene: pixels (n,), its mask on the raster (p,), and its MIoU."""

    name: str
    scene: TouchScene
    image: FloatArray
    mask: BoolArray
    truth: BoolArray
    miou: float


def draw_miou(path: Path, progress: Progress = silent) -> None:
    """The images by the methods of ``TARGETS`` of the scene of two or three touches in which they
    come nearest to these MIoU, and what of them counts.

    Raises:
        MissingExtraError: matplotlib or the mesher is not installed.
        FileError: it cannot be written.
    """
    matplotlib = load_matplotlib()
    model, _ = load_prebuilt()
    scorer = metrics.judge_for(model.skin.outline, model.grid)
    several = [one for one in _images(scorer, progress) if len(one[0].scene.touches) > 1]
    chosen = min(several, key=_distance)
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(8.4, 4.9), layout="constrained")
        axes = figure.subplots(2, 1 + len(chosen))
        _draw_truth(axes[0, 0], model.skin, model.grid, chosen[0])
        _draw_rule(axes[1, 0])
        for column, one in enumerate(chosen, start=1):
            marks = truth_marks(one.scene, model.skin.conductivity_s_per_m)
            title = f"MIoU {one.miou:.2f}\n{one.name}"
            panel = Panel(title, one.image, marks)
            draw_panel(axes[0, column], model.skin, model.grid, panel, small=True)
            draw_panel(axes[1, column], model.skin, model.grid, Panel("", None), small=True)
            _draw_masks(axes[1, column], scorer.raster.points_mm, one)
        patch = matplotlib.patches.Patch
        handles = [patch(color=colour, label=label) for label, colour in LABELS.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
        figure.suptitle("MIoU: how much of the touched area is right")
        save_picture(figure, path)


def _distance(images: Sequence[_Shown]) -> float:
    """Return the distance of a scene's images from ``TARGETS``."""
    return sum((one.miou - TARGETS[one.name]) ** 2 for one in images)


def _images(scorer: metrics.ImageScorer, progress: Progress) -> list[tuple[_Shown, ...]]:
    """For each scene its image by each method of ``TARGETS``."""
    model, blob = load_prebuilt()
    drawn = random_touches(model.skin.outline, SEED, SCENES, "miou")
    session = SceneSolver(model.skin, model.protocol, ELEMENTS).session(drawn, progress)
    measured, truths = session.measured(SNR_DB), session.truths(scorer.raster)
    core = Reconstructor(model, blob=blob)
    core.tare(measured.untouched_v)
    results = []
    for frame in measured.frames_v[:, -1]:
        core.forget()
        results.append(core.reconstruct(frame))
    setup = setup_for(model.skin, model.protocol, elements=ELEMENTS)
    differences = measured.frames_v[:, -1] - measured.untouched_v.mean(axis=0)
    images = {
        "Gauss-Newton": gauss_newton(setup.jacobian, 1e-6).reconstruct(differences),
        "eitskin, solver's image": np.array([one.solver_image for one in results]),
        "eitskin, image shown": np.array([one.image for one in results]),
    }
    by_method = []
    for name, shown in images.items():
        t = best_threshold(miou_curves(scorer, shown, truths))
        found = []
        for scene, image, truth in zip(drawn.scenes, shown, truths, strict=True):
            mask = scorer.lookup.show(image) > t * image.max()
            found.append(_Shown(name, scene, image, mask, truth, metrics.miou(mask, truth)))
        by_method.append(found)
    return list(zip(*by_method, strict=True))


def _draw_truth(axes: Axes, skin: Skin, grid: Grid, one: _Shown) -> None:
    marks = truth_marks(one.scene, skin.conductivity_s_per_m)
    panel = Panel("the truth\n ", None, marks, fill_truth=True)
    draw_panel(axes, skin, grid, panel, small=True)


def _draw_rule(axes: Axes) -> None:
    """Two overlapping discs: IoU is what both cover over what either covers."""
    circle = load_matplotlib().patches.Circle
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set(xlim=(-2.0, 2.6), ylim=(-3.4, 1.9))
    axes.add_patch(circle((0.6, 0), 1.0, color=FALSE))
    axes.add_patch(circle((0, 0), 1.0, color=MISSED))
    both = circle((0.6, 0), 1.0, color=BOTH)
    axes.add_patch(both)
    both.set_clip_path(circle((0, 0), 1.0, transform=axes.transData))
    text = (
        "IoU = in both\n/ in either\n\nMIoU = mean of the\nIoU of the touched area\nand of the rest"
    )
    axes.text(0.3, -1.3, text, ha="center", va="top", fontsize=8, color=INK)


def _draw_masks(axes: Axes, points_mm: FloatArray, one: _Shown) -> None:
    parts = (
        (one.mask & one.truth, BOTH),
        (one.mask & ~one.truth, FALSE),
        (~one.mask & one.truth, MISSED),
    )
    for part, colour in parts:
        x, y = points_mm[part].T
        axes.scatter(x, y, s=2.2, color=colour, marker="s", linewidths=0)
