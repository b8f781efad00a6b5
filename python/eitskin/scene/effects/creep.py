"""A skin that creeps under a constant pull, and recovers slowly when the pull ends.

It is a standard linear solid (a spring in parallel with a damper, in series with a spring; Findley,
Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, 1976). Under a constant
pull from ``at_s`` on,

    strain(t) = strain (1 + creep (1 - exp(-(t - at) / tau))),

and after ``until_s`` the elastic part vanishes at once while the crept part decays with tau. The
strain acts on skin and electrodes as in ``stretch``, with free sides. A tare just after the release
is wrong for a time of about tau.
"""

from dataclasses import dataclass
from math import exp

from eitskin.config import parameter
from eitskin.scene.deformation import Deformation, stretched
from eitskin.scene.effect import DeformationStep, EffectCost, EffectSession, Stage

NAME = "creep"
STAGE = Stage.MATERIAL
ORDER = 6
SUMMARY = "The skin creeps under a constant pull, and recovers slowly."


@dataclass(frozen=True)
class Parameters:
    """The immediate strain, the creep, its time constant, and the time and direction of the
    pull."""

    strain: float = parameter(0.05, "1", "immediate gain of length / length", low=-0.2, high=0.5)
    creep: float = parameter(0.3, "1", "final creep / immediate strain", low=0, high=2)
    time_constant_s: float = parameter(
        60.0, "s", "time in which 63 % of the creep happens", low=0, open_low=True
    )
    direction_deg: float = parameter(0.0, "deg", "direction of the pull, from the x axis")
    at_s: float = parameter(0.0, "s", "time at which the pull begins")
    until_s: float | None = parameter(None, "s", "time at which it ends; never if left out")


def strain_at(time_s: float, parameters: Parameters) -> float:
    """Return the strain at ``time_s``."""
    end = float("inf") if parameters.until_s is None else parameters.until_s
    tau, most = parameters.time_constant_s, parameters.strain * parameters.creep
    if time_s < parameters.at_s or end <= parameters.at_s:
        return 0.0
    crept = most * (1 - exp(-(min(time_s, end) - parameters.at_s) / tau))
    if time_s < end:
        return parameters.strain + crept
    return crept * exp(-(time_s - end) / tau)


def make(parameters: Parameters, session: EffectSession) -> DeformationStep:
    """Return the step with a solve for each frame, as the strain creeps."""

    def apply(time_s: float, frame: int) -> Deformation:
        along = 1 + strain_at(time_s, parameters)
        return stretched(along, along**-0.5, parameters.direction_deg)

    note = (
        f"{100 * parameters.strain:g} % at once and {100 * parameters.creep:g} % of that more with"
        f" {parameters.time_constant_s:g} s, from {parameters.at_s:g} s on"
    )
    return DeformationStep(NAME, EffectCost(factorisations_per_frame=1), note, apply)
