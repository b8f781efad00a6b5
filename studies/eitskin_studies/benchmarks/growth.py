"""How a frame's time and multiply-accumulates grow: with pixels n, rows m, rank, touches,
electrodes.

One thing is varied at a time about the paper's skin with 16 electrodes, 812 pixels, rank 64 and two
touches. Frames are the linear answer of coarse meshes with white noise at 60 dB; all configurations
run in turns on one thread, whose own time is taken, so that other work on the machine counts
little.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import thread_time_ns
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.fileio import write_bytes
from eitskin.model.build import BuildSettings, linearise, make_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.model.model import Model
from eitskin.progress import Progress, silent
from eitskin.scene.random_touches import TouchRules, random_touches
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.harness.bare_core import bare_calls
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sections import Filling, text_table

SNR_DB, SCENES, SEED, ELEMENTS = 60.0, 8, 5, 3000


@dataclass(frozen=True)
class GrowthPoint:
    """A size that is run: electrodes of the adjacent protocol, pixels across, rank, touches;
    ``sweep`` is the series it stands in."""

    sweep: str
    electrodes: int = 16
    across: int = 32
    rank: int = 64
    touches: int = 2


SWEEPS = (
    *(GrowthPoint("pixels n", across=across) for across in (16, 24, 32, 48, 64)),
    *(GrowthPoint("rank", rank=rank) for rank in (16, 32, 64, 104)),
    *(GrowthPoint("touches", touches=count) for count in (1, 2, 3, 4, 6)),
    *(GrowthPoint("rows m, rank 64", electrodes=count) for count in (16, 32, 64)),
    *(
        GrowthPoint("electrodes, rank 4 each", electrodes=count, rank=4 * count)
        for count in (16, 32, 64)
    ),
)
VARIED = {
    "pixels n": "n_pixels",
    "rank": "rank",
    "touches": "touches",
    "rows m, rank 64": "n_rows",
    "electrodes, rank 4 each": "electrodes",
}


@dataclass(frozen=True)
class Growth:
    """One configuration: sizes, mean multiply-accumulates of a frame (exact), microseconds of the
    thread's time: medians over the rounds, and quartiles of both together."""

    sweep: str
    value: int
    n_rows: int
    n_pixels: int
    rank: int
    touches: int
    macs: float
    touch_macs: float
    model_bytes: int
    solve_us: float
    touch_us: float
    quartiles_us: tuple[float, float]

    @property
    def whole_us(self) -> float:
        """Solve and touches."""
        return self.solve_us + self.touch_us


@dataclass(frozen=True)
class GrowthTimes:
    """All configurations."""

    rounds: int
    machine: str
    points: tuple[Growth, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def sweep(self, name: str) -> list[Growth]:
        """One series."""
        return [point for point in self.points if point.sweep == name]


@dataclass(frozen=True, eq=False)
class _Ready:
    point: GrowthPoint
    model: Model
    blob: bytes
    engine: CoreEngine
    frames: FloatArray


def _model_for(point: GrowthPoint, cache: Path) -> bytes:
    """The model's bytes, made once a ``cache``: keyed by all that it is made from."""
    key = hashlib.sha256(
        repr((point.electrodes, point.across, point.rank, ELEMENTS)).encode()
    ).hexdigest()[:16]
    path = cache / f"growth-{key}.eitm"
    if not path.exists():
        skin = replace(paper_skin(), electrodes=Electrodes(point.electrodes, 4.0))
        protocol = adjacent(point.electrodes)
        linear = linearise(skin, protocol, pixels_across=point.across, elements=ELEMENTS)
        settings = BuildSettings(rank=point.rank, pixels_across=point.across, elements=ELEMENTS)
        jacobian_path = path.with_suffix(".npy")
        np.save(jacobian_path, np.asarray(linear.jacobian, dtype=np.float64))
        write_bytes(path, encode_model(make_model(skin, protocol, linear, settings)))
    return path.read_bytes()


def _ready(point: GrowthPoint, cache: Path) -> _Ready:
    blob = _model_for(point, cache)
    model = decode_model(blob, "growth model")
    key = hashlib.sha256(
        repr((point.electrodes, point.across, point.rank, ELEMENTS)).encode()
    ).hexdigest()[:16]
    jacobian = np.load(cache / f"growth-{key}.npy")
    rng = np.random.default_rng(SEED)
    reference = model.golden.reference_v.astype(np.float64)
    noise = float(np.sqrt(np.mean(reference**2))) * 10 ** (-SNR_DB / 20)
    rules = TouchRules(count=(point.touches, point.touches))
    scenes = random_touches(paper_skin().outline, SEED, SCENES, "test", rules).scenes
    sheet = paper_skin().conductivity_s_per_m
    cover = np.array(
        [pixel_cover(model.grid, scene.centres_mm(), scene.radii_mm()) for scene in scenes]
    )
    changed = reference + cover @ jacobian.T * (1.2 * sheet)
    untouched = reference + noise * rng.standard_normal((64, len(reference)))
    frames = changed + noise * rng.standard_normal(changed.shape)
    engine = CoreEngine(blob)
    engine.set_reference(untouched)
    engine.solve_frame(
        frames[0]
    )  # the first frame after a reference also builds the directions to ignore
    return _Ready(point, model, blob, engine, frames)


def run(
    rounds: int = 15,
    cache: Path | None = None,
    *,
    points: Sequence[GrowthPoint] = SWEEPS,
    progress: Progress = silent,
) -> GrowthTimes:
    """Time ``rounds`` rounds over all ``points``; models are kept in the folder ``cache`` (by
    default out/growth).

    Raises:
        MissingExtraError: the mesher is not installed.
    """
    folder = cache or Path("out") / "growth"
    folder.mkdir(parents=True, exist_ok=True)
    ready = [_ready(point, folder) for point in progress(points)]
    times = np.zeros((len(ready), 2, rounds))
    macs = np.zeros((len(ready), 2))
    for round_number in progress(range(rounds)):
        for k, one in enumerate(ready):
            total, counted = np.zeros(2), np.zeros(2)
            for frame in one.frames:
                one.engine.forget()
                for part, call in enumerate(bare_calls(one.engine, frame)):
                    start = thread_time_ns()
                    call()
                    total[part] += thread_time_ns() - start
                info = one.engine.last_info()
                counted += info.macs, info.touch_macs
            times[k, :, round_number] = total / len(one.frames) / 1e3
            macs[k] = counted / len(one.frames)
    return GrowthTimes(
        rounds,
        machine(),
        tuple(_growth(one, t, m) for one, t, m in zip(ready, times, macs, strict=True)),
    )


def _growth(one: _Ready, times: FloatArray, macs: FloatArray) -> Growth:
    solve, touch = np.median(times, axis=1)
    low, high = np.percentile(times.sum(axis=0), [25, 75])
    sizes = {
        "n_rows": one.model.protocol.n_rows, "n_pixels": one.model.grid.n_pixels,
        "rank": one.model.rank,
        "touches": one.point.touches, "electrodes": one.point.electrodes,
    }  # fmt: skip
    return Growth(
        one.point.sweep, sizes[VARIED[one.point.sweep]], sizes["n_rows"], sizes["n_pixels"],
        sizes["rank"], sizes["touches"],
        float(macs[0]), float(macs[1]), len(one.blob), float(solve), float(touch),
        (float(low), float(high)),
    )  # fmt: skip


HEAD = (
    "varied", "value", "m", "n", "rank", "touches", "kMAC solve", "kMAC touches", "solve us",
    "touches us", "quartiles us",
    "model kB",
)  # fmt: skip


def rows(result: GrowthTimes) -> list[tuple[str, ...]]:
    """Rows under ``HEAD``."""
    return [
        (
            g.sweep, f"{g.value}", f"{g.n_rows}", f"{g.n_pixels}", f"{g.rank}", f"{g.touches}",
            f"{g.macs / 1e3:.0f}",
            f"{g.touch_macs / 1e3:.0f}", f"{g.solve_us:.0f}", f"{g.touch_us:.0f}",
            f"{g.quartiles_us[0]:.0f} to {g.quartiles_us[1]:.0f}", f"{g.model_bytes / 1e3:.0f}",
        )
        for g in result.points
    ]  # fmt: skip


def exponent(points: Sequence[Growth], value: Callable[[Growth], float]) -> float:
    """Return the slope of log ``value`` over the log of the varied quantity; 1 means
    proportional."""
    x, y = np.log([p.value for p in points]), np.log([value(p) for p in points])
    return float(np.polyfit(x, y, 1)[0])


def summary(result: GrowthTimes) -> str:
    """The exponents, a clause a series."""
    parts = []
    for name in dict.fromkeys(p.sweep for p in result.points):
        points = result.sweep(name)
        if len(points) > 1:
            time, macs = _exponents(points)
            parts.append(f"{name}: MACs ^{macs:.2f}, time ^{time:.2f}")
    return "; ".join(parts)


def drawn(result: GrowthTimes) -> dict[str, Any]:
    """The numbers of the picture, series by series."""
    sweeps = []
    for name in dict.fromkeys(p.sweep for p in result.points):
        points = result.sweep(name)
        time, macs = _exponents(points) if len(points) > 1 else (0.0, 0.0)
        sweeps.append(
            {
                "name": name,
                "values": [p.value for p in points],
                "time": round(time, 2),
                "macs": round(macs, 2),
                "solve_us": [round(p.solve_us, 1) for p in points],
                "touches_us": [round(p.touch_us, 1) for p in points],
                "solve_kmac": [round(p.macs / 1e3, 1) for p in points],
                "touches_kmac": [round(p.touch_macs / 1e3, 1) for p in points],
            }
        )
    return {"sweeps": sweeps}


def _exponents(points: Sequence[Growth]) -> tuple[float, float]:
    """Return the exponents of the time and of the MACs, of solve and touches together."""
    time = exponent(points, lambda p: p.whole_us)
    return time, exponent(points, lambda p: p.macs + p.touch_macs)


def as_text(result: GrowthTimes) -> str:
    """For a terminal."""
    head = (
        f"default options, one thread, medians of {result.rounds} rounds over {SCENES} frames;"
        f" {result.machine}"
    )
    return "\n".join([head, text_table(HEAD, rows(result)), f"exponents: {summary(result)}"])


def for_page(result: GrowthTimes, command: str) -> Filling:
    """The marks ``growth-run`` and ``growth``."""
    run = (
        f"By `{command}`: one size is varied at a time, the others are 16 electrodes, 812 pixels,"
        f" rank 64 and two touches. Options are the defaults, and each frame is solved cold; times"
        f" are medians of {result.rounds} rounds in turns over {SCENES} frames (seed {SEED}, the"
        f" linear answer with noise at 60 dB); {result.machine}. Fitted exponents:"
        f" {summary(result)}."
    )
    return {"growth-run": run}, {"growth": (HEAD, rows(result))}
