"""Presses of a small simulated skin, made by its fields on a mesh: magnitudes only behind a common
mode, with a gain of its own for each row, so that the model from physics has no chance."""

from functools import cache

import numpy as np

from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import opposite
from eitskin.skin.skin import Skin
from eitskin.teaching.kernel import Placement, Sensitivity, field_sensitivity
from eitskin.teaching.presses import Presses

RADIUS_MM = 50.0
SKIN = Skin("small", disk(2 * RADIUS_MM), Electrodes(count=8, width_mm=4.0))
TRUE = Placement(turn_deg=37.0, scale=0.97)


@cache
def fields() -> Sensitivity:
    return field_sensitivity(SKIN, opposite(8))


def presses(
    count: int,
    seed: int = 1,
    placement: Placement = TRUE,
    shift_mm: tuple[float, float] = (0.0, 0.0),
    dried: float = 0.0,
) -> Presses:
    """So many, anywhere, of three depths; on the skin moved by ``-shift_mm``; ``dried``: all rows
    answer less by that part, and each differently by half of it; at rest by a quarter."""
    draw, protocol = np.random.default_rng(seed), opposite(8)
    row = np.random.default_rng(7)
    gain = row.choice([-1, 1], protocol.n_rows) * np.exp(row.normal(0, 0.5, protocol.n_rows))
    radius = 0.85 * RADIUS_MM * np.sqrt(draw.uniform(0, 1, count))
    angle = draw.uniform(0, 2 * np.pi, count)
    place = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    depth = draw.choice([10.0, 15.0, 20.0], count)
    j = fields()(placement.to_skin(place + shift_mm, (0.0, 0.0)))
    change = 0.01 * depth[:, None] / 15 * gain * j
    rest, drier = 1 + row.uniform(0, 1, protocol.n_rows), dried * row.normal(size=gain.shape)
    change *= np.exp(0.5 * drier - dried)
    untouched = rest * np.exp(0.25 * drier) + 2e-4 * draw.normal(size=change.shape)
    pressed = untouched + change + 4e-4 * draw.normal(size=change.shape)
    return Presses(protocol, untouched, np.abs(pressed), place, depth_mm=depth)
