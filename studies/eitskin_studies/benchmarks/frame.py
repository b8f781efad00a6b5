"""One frame through cffi: how long, how much of it outside C, beside the oracle in numpy and,
where installed, pyEIT. Interleaved runs, ratios."""

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter_ns
from typing import Any

import numpy as np

from eitskin.core.engine import CoreEngine
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.harness.bare_core import bare_calls
from eitskin_studies.harness.machine import machine

SEED = 20240918


@dataclass(frozen=True)
class FrameTimes:
    """Microseconds, median and 99th percentile of each kind of call; ``macs`` of the solve and of
    the touches."""

    p50_us: dict[str, float]
    p99_us: dict[str, float]
    macs: int
    touch_macs: int
    iterations: int
    kernels: str
    runs: int

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**self.__dict__, "outside_c_share": self.outside_c_share, "machine": machine()}

    @property
    def outside_c_share(self) -> float:
        """The part of a whole Python call, at the median, that is not spent in C."""
        return (
            1
            - (self.p50_us["C: solve"] + self.p50_us["C: touches"])
            / self.p50_us["Python: frame to touches"]
        )


def golden_session() -> tuple[
    CoreEngine, CoreEngine, CoreEngine, Reconstructor, np.ndarray[Any, Any]
]:
    """The core, cold and warm, the portable core, the oracle in numpy, tared; and 32 noisy golden
    frames (60 dB)."""
    model, blob = load_prebuilt()
    rng = np.random.default_rng(SEED)
    reference = model.golden.reference_v.astype(np.float64)
    noise = np.sqrt(np.mean(reference**2)) * 1e-3
    untouched = reference + noise * rng.standard_normal((64, len(reference)))
    frames = model.golden.frame_v + noise * rng.standard_normal((32, len(reference)))
    core, warm, portable = (
        CoreEngine(blob),
        CoreEngine(blob),
        CoreEngine(blob, prepared=False, portable=True),
    )
    warm.set_options(replace(default_options(model), warm_start=True))
    numpy_engine = Reconstructor(model, engine="numpy")
    for engine in (core, warm, portable):
        engine.set_reference(untouched)
    numpy_engine.tare(untouched)
    return core, warm, portable, numpy_engine, frames


def pyeit_frames(
    reference_v: np.ndarray[Any, Any],
) -> dict[str, Callable[[np.ndarray[Any, Any]], Any]]:
    """pyEIT's one-step solvers on a mesh of about 3,000 elements, set up: each takes a frame (m,)
    volts and gives its image on the elements. Empty where it, scipy or netgen is not installed."""
    if any(importlib.util.find_spec(name) is None for name in ("pyeit", "scipy", "netgen")):
        return {}
    from eitskin.fem.mesh import mesh_for_elements
    from eitskin.skin.protocol import adjacent
    from eitskin.skin.skin import paper_skin
    from eitskin_studies.benchmarks.jacobian import pyeit_case

    skin, protocol = paper_skin(), adjacent(16)
    theirs, pattern, order = pyeit_case(mesh_for_elements(skin, 3000), skin, protocol)
    gauss_newton = importlib.import_module("pyeit.eit.jac").JAC(theirs, pattern)
    gauss_newton.setup(p=0.5, lamb=0.01, method="kotre")
    back_projection = importlib.import_module("pyeit.eit.bp").BP(theirs, pattern)
    back_projection.setup(weight="none")
    base = reference_v[order]
    return {
        "pyEIT: Gauss-Newton, image only": lambda frame: gauss_newton.solve(frame[order], base),
        "pyEIT: back projection, image only": lambda frame: back_projection.solve(
            frame[order], base
        ),
    }


def run(runs: int = 2000) -> FrameTimes:
    """Time ``runs`` frames of the core, and a hundredth as many of the slow engines among them."""
    core, warm, portable, reference, frames = golden_session()
    peers = pyeit_frames(frames.mean(axis=0))
    samples: dict[str, list[float]] = {}

    def clock(name: str, call: Any) -> None:
        start = perf_counter_ns()
        call()
        samples.setdefault(name, []).append((perf_counter_ns() - start) / 1000)

    for k in range(-20, runs):
        frame = frames[k % len(frames)]
        solve, touches = bare_calls(core, frame)
        if k < 0:
            solve()
            continue
        clock("C: solve", solve)
        clock("C: touches", touches)
        clock("Python: frame to touches", lambda f=frame: core.reconstruct(f))
        clock("Python: frame to touches, warm", lambda f=frame: warm.reconstruct(f))
        if k % 100 == 0:
            clock("C, portable kernels: frame to touches", lambda f=frame: portable.reconstruct(f))
            clock("numpy: image only", lambda f=frame: reference.reconstruct(f, touches=False))
            for name, peer in peers.items():
                clock(name, lambda f=frame, solve=peer: solve(f))
    info = core.reconstruct(frames[0]).info
    return FrameTimes(
        {name: float(np.median(values)) for name, values in samples.items()},
        {name: float(np.percentile(values, 99)) for name, values in samples.items()},
        info.macs,
        info.touch_macs,
        info.iterations,
        core.kernels,
        runs,
    )


def to_text(times: FrameTimes) -> str:
    """A table."""
    whole = times.p50_us["Python: frame to touches"]
    lines = [
        (
            f"one frame, prebuilt model, defaults: {times.iterations} iterations,"
            f" {times.macs / 1e6:.2f} + {times.touch_macs / 1e6:.2f} million MACs, {times.kernels}"
            f" kernels; {times.runs} interleaved runs; {machine()}"
        ),
        f"{'':40} p50 us   p99 us  ratio of p50",
    ]
    for name, p50 in times.p50_us.items():
        lines.append(f"{name:38} {p50:8.1f} {times.p99_us[name]:8.1f} {p50 / whole:10.2f}")
    lines.append(
        f"outside C: {100 * times.outside_c_share:.1f} % of a Python call from frame to touches"
        " (median)"
    )
    return "\n".join(lines)
