"""How often touches are reported as ellipses, and how far off their axes are."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from eitskin.core.diagnostics_table import Touch
from eitskin.errors import FrameError
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_shape import named_shape
from eitskin.scoring.matching import match
from eitskin.scoring.metrics import iou
from eitskin_studies.experiments.experiment import Table
from eitskin_studies.worlds.score import CoreFinder
from eitskin_studies.worlds.simulate import WorldScenes

ELLIPSES = ("ellipses", "fingers")
DISCS = ("discs_1_to_3", "hertz_discs", "eight_at_4_radii")
STEP_MM = 0.25
DIGITS = 4
HEAD = (
    "set",
    "said to be ellipses",
    "angle off, median / 90 %",
    "aspect off, median / 90 %",
    "mean IoU of those said: as disc, as ellipse",
)


def ellipses_of(finder: CoreFinder, of: WorldScenes) -> dict[str, Any]:
    """How many touches were ``matched`` with true ones; of each of them that is ``said`` to be an
    ellipse: its angle off in degrees, its aspect over the true one less 1, and its IoU with the
    true touch as a disc and as an ellipse."""
    matched, said = 0, []
    for scene, *measured in zip(of.scenes, of.untouched_v, of.frames_v, of.step_v, strict=True):
        try:
            found = finder(*measured)
        except FrameError:
            continue
        for i, j in match(scene.centres_mm(), [(t.x_mm, t.y_mm) for t in found]).pairs:
            matched += 1
            if found[j].long_x_mm or found[j].long_y_mm:
                off = _off(found[j], scene.touches[i])
                said.append([round(value, DIGITS) for value in off])
    return {"matched": matched, "said": said}


def _off(found: Touch, true: TrueTouch) -> tuple[float, float, float, float]:
    x_mm, y_mm = found.long_x_mm or 0.0, found.long_y_mm or 0.0
    aspect = (math.hypot(x_mm, y_mm) / found.radius_mm) ** 2
    angle_deg = math.degrees(math.atan2(y_mm, x_mm))
    true_aspect, true_deg = (
        (1.0, angle_deg) if true.shape is None else (true.shape.aspect, true.shape.angle_deg)
    )
    place = (found.x_mm, found.y_mm, found.radius_mm)
    shape = named_shape("ellipse", aspect, angle_deg)
    return (
        abs((angle_deg - true_deg + 90) % 180 - 90),
        abs(aspect / true_aspect - 1),
        _iou(TrueTouch(*place, 1.0), true),
        _iou(TrueTouch(*place, 1.0, shape), true),
    )


def _iou(a: TrueTouch, b: TrueTouch) -> float:
    reach = 3 * max(a.radius_mm, b.radius_mm)
    steps = np.arange(-reach, reach, STEP_MM)
    x, y = np.meshgrid(b.x_mm + steps, b.y_mm + steps)
    first, second = (one.covers(x - one.x_mm, y - one.y_mm) for one in (a, b))
    return iou(first, second)


def ellipses_table(by_set: Mapping[str, Mapping[str, Any]]) -> Table:
    """A row a set of ellipses, and one for all sets of discs."""
    rows = []
    for name in ELLIPSES:
        one = by_set[name]
        share = _share(len(one["said"]), one["matched"])
        if not one["said"]:
            rows.append((f"`{name}`", share, "-", "-", "-"))
            continue
        angle, aspect, disc, ellipse = np.array(one["said"]).T
        angles = "{:.1f} / {:.1f} degrees".format(*np.quantile(angle, [0.5, 0.9]))
        aspects = "{:.0f} / {:.0f} %".format(*(100 * np.quantile(aspect, [0.5, 0.9])))
        rows.append(
            (f"`{name}`", share, angles, aspects, f"{disc.mean():.2f}, {ellipse.mean():.2f}")
        )
    discs = [by_set[name] for name in DISCS]
    said, matched = sum(len(one["said"]) for one in discs), sum(one["matched"] for one in discs)
    names = ", ".join(f"`{name}`" for name in DISCS)
    of_all = f"{said} of {matched}"
    return Table("ellipses", HEAD, (*rows, (names, of_all, "-", "-", "-")))


def _share(said: int, matched: int) -> str:
    return f"{100 * said / max(matched, 1):.0f} % of {matched}"
