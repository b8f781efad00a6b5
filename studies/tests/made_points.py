"""Made-up points of a trade-off, and conditions for them."""

from typing import Any

from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import Conditions, OperatingPoint, Preset, checked_preset, read_limit

HERE = Conditions()


def point(name: str, accuracy: float, instructions: float, **more: Any) -> OperatingPoint:
    """A made-up point; its costliest frame takes twice the mean."""
    costs = {
        "flash_bytes": 1000, "ram_bytes": 1000, "pixels_kept": 812, "acquisition_us": 20_800,
    }  # fmt: skip
    costs |= {key: more.pop(key) for key in costs.keys() & more.keys()}
    macs = instructions / 2
    spread = {"worst_tenth": accuracy - 0.1, "low": accuracy - 0.01, "high": accuracy + 0.01}
    score = {
        "scenes": 9,
        "image": {"mean": accuracy, **spread},
        "drawn": {"mean": 0.93},
        "discs": {"mean": 0.9, "worst_tenth": 0.8, "low": 0.88, "high": 0.91},
        "exact_count": 1.0,
        "position_mm": {"median": 0.5, "p95": 1.0},
        "force_error": {"median": 0.1, "p95": 0.2},
        "solve_macs": [macs - 10, macs],
        "touch_macs": [10, 20],
        "most_macs": 2 * macs,
    }
    counted = {"kind": "counted", "mean": instructions, "most": 2 * instructions, "macs_mean": macs}
    host_us = {"p50": instructions / 1e4, "p99": instructions, "most": instructions / 5e3}
    scores = {"random": {"60": score}}
    return OperatingPoint(Configuration(name, **more), 0.3, 1.0, costs, counted, host_us, scores)


POINTS = (
    point("a", 0.70, 216e3),
    point("b", 0.80, 432e3),
    point("worse", 0.79, 500e3),
    point("c", 0.85, 2160e3),
    point("barely", 0.8505, 4000e3),
    point("big", 0.90, 5000e3, flash_bytes=600_000),
    point("warm", 0.86, 300e3, warm_start=True),
)
COLD = POINTS[:-1]


def target(
    budget: str | None = None, accuracy: float | None = None, board: str = "f767", **more: Any
) -> Preset:
    most = None if budget is None else read_limit(budget)
    return checked_preset(Preset(most, accuracy, board, HERE, **more))
