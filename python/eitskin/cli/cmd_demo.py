"""``eitskin demo``: three simulated touches, found by the C core, beside the truth."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.errors import FileError, UsageError

if TYPE_CHECKING:
    from eitskin.scene.random_touches import TouchSet

TOUCHES = ((-38.0, 34.0, 9.0, 8.0), (44.0, 22.0, 7.0, 5.0), (-6.0, -52.0, 11.0, 4.0))
TIMED_RUNS = 200


def add_parser(subparsers: Any) -> None:
    """Add ``demo``."""
    parser = subparsers.add_parser(
        "demo",
        help="three simulated touches, reconstructed in C, beside the truth",
        description="Simulate three touches on the paper's skin (nonlinear forward model on another, finer mesh, noise), "
        "reconstruct them with the C core and the prebuilt model, and draw them.",
    )
    parser.add_argument("--snr-db", type=float, default=60.0, metavar="DB", help="20 log10(rms(V0)/sigma) (default: %(default)g)")
    parser.add_argument("--seed", type=int, default=1, help="of noise and contacts (default: %(default)s)")
    parser.add_argument("--picture", type=Path, default=Path("demo.png"), metavar="PNG", help="default: %(default)s")
    parser.add_argument("--frames", type=Path, metavar="NPZ", help="also write the simulated frames, with their truth")
    parser.add_argument("--json", action="store_true")
    parser.set_defaults(run=run)


def demo_touches(seed: int) -> TouchSet:
    """The demo's scene; ``seed`` is that of contacts and noise."""
    from eitskin.scene.random_touches import Scene, Touch, TouchSet

    return TouchSet("demo", seed, (Scene("demo", tuple(Touch(*numbers) for numbers in TOUCHES)),))


def run(options: argparse.Namespace) -> int:
    """Simulate, reconstruct, print, draw."""
    from time import perf_counter

    import numpy as np

    from eitskin.frames.frames import save_frames
    from eitskin.model.prebuilt import load_prebuilt
    from eitskin.scene.simulate import Measurement, simulate
    from eitskin.skin.protocol import adjacent
    from eitskin.skin.skin import paper_skin
    from eitskin.solve.core import CoreEngine
    from eitskin.solve.reconstructor import Reconstructor
    from eitskin.study.score import scorer_for
    from eitskin.view.frame_pictures import found_marks
    from eitskin.view.pictures import Mark, draw_frame

    for path in (options.picture, options.frames):
        if path is not None and not path.parent.is_dir():
            raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
    if not -20 <= options.snr_db <= 200 or options.seed < 0:
        raise UsageError("demo: --snr-db must be -20 to 200 and --seed at least 0")
    skin = paper_skin()
    touches = demo_touches(options.seed)
    simulated = simulate(skin, adjacent(16), touches, measurement=Measurement(snr_db=options.snr_db))
    model, blob = load_prebuilt()
    frames = simulated.as_frames()
    if options.frames is not None:
        save_frames(options.frames, frames)
    results = {}
    for engine in ("c", "c64", "numpy"):
        reconstructor = Reconstructor(model, engine=engine, blob=blob)
        reconstructor.tare(frames.reference_voltage_v)
        results[engine] = reconstructor.reconstruct(frames.voltage_v[0])
    result, peak = results["c"], float(np.abs(results["numpy"].image).max()) or 1.0
    differences = {name: float(np.abs(results[name].image - results["numpy"].image).max()) / peak for name in ("c", "c64")}
    core = CoreEngine(blob)
    core.set_baseline(frames.reference_voltage_v)
    times_us = []
    for _ in range(TIMED_RUNS):
        start = perf_counter()
        core.reconstruct(frames.voltage_v[0])
        times_us.append(1e6 * (perf_counter() - start))
    p50, p99 = (float(v) for v in np.percentile(times_us, [50, 99]))
    score = scorer_for(model).score(frames, 0, result, "increase")
    assert score is not None
    truth = tuple(
        Mark(t.x_mm, t.y_mm, t.radius_mm, (t.contrast - 1) * skin.conductivity_s_per_m) for t in touches.scenes[0].touches
    )
    draw_frame(
        options.picture,
        skin,
        model.grid,
        result.image,
        truth=truth,
        found=found_marks(result),
        title=f"three simulated touches at {options.snr_db:g} dB, solved by the C core",
    )
    facts = {
        "found": [[t.x_mm, t.y_mm, t.radius_mm] for t in result.touches],
        "true": [list(t[:3]) for t in TOUCHES],
        "hits": score.matching.hits,
        "false": score.matching.false_touches,
        "position_errors_mm": list(score.matching.distances_mm),
        "miou_image": score.miou_image,
        "miou_touches": score.miou_touches,
        "difference_to_numpy_over_peak": {"c_float32": differences["c"], "c_float64": differences["c64"]},
        "macs_solve": result.info.macs,
        "macs_touches": result.info.touch_macs,
        "iterations": result.info.iterations,
        "time_us_p50": p50,
        "time_us_p99": p99,
        "kernels": core.kernels,
        "mesh_elements_simulated": simulated.mesh_elements,
        "mesh_elements_model": model.meta.get("mesh_elements"),
        "picture": str(options.picture),
    }
    if options.json:
        print(json.dumps(facts, indent=2))
        return 0
    found_of = dict(score.matching.pairs)
    print(f"simulated on {facts['mesh_elements_simulated']} elements, {options.snr_db:g} dB; model from {facts['mesh_elements_model']} elements")
    print("          true x      y  radius |  found x      y  radius | error mm")
    for k, (x, y, radius, _) in enumerate(TOUCHES):
        row = f"touch {k + 1} {x:9.2f} {y:6.2f} {radius:7.2f} |"
        if k in found_of:
            t = result.touches[found_of[k]]
            error = np.hypot(t.x_mm - x, t.y_mm - y)
            print(f"{row} {t.x_mm:8.2f} {t.y_mm:6.2f} {t.radius_mm:7.2f} | {error:8.2f}")
        else:
            print(f"{row}      not found")
    print(f"{score.matching.false_touches} false touches; MIoU image {score.miou_image:.3f}, touches as discs {score.miou_touches:.3f}")
    print(f"greatest difference to numpy over the peak: C float32 {differences['c']:.1e}, C float64 {differences['c64']:.1e}")
    print(
        f"{result.info.iterations} iterations, {result.info.macs / 1e6:.2f} + {result.info.touch_macs / 1e6:.2f} million MACs "
        f"(solve + touches); {p50:.0f} us a frame, p99 {p99:.0f} us ({core.kernels} kernels)"
    )
    print(f"picture: {options.picture}")
    return 0
