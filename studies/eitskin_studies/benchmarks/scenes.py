"""The cost of scenes: each effect's price on one scene, frames of a moving touch, and a dataset of
static scenes.

Runs are interleaved and medians reported; meshing is not timed but for the effect that needs a mesh
of its own, once, before timing. The dataset's scenes are drawn, solved, measured and compressed as
``eitskin dataset`` does it.
"""

import statistics
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter, process_time
from typing import Any

import numpy as np

from eitskin.fem.cem import factorise
from eitskin.progress import Progress, silent
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import Scene
from eitskin.scene.library_scenes import find_scene
from eitskin.scene.registry import BUILT_IN
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scene.touch_path import Keyframe, TouchTrack
from eitskin_studies.datasets.dataset import Job, job_of, make_chunk
from eitskin_studies.datasets.ranges import drawn
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sections import Filling, Tabular

PROJECTED = 10_000
DEFAULTS: dict[str, dict[str, Any]] = {
    "noise": {"snr_db": 60.0},
    "contact_impedance": {"spread": 0.2},
    "mux": {"on_spread_ohm": 5.0},
}


def moving_scene(frames: int = 100, elements: int = 3000) -> Scene:
    """A touch that crosses the skin, another place in each frame, and no effect."""
    rate_hz = 20.0
    end = (frames - 1) / rate_hz
    path = (Keyframe(0.0, -70, -10, 8), Keyframe(end / 2, 0, 25, 8), Keyframe(end, 70, -10, 8))
    return Scene(
        "moving",
        touches=(TouchTrack(path),),
        frames=frames,
        rate_hz=rate_hz,
        quiet_frames=4,
        elements=elements,
        frozen=True,
    )


def effects_table(
    frames: int = 100, rounds: int = 5, progress: Progress = silent
) -> dict[str, Any]:
    """The moving scene with no effect, with each alone, with all: plain values fit for JSON, times
    in s of the processor, so that other processes hardly count."""
    base = moving_scene(frames)
    # flex is for skins that cover a surface
    every = {name: DEFAULTS.get(name, {}) for name in BUILT_IN if name != "flex"}
    cases = {"none": {}, **{name: {name: table} for name, table in every.items()}, "all": every}
    workspace, times, rows = MeshCache(), dict[str, list[float]](), {}
    work = [(name, k) for k in range(rounds + 1) for name in cases]
    for name, k in progress(work):
        scene = replace(base, effects=cases[name])
        start = process_time()
        compiled = compile_scene(scene, mesh_cache=workspace)
        middle = process_time()
        done = simulate_frames(compiled)
        end = process_time()
        if k:
            times.setdefault(name, []).append(end - start)
            rows[name] = {
                "steps": len(compiled.plan.steps),
                "method": compiled.method,
                "factorisations": done.work.factorisations,
                "solves": done.work.solves,
                "random_numbers": compiled.plan.random_numbers,
                "compile_s": middle - start,
            }
    none = statistics.median(times["none"])
    bare = imported_by([])
    for name, row in rows.items():
        median = statistics.median(times[name])
        more = imported_by(sorted(cases[name]))
        row |= {
            "total_s": median,
            "least_s": min(times[name]),
            "ratio": median / none,
            "peak_mb": _peak_mb(replace(base, effects=cases[name]), workspace),
            "modules": len(more - bare),
        }
    return {"machine": machine(), "frames": base.n_frames, "rounds": rounds, "cases": rows}


def imported_by(effects: Sequence[str]) -> set[str]:
    """Return the modules that a process has loaded after it ran a small scene with ``effects`` at
    their defaults."""
    probe = """
import sys
from pathlib import Path
from eitskin.scene.description import scene_from_table
from eitskin.scene.runner import run_scene
head = {"name": "probe", "frames": 2, "quiet_frames": 1, "elements": 400}
touch = {"radius_mm": 10.0, "x_mm": 0.0, "y_mm": 0.0}
effects = {name: {} for name in sys.argv[1:]}
if "noise" in effects:
    effects["noise"] = {"snr_db": 60.0}
table = {"scene": head, "touch": [touch], "effects": effects}
run_scene(scene_from_table(table, "probe", Path()))
print("\\n".join(sys.modules))
"""
    command = [sys.executable, "-c", probe, *effects]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def _peak_mb(scene: Scene, workspace: MeshCache) -> float:
    """Return the peak of the memory that Python allocates while the scene is compiled and run, in
    MB."""
    tracemalloc.start()
    simulate_frames(compile_scene(scene, mesh_cache=workspace))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def effects_cells(result: dict[str, Any]) -> Tabular:
    """The table of a page."""
    head = ("effects", "time, of that without", "ms", "factorisations", "solves", "random numbers",
            "memory, MB", "more modules")  # fmt: skip
    rows = [
        (
            name.replace("_", " "),
            f"{row['ratio']:.2f}",
            f"{1e3 * row['total_s']:.0f}",
            str(row["factorisations"]),
            str(row["solves"]),
            f"{row['random_numbers']:.0f}",
            f"{row['peak_mb']:.1f}",
            str(row["modules"]),
        )
        for name, row in result["cases"].items()
    ]
    return head, rows


def effects_filling(result: dict[str, Any], command: str) -> Filling:
    """Return the texts and the table that ``--page`` writes."""
    conditions = (
        f"A touch crosses the skin in {result['frames']} frames, on about 3,000 elements; effects"
        f" have their defaults. Median of {result['rounds']} interleaved rounds, processor time of"
        f" compile and run, without meshing; {result['machine']}."
    )
    texts = {"conditions": conditions, "command": f"Made by `{command}`."}
    return texts, {"effects": effects_cells(result)}


def effects_text(result: dict[str, Any]) -> str:
    """The result of ``effects_table`` as a table."""
    lines = [
        (
            f"a moving touch, {result['frames']} frames on about 3,000 elements, effects at their"
            f" defaults; median of {result['rounds']} interleaved rounds"
        ),
        f"processor time: compile and run, without meshing; {result['machine']}",
        "",
        (
            f"{'effects':<18} {'ms':>8} {'ratio':>7} {'steps':>6} {'factorisations':>15}"
            f" {'solves':>7} {'random':>8} {'MB':>6} {'modules':>7}  solve by"
        ),
    ]
    for name, row in result["cases"].items():
        lines.append(
            f"{name:<18} {1e3 * row['total_s']:>8.1f} {row['ratio']:>6.2f}x {row['steps']:>6}"
            f" {row['factorisations']:>15} {row['solves']:>7} {row['random_numbers']:>8.0f}"
            f" {row['peak_mb']:>6.1f} {row['modules']:>7}  {row['method']}"
        )
    return "\n".join(lines)


def scenes_table(
    frames: int = 400,
    scenes: int = 500,
    elements: int = 3000,
    rounds: int = 3,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Frames per second of a moving touch, both ways, and the rate of static scenes of a dataset,
    in one process."""
    workspace = MeshCache()
    ways: dict[str, Any] = {}
    frames_v = {}
    for method in ("update", "factorise"):
        scene = replace(moving_scene(frames, elements), solver=method)
        compile_scene(scene, mesh_cache=workspace)
        compile_s, run_s = [], []
        for _ in range(rounds):
            start = perf_counter()
            compiled = compile_scene(scene, mesh_cache=workspace)
            middle = perf_counter()
            done = simulate_frames(compiled)
            compile_s.append(middle - start)
            run_s.append(perf_counter() - middle)
        frames_v[method] = done.voltage_v
        ways[method] = {
            "compile_s": statistics.median(compile_s),
            "run_s": statistics.median(run_s),
            "frames_per_s": (
                scene.n_frames / (statistics.median(compile_s) + statistics.median(run_s))
            ),
            "factorisations": done.work.factorisations,
            "solves": done.work.solves,
        }
    auto = compile_scene(
        replace(moving_scene(frames, elements), solver="auto"), mesh_cache=workspace
    )
    largest = float(np.abs(frames_v["factorise"]).max())
    return {
        "machine": machine(),
        "elements": auto.model.mesh.n_elements,
        "nodes": auto.model.mesh.n_nodes,
        "moving": {
            "frames": frames + 4,
            "auto": auto.method,
            "ways": ways,
            "largest_difference_relative": (
                float(np.abs(frames_v["update"] - frames_v["factorise"]).max()) / largest
            ),
        },
        "dataset": _dataset(scenes, elements, workspace, progress),
    }


def _dataset(
    scenes: int, elements: int, workspace: MeshCache, progress: Progress
) -> dict[str, Any]:
    job = job_of(replace(find_scene("random_touches"), elements=elements), scenes, 1)
    make_chunk(replace(job, count=1), 0, workspace)
    chunks, seconds, size = range(job.chunks), 0.0, 0
    parts: list[tuple[float, float]] = []
    time_parts = _timer_of_parts(job, workspace)
    for chunk in progress(chunks):
        start = perf_counter()
        size += len(make_chunk(job, chunk, workspace))
        seconds += perf_counter() - start
        parts += [time_parts() for _ in range(5)]
    return {
        "scenes": scenes,
        "seconds": seconds,
        "scenes_per_s": scenes / seconds,
        "bytes_a_scene": size / scenes,
        "projected_s": PROJECTED * seconds / scenes if scenes != PROJECTED else seconds,
        "shares": _shares(parts, _solved_states(job, workspace), seconds / scenes),
    }


def _solved_states(job: Job, workspace: MeshCache) -> int:
    compiled = compile_scene(drawn(job.scene, job.ranges, job.seed, 0), mesh_cache=workspace)
    return len(compiled.states) - len(compiled.known)


def _timer_of_parts(job: Job, workspace: MeshCache) -> Callable[[], tuple[float, float]]:
    """A function that times one factorisation and one solve of all patterns, alone, in s; called
    among the chunks."""
    compiled = compile_scene(drawn(job.scene, job.ranges, job.seed, 0), mesh_cache=workspace)
    model, impedance = compiled.model, compiled.states[0].contacts.impedance_ohm_m2
    conductivity = np.full(model.mesh.n_elements, job.scene.skin.conductivity_s_per_m)
    matrix = model.system_for(impedance == 0).matrix(conductivity, impedance)
    loads = np.zeros((matrix.shape[0], len(model.patterns.solved)))
    loads[: loads.shape[1]] = np.eye(loads.shape[1])

    def time_parts() -> tuple[float, float]:
        start = perf_counter()
        factors = factorise(matrix)
        middle = perf_counter()
        factors.solve(loads)
        return middle - start, perf_counter() - middle

    return time_parts


def _shares(parts: Sequence[tuple[float, float]], solved: int, scene_s: float) -> dict[str, float]:
    """The parts of a scene's time that its factorisations and its solves take."""
    factor_s, solve_s = (statistics.fmean(values) for values in zip(*parts, strict=True))
    shares = {
        "factorisation": solved * factor_s / scene_s,
        "triangular solves": solved * solve_s / scene_s,
    }
    return {**shares, "the rest": max(0.0, 1 - sum(shares.values()))}


def scenes_text(result: dict[str, Any]) -> str:
    """The result of ``scenes_table`` in words."""
    moving, dataset = result["moving"], result["dataset"]
    lines = [
        f"{result['elements']} elements, {result['nodes']} nodes, one process; {result['machine']}",
        "",
        (
            f"a moving touch, {moving['frames']} frames, another place in each (compile and run,"
            " without meshing)"
        ),
        f"{'solve by':<12} {'frames/s':>9} {'ms/frame':>9} {'factorisations':>15} {'solves':>7}",
    ]
    for name, way in moving["ways"].items():
        mark = "  <- chosen by the count" if name == moving["auto"] else ""
        lines.append(
            f"{name:<12} {way['frames_per_s']:>9.0f} {1e3 / way['frames_per_s']:>9.2f}"
            f" {way['factorisations']:>15} {way['solves']:>7}{mark}"
        )
    shares = sorted(dataset["shares"].items(), key=lambda item: -item[1])
    projected = (
        ""
        if dataset["scenes"] == PROJECTED
        else f"; {PROJECTED} would take {dataset['projected_s']:.0f} s"
    )
    lines += [
        (
            "largest difference between the two / largest voltage:"
            f" {moving['largest_difference_relative']:.1e}"
        ),
        "",
        (
            f"a dataset of {dataset['scenes']} static scenes (random touches, own contacts and"
            f" noise each): {dataset['scenes_per_s']:.0f} scenes/s a process{projected}"
        ),
        "what bounds it: " + ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares),
    ]
    return "\n".join(lines)
