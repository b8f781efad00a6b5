"""The same presses by a model from physics, untaught: its instrument is far from the model."""

from dataclasses import replace
from typing import Any

import numpy as np

from eitskin.model.build import BuildSettings, build_model
from eitskin.skin.skin import Skin
from eitskin.teaching.left_out import CHI2_90
from eitskin.teaching.presses import Presses
from eitskin.teaching.teach import solve_presses

START_ANGLE_DEG = -74.0  # how this skin lies in the robot's frame: fitted on another session


def untaught(presses: Presses, skin: Skin, samples: int | None = None) -> dict[str, Any]:
    """Each half of ``presses``, by default options but for the sign: a press lowers the
    conductivity. Signs of voltages, which the instrument does not tell, are the model's.
    ``samples`` as in ``BuildSettings``."""
    turned = replace(skin, electrodes=replace(skin.electrodes, start_angle_deg=START_ANGLE_DEG))
    model = build_model(turned, presses.protocol, BuildSettings(samples=samples))
    sign = np.sign(model.golden.reference_v)
    signed = replace(presses, untouched=sign * presses.untouched, pressed=sign * presses.pressed)
    error, number, _, squared = solve_presses(model, signed, sign="decrease")
    halves = np.array_split(np.arange(len(presses)), 2)
    return {
        "medians": [float(np.median(error[half])) for half in halves],
        "p95": float(np.quantile(error, 0.95)),
        "touches": float(number.mean()),
        "covered": float(np.mean(squared < CHI2_90)),
    }
