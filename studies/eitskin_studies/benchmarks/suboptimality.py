"""How near an image is to the objective's optimum, against how good a picture it is: not the same
thing.

Each solver is stopped ever later; for each stop the threshold that makes the mask is chosen on
training scenes, and the mean MIoU and the mean suboptimality are those of test scenes, prebuilt
model.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.progress import Progress
from eitskin.scene.simulate import Simulated
from eitskin.scoring import metrics
from eitskin_studies.benchmarks.solve_problems import bench_options, make_problems, models, sessions
from eitskin_studies.compare.run import truth_masks
from eitskin_studies.harness.sections import Filling
from eitskin_studies.harness.thresholds import best_threshold, miou_curves

MIN = 1e-7
"""Below this float32 says no more; shown as this."""
STEPS: dict[str, tuple[dict[str, int], ...]] = {
    "fista": tuple({"iterations": n} for n in (10, 20, 30, 60, 120, 250, 500, 1000, 2500, 6000)),
    "working-set": tuple({"iterations": n} for n in (10, 20, 30, 60, 120, 250, 500, 1000, 6000)),
    "active-set": tuple(
        {"iterations": 1000, "mac_limit": n}
        for n in (150_000, 180_000, 220_000, 260_000, 320_000, 0)
    ),
}


@dataclass(frozen=True)
class StopPoint:
    """One solver stopped at one point: means over the test scenes; ``threshold`` was chosen on the
    training scenes."""

    solver: str
    effort: int
    suboptimality: float
    miou: float
    worst_tenth: float
    macs: float
    threshold: float


@dataclass(frozen=True)
class GapCurves:
    """All stops; ``train`` and ``test`` name the scenes."""

    stops: tuple[StopPoint, ...]
    train: str
    test: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def run(scenes: int, seed: int, progress: Progress) -> GapCurves:
    """The curves on ``scenes`` test scenes and half as many training scenes of ``seed``, 60 dB."""
    name, model, blob = models()[0]
    test, train = sessions(scenes, seed), sessions(max(2, scenes // 2), seed, "train")
    problems = make_problems(name, model, blob, test)
    image_scorer = metrics.judge_for(test.skin.outline, model.grid)
    truths = [
        truth_masks(session.touches, image_scorer.raster.points_mm) for session in (train, test)
    ]
    engine = CoreEngine(blob)
    stops = []
    for solver, settings in progress(
        [(solver, how) for solver, steps in STEPS.items() for how in steps]
    ):
        engine.set_options(bench_options(model, solver=solver, **settings))
        trained, _, _ = _images(engine, train)
        images, coefficients, macs = _images(engine, test)
        threshold = best_threshold(miou_curves(image_scorer, trained, truths[0]))
        scores = miou_curves(image_scorer, images, truths[1], [threshold])[:, 0]
        off = [problems.suboptimality(k, x) for k, x in enumerate(coefficients)]
        worst = np.sort(scores)[: max(1, -(-len(scores) // 10))]
        effort = settings.get("mac_limit", settings["iterations"])
        stops.append(
            StopPoint(
                solver,
                effort,
                float(np.mean(off)),
                float(scores.mean()),
                float(worst.mean()),
                float(np.mean(macs)),
                threshold,
            )
        )
    return GapCurves(tuple(stops), train.touches.name, test.touches.name)


def _images(engine: CoreEngine, session: Simulated) -> tuple[FloatArray, FloatArray, list[int]]:
    engine.set_reference(session.untouched_v)
    images, coefficients, macs = [], [], []
    for frame in session.frames_v:
        engine.forget()
        result = engine.reconstruct(frame, touches=False)
        images.append(result.solver_image)
        coefficients.append(result.coefficients)
        macs.append(result.info.macs)
    return np.array(images, dtype=np.float64), np.array(coefficients, dtype=np.float64), macs


def text(curves: GapCurves) -> str:
    """A table."""
    lines = [
        f"thresholds from {curves.train}, numbers of {curves.test}, 60 dB, rank 64, float32",
        (
            f"{'solver':13} {'stopped at':>12} {'(F - F*) / F*':>14} {'MIoU':>6}"
            f" {'worst tenth':>12} {'kMAC':>8} {'t':>5}"
        ),
    ]
    for s in curves.stops:
        effort = "optimum" if s.solver == "active-set" and s.effort == 0 else f"{s.effort}"
        lines.append(
            f"{s.solver:13} {effort:>12} {max(s.suboptimality, MIN):14.1e} {s.miou:6.3f}"
            f" {s.worst_tenth:12.3f} {s.macs / 1e3:8.0f} {s.threshold:5.2f}"
        )
    return "\n".join(lines)


OPTIMUM = "active set, to the optimum"
NAMES = {"fista": "FISTA", "working-set": "FISTA on a working set"}
HEAD = ("solver", "MACs a frame, mean", "(F - F*) / F*", "MIoU", "mean of worst 10 %")


def for_page(curves: GapCurves, command: str) -> Filling:
    """The marks of studies/results/benchmarks.md."""
    rows = []
    for one in curves.stops:
        if one.solver == "active-set":
            name = f"active set, {one.effort // 1000} kMAC at most" if one.effort else OPTIMUM
        else:
            name = f"{NAMES[one.solver]}, {one.effort} iterations"
        rows.append(
            (
                name, f"{one.macs / 1e3:,.0f} k", f"{one.suboptimality:.1e}",
                f"{one.miou:.3f}".lstrip("0"), f"{one.worst_tenth:.3f}".lstrip("0"),
            )
        )  # fmt: skip
    run = f"By `{command}`, with the scenes `{curves.train}` and `{curves.test}`."
    return {"optimum-run": run}, {"optimum": (HEAD, rows)}
