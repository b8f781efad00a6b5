"""Contacts that are not ideal: a resistance times area between each electrode and the skin.

In the complete electrode model (Cheng, Isaacson, Newell and Gisser, IEEE Trans. Biomed. Eng. 36,
1989; Somersalo, Cheney and Isaacson, SIAM J. Appl. Math. 52, 1992) the potential drops by z times
the current density across the interface: phi + z sigma dphi/dn = U. For saline of 0.35 to 3.4 S/m
on metal, Cheng et al. fitted 58 down to 7.5 ohm cm2 (6e-3 to 8e-4 ohm m2). z = 0 is an ideal shunt.
Electrodes differ: z_l = mean (1 + uniform(-spread, spread)), drawn once.

Contacts may change after the tare, suddenly, as by a knock, or slowly, as by drying: each is
multiplied by exp(change p(t) n) with its own normal number n, where p rises from 0 to 1.
"""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import (
    Contacts,
    ContactStep,
    EffectCost,
    EffectSession,
    FloatArray,
    Stage,
    part_at,
)

NAME = "contact_impedance"
STAGE = Stage.BOUNDARY
ORDER = 10
SUMMARY = "Current meets a resistance where it enters and leaves the skin."


@dataclass(frozen=True)
class Parameters:
    """The mean impedance of the electrodes, and how they differ and change."""

    mean_ohm_m2: float = parameter(
        0.01, "ohm m2", "resistance of a contact times its area", low=0, high=1e3
    )
    spread: float = parameter(
        0.0, "1", "each electrode's differs by up to this part of the mean", low=0, high=1
    )

    change: float = parameter(
        0.0, "1", "standard deviation of the logarithm of their changes", low=0, high=3
    )
    change_at_s: float = parameter(0.0, "s", "time at which the change begins")
    change_rise_s: float = parameter(0.0, "s", "time until it is complete; 0: at once", low=0)

    def __post_init__(self) -> None:
        if self.spread == 1:
            raise ConfigError("spread = 1 would make ideal contacts by chance; it must be below 1")


def impedances(parameters: Parameters, count: int, session: EffectSession) -> FloatArray:
    """Return the impedances (count,) in ohm m2. No random number is drawn if the spread is 0."""
    if parameters.spread == 0:
        return np.full(count, parameters.mean_ohm_m2)
    part = session.stream(NAME).uniform(-parameters.spread, parameters.spread, count)
    return np.asarray(parameters.mean_ohm_m2 * (1 + part))


def make(parameters: Parameters, session: EffectSession) -> ContactStep:
    """Return the step that sets every electrode's contact impedance, drawn once."""
    count = session.skin.electrodes.count
    impedance = impedances(parameters, count, session)
    note = f"{parameters.mean_ohm_m2:g} ohm m2, differing by up to {100 * parameters.spread:g} %"
    numbers = count if parameters.spread else 0
    if not parameters.change:
        return ContactStep(
            NAME,
            EffectCost(random_numbers=numbers),
            note,
            lambda contacts, time_s, frame: replace(contacts, impedance_ohm_m2=impedance),
        )
    log_change = parameters.change * session.stream(f"{NAME} change").standard_normal(count)

    def part(time_s: float) -> float:
        return part_at(time_s, parameters.change_at_s, parameters.change_rise_s)

    def apply(contacts: Contacts, time_s: float, frame: int) -> Contacts:
        changed = impedance * np.exp(part(time_s) * log_change)
        return replace(contacts, impedance_ohm_m2=changed)

    note += f", changing by {100 * parameters.change:g} % from {parameters.change_at_s:g} s on"
    parts = {part(float(t)) for t in session.times_s()}
    cost = EffectCost(factorisations=len(parts) - 1, random_numbers=numbers + count)
    return ContactStep(NAME, cost, note, apply, varies=True)
