"""Electrodes that have come off the skin: they carry no current, and nothing is read on them.

This is the limit of the complete electrode model for an infinite contact impedance: the rim under a
detached electrode is insulated. A current source on it drives nothing (its output only rises to the
supply), and an input on it floats; in both cases every row that uses the electrode is assumed to
read 0 V. A loose plug is off only part of the time.
"""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import Contacts, ContactStep, EffectCost, EffectSession, Stage

NAME = "detached"
STAGE = Stage.BOUNDARY
ORDER = 20
SUMMARY = "Electrodes come off the skin."


@dataclass(frozen=True)
class Parameters:
    """The electrodes, and the time during which they are off."""

    electrodes: tuple[int, ...] = parameter((0,), "", "electrodes that come off (from 0)", low=0)
    from_s: float | None = parameter(None, "s", "when they come off; at the start if left out")
    until_s: float | None = parameter(None, "s", "when they touch again; never if left out")

    def __post_init__(self) -> None:
        if not self.electrodes or len(set(self.electrodes)) != len(self.electrodes):
            raise ConfigError(
                f"electrodes = {list(self.electrodes)}: name at least one, and none twice"
            )
        if self.from_s is not None and self.until_s is not None and self.until_s <= self.from_s:
            raise ConfigError(
                f"until_s = {self.until_s:g} must come after from_s = {self.from_s:g}"
            )


def is_off(time_s: float, parameters: Parameters) -> bool:
    """Return whether the electrodes are off at ``time_s``: from ``from_s`` on, until just before
    ``until_s``."""
    came_off = parameters.from_s is None or time_s >= parameters.from_s
    return came_off and (parameters.until_s is None or time_s < parameters.until_s)


def make(parameters: Parameters, session: EffectSession) -> ContactStep:
    """Return the step that marks the electrodes while they are off."""
    session.refuse_absent(parameters.electrodes)
    gone = np.isin(np.arange(session.skin.electrodes.count), parameters.electrodes)
    lost = np.asarray(gone[session.protocol.drive_measure].any(axis=1))
    if lost.all():
        raise ConfigError(
            "electrodes: without them no row of the protocol can be measured; name fewer"
        )
    varies = parameters.from_s is not None or parameters.until_s is not None

    def apply(contacts: Contacts, time_s: float, frame: int) -> Contacts:
        if not is_off(time_s, parameters):
            return contacts
        return replace(contacts, detached=contacts.detached | gone)

    named = ", ".join(map(str, parameters.electrodes))
    note = f"electrode {named} (from 0) off: {np.count_nonzero(lost)} of {len(lost)} rows read 0 V"
    return ContactStep(NAME, EffectCost(factorisations=int(varies)), note, apply, varies=varies)
