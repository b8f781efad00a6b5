"""Find three simulated touches with each engine, and compare them with the truth. Their frames ship
with the package, so that this needs neither scipy nor netgen."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from time import perf_counter
from typing import Any

import numpy as np

from eitskin.core.engine import CoreEngine
from eitskin.core.results import Reconstruction
from eitskin.frames.frames import Frames, load_frames
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch
from eitskin.scoring.score import FrameScore, scorer_for
from eitskin.solve.reconstructor import ENGINES, Reconstructor

TOUCHES = (
    TrueTouch(-38.0, 34.0, 9.0, 8.0),
    TrueTouch(44.0, 22.0, 7.0, 5.0),
    TrueTouch(-6.0, -52.0, 11.0, 4.0),
)
SEED, SNR_DB = 1, 60.0  # of the frames that ship
# made by  eitskin demo --seed 1 --no-board --frames python/eitskin/demo/demo_frames.npz
SHIPPED = "demo_frames.npz"
TIMED_RUNS = 200
ENGINE_NAMES = {"c": "C float32", "c64": "C float64"}


@dataclass(frozen=True, eq=False)
class Demo:
    """The frames of the session, the result of each engine, and the score and times (in
    microseconds) of the float32 core."""

    frames: Frames
    model: Model
    results: dict[str, Reconstruction]
    score: FrameScore
    time_us_p50: float
    time_us_p99: float
    kernels: str

    @property
    def result(self) -> Reconstruction:
        """The result of the float32 core, which also runs on boards."""
        return self.results["c"]

    @property
    def differences(self) -> dict[str, float]:
        """The greatest difference between the C core's solver's images and numpy's, relative to the
        peak."""
        image = self.results["numpy"].solver_image
        peak = np.abs(image).max() or 1.0
        return {
            f"{name} to numpy": float(np.abs(self.results[k].solver_image - image).max() / peak)
            for k, name in ENGINE_NAMES.items()
        }


def shipped_frames() -> Frames:
    """Return the frames that ship with the package, with their truth: those of
    ``simulated_frames(SEED, SNR_DB)``."""
    with resources.as_file(resources.files("eitskin.demo") / SHIPPED) as path:
        return load_frames(path)


def simulated_frames(seed: int, snr_db: float) -> Frames:
    """Simulate the touches on another, finer mesh than the model's, with noise and contacts drawn
    with ``seed``.

    Raises:
        MissingExtraError: scipy or netgen is not installed.
    """
    from eitskin.scene.simulate import Measurement, simulate
    from eitskin.skin.protocol import adjacent
    from eitskin.skin.skin import paper_skin

    touches = TouchSet("demo", seed, (TouchScene("demo", TOUCHES),))
    measurement = Measurement(snr_db=snr_db)
    return simulate(paper_skin(), adjacent(16), touches, measurement=measurement).as_frames()


def run_demo(frames: Frames, step: Callable[[str], None]) -> Demo:
    """Reconstruct ``frames`` with the prebuilt model. ``step`` is called with a line of text when
    it starts."""
    step("finding them: C core in float32 and float64, numpy")
    model, blob = load_prebuilt()
    results = {}
    for engine in ENGINES:
        reconstructor = Reconstructor(model, engine=engine, blob=blob)
        reconstructor.set_options(solver="fista")  # on every column, so that images compare
        reconstructor.tare(frames.reference_voltage_v)
        results[engine] = reconstructor.reconstruct(frames.voltage_v[0])
    score = scorer_for(model).score(frames, 0, results["c"], "increase")
    assert score is not None  # the frames hold their truth
    core = CoreEngine(blob)
    core.set_reference(frames.reference_voltage_v)
    p50, p99 = _times_us(core, frames)
    return Demo(frames, model, results, score, p50, p99, core.kernels)


def _times_us(core: CoreEngine, frames: Frames) -> tuple[float, float]:
    """Return the median and the 99th percentile of the time from voltages to touches, through
    cffi."""
    times = []
    for _ in range(TIMED_RUNS):
        start = perf_counter()
        core.reconstruct(frames.voltage_v[0])
        times.append(1e6 * (perf_counter() - start))
    p50, p99 = np.percentile(times, [50, 99])
    return float(p50), float(p99)


def to_json(demo: Demo) -> dict[str, Any]:
    """Return everything that the text says, unrounded, as JSON values."""
    info, score = demo.result.info, demo.score
    return {
        "true": [[t.x_mm, t.y_mm, t.radius_mm] for t in TOUCHES],
        "found": [[t.x_mm, t.y_mm, t.radius_mm] for t in demo.result.touches],
        "hits": score.matching.hits,
        "false": score.matching.false_touches,
        "position_errors_mm": list(score.matching.distances_mm),
        "miou_image": score.miou_image,
        "miou_solver": score.miou_solver,
        "miou_touches": score.miou_touches,
        "difference_over_peak": demo.differences,
        "iterations": info.iterations,
        "macs_solve": info.macs,
        "macs_touches": info.touch_macs,
        "time_us_p50": demo.time_us_p50,
        "time_us_p99": demo.time_us_p99,
        "kernels": demo.kernels,
        "snr_db": demo.frames.meta["snr_db"],
        "mesh_elements_simulated": demo.frames.meta["mesh_elements"],
        "mesh_elements_model": demo.model.meta.get("mesh_elements"),
    }


def to_text(demo: Demo) -> str:
    """Return a table of the found and true touches, and the cost, as text."""
    facts, info, matching = to_json(demo), demo.result.info, demo.score.matching
    lines = [
        (
            f"simulated on {facts['mesh_elements_simulated']} elements at {facts['snr_db']:g} dB; "
            f"model from {facts['mesh_elements_model']} elements"
        ),
        "          true x      y  radius |  found x      y  radius | error mm",
    ]
    found_of = dict(matching.pairs)
    for k, true in enumerate(TOUCHES):
        row = f"touch {k + 1} {true.x_mm:9.2f} {true.y_mm:6.2f} {true.radius_mm:7.2f} |"
        if k in found_of:
            t = demo.result.touches[found_of[k]]
            error = float(np.hypot(t.x_mm - true.x_mm, t.y_mm - true.y_mm))
            lines.append(f"{row} {t.x_mm:8.2f} {t.y_mm:6.2f} {t.radius_mm:7.2f} | {error:8.2f}")
        else:
            lines.append(f"{row}      not found")
    lines += [
        (
            f"{matching.false_touches} false touches; MIoU image {demo.score.miou_image:.3f}, "
            f"solver's image {demo.score.miou_solver:.3f}, "
            f"touches as discs {demo.score.miou_touches:.3f}"
        ),
        (
            "greatest difference of images over the peak: "
            + ", ".join(f"{what} {value:.1e}" for what, value in demo.differences.items())
        ),
        (
            f"{info.iterations} iterations, {info.macs / 1e6:.2f} + {info.touch_macs / 1e6:.2f}"
            f" million MACs (solve + touches); {demo.time_us_p50:.0f} us per frame, p99"
            f" {demo.time_us_p99:.0f} us ({demo.kernels} kernels)"
        ),
    ]
    return "\n".join(lines)
