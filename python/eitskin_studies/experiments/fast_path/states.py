"""What touches do to every row, solved at a few states each, and rows in time interpolated from
them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.model.model import Model
from eitskin.scene.cover import Cover
from eitskin.scene.forward_steps import Change, Update, Work
from eitskin.scene.random_touches import TrueTouch

FloatArray = npt.NDArray[np.float64]

ELEMENTS = 7000
RADIUS_MM, CONTRAST, LEVELS = 8.0, 5.0, 6
REACH = 0.83  # of the skin's radius: where touches are
STEP_MM = 2.0
CONTACT_SPREAD = 0.3  # standard deviation of the logarithm
SKINS = 4  # contacts are drawn again for each part of the touches


def polarisation(contrast: npt.ArrayLike) -> FloatArray:
    """(c - 1) / (c + 1), in which a row's change is all but straight."""
    c = np.asarray(contrast, dtype=np.float64)
    return np.asarray((c - 1) / (c + 1))


class TouchedSkin:
    """One skin whose contacts were drawn; states are low-rank updates of one factorisation."""

    def __init__(self, model: Model, elements: int, rng: np.random.Generator) -> None:
        skin = model.skin
        mesh = mesh_for_elements(skin, elements)
        contacts = skin.electrodes.contact_impedance_ohm_m2 * np.exp(
            CONTACT_SPREAD * rng.standard_normal(skin.electrodes.count)
        )
        self._model, self._contacts = ForwardModel(mesh, skin, model.protocol, contacts), contacts
        size = self._model.system_for(contacts == 0).size
        self._solver = Update(self._model, None, np.arange(size), Work())
        self._sheet = np.full(mesh.n_elements, skin.conductivity_s_per_m)
        self._cover = Cover(mesh)
        self.v0 = self._volts([])

    def _volts(self, touches: Sequence[TrueTouch]) -> FloatArray:
        change = Change(*self._cover.factor(touches))
        electrodes = self._solver.electrodes(self._sheet, change, self._contacts)
        return np.asarray(
            self._model.patterns.voltages(electrodes) * self._model.protocol.current_a
        )

    def change(self, places: FloatArray, contrast: float) -> FloatArray:
        """What touches at ``places`` (k, 2) add to v0, (m,) V."""
        touches = [TrueTouch(float(x), float(y), RADIUS_MM, contrast) for x, y in places]
        return self._volts(touches) - self.v0

    def levels(self, places: FloatArray) -> FloatArray:
        """The same at LEVELS steps of the polarisation, (LEVELS + 1, m)."""
        u = polarisation(CONTRAST) * np.arange(1, LEVELS + 1) / LEVELS
        changes = [self.change(places, float((1 + each) / (1 - each))) for each in u]
        return np.vstack([np.zeros(len(self.v0)), *changes])


@dataclass(frozen=True, eq=False)
class States:
    """Solved states of n presses, swipes or pairs: ``v0`` (n, m); of presses ``places`` (n, 1, 2)
    and ``change`` (n, 1, LEVELS + 1, m); of pairs (n, 2, 2) and (n, 3, LEVELS + 1, m), the last
    both together; of swipes lists of (k, 2) and (k, m)."""

    v0: FloatArray
    places: Sequence[FloatArray]
    change: Sequence[FloatArray]


def _place(model: Model, rng: np.random.Generator) -> FloatArray:
    x0, _, x1, _ = model.skin.outline.bounding_box_mm
    radius, angle = REACH * (x1 - x0) / 2 * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def _apart(
    model: Model, rng: np.random.Generator, least_mm: float
) -> tuple[FloatArray, FloatArray]:
    while True:
        one, other = _place(model, rng), _place(model, rng)
        if np.hypot(*(one - other)) > least_mm:
            return one, other


def solve_states(model: Model, kind: str, count: int, seed: int, elements: int) -> States:
    """``count`` "presses", "swipes" (at least 70 mm long) or "pairs" (at least 35 mm apart)."""
    rng = np.random.default_rng([seed, ("presses", "swipes", "pairs").index(kind)])
    v0, places, changes = [], [], []
    for part in np.array_split(np.arange(count), min(SKINS, count)):
        skin = TouchedSkin(model, elements, rng)
        for _ in part:
            v0.append(skin.v0)
            if kind == "presses":
                place = _place(model, rng)[None]
                change = skin.levels(place)[None]
            elif kind == "pairs":
                place = np.array(_apart(model, rng, 35.0))
                change = np.array(
                    [skin.levels(place[:1]), skin.levels(place[1:]), skin.levels(place)]
                )
            else:
                begin, end = _apart(model, rng, 70.0)
                along = (end - begin) / np.hypot(*(end - begin))
                place = begin + STEP_MM * np.outer(
                    np.arange(int(np.hypot(*(end - begin)) / STEP_MM)), along
                )
                change = np.array([skin.change(each[None], CONTRAST) for each in place])
            places.append(place)
            changes.append(change)
    return States(np.array(v0), places, changes)


def at_press(levels: FloatArray, press: FloatArray, rows: npt.NDArray[np.int64]) -> FloatArray:
    """Of ``levels`` (LEVELS + 1, m) the ``rows`` (t,) at ``press`` (t,), 0 to 1 of the way to
    CONTRAST, (t,)."""
    u = polarisation(1 + (CONTRAST - 1) * press) / polarisation(CONTRAST) * LEVELS
    low = np.minimum(u.astype(np.int64), LEVELS - 1)
    return np.asarray(levels[low, rows] + (u - low) * (levels[low + 1, rows] - levels[low, rows]))
