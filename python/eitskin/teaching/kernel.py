"""The physics as a kernel: from the fields of a skin's electrodes it follows how similarly the skin
responds to presses at two places.

A press at p changes row r by about J_r(p) = -E_drive(p) . E_measure(p). On a real instrument, size,
sign and gain of this change differ from row to row. But places that are similar in all rows respond
similarly. So the response s_c of row c over the skin is modelled as a Gaussian process with the
kernel

    k_c(p, q) = (1/m) sum_r J_r(p) J_r(q) + g J_c(p) J_c(q).

The first term does not determine a rotation by one electrode; the second term, the row's own, does.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, radians, sin

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.grid import between_pixels, grid_for
from eitskin.skin.outline import disk, polygon
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

# J_r at places (n, 2) mm: (n, m)
Sensitivity = Callable[[FloatArray], FloatArray]

FIELD_PIXELS, FIELD_ELEMENTS = 64, 6000


@dataclass(frozen=True)
class Placement:
    """The position of the places relative to the skin as described: first mirrored in y if
    ``mirrored``, then turned counterclockwise by ``turn_deg`` about the outline's centre, and
    scaled."""

    turn_deg: float = 0.0
    scale: float = 1.0
    mirrored: bool = False

    def to_skin(self, place_mm: FloatArray, centre_mm: tuple[float, float]) -> FloatArray:
        """Return places (n, 2) in the coordinates of the description."""
        away = (place_mm - centre_mm) * (1, -1 if self.mirrored else 1)
        return np.asarray(centre_mm + self.scale * away @ rotation(self.turn_deg).T)

    def skin_in_places(self, skin: Skin) -> Skin:
        """Return the skin in the coordinates of the places."""
        outline, electrodes = skin.outline, skin.electrodes
        if outline.diameter_mm is not None:
            moved = disk(outline.diameter_mm / self.scale)
        else:
            away = (np.array(outline.vertices_mm) - outline.centre_mm) @ rotation(self.turn_deg)
            away = away / self.scale * (1, -1 if self.mirrored else 1)
            moved = polygon([(x, y) for x, y in away + outline.centre_mm])
        start = electrodes.start_angle_deg - self.turn_deg
        along = electrodes.positions_mm
        return replace(
            skin,
            outline=moved,
            electrodes=replace(
                electrodes,
                start_angle_deg=(-start if self.mirrored else start) % 360,
                clockwise=electrodes.clockwise != self.mirrored,
                width_mm=electrodes.width_mm / self.scale,
                positions_mm=None if along is None else tuple(s / self.scale for s in along),
            ),
        )


def rotation(turn_deg: float) -> FloatArray:
    """Return the matrix (2, 2) of a counterclockwise rotation."""
    c, s = cos(radians(turn_deg)), sin(radians(turn_deg))
    return np.array([[c, -s], [s, c]])


def field_sensitivity(skin: Skin, protocol: Protocol) -> Sensitivity:
    """Return J of ``skin`` as described: products of its electrodes' fields, linear between pixels,
    with the value of the nearest pixel outside the outline, scaled to rms 1."""
    from eitskin.fem.cem import ForwardModel
    from eitskin.fem.fields import electrode_fields
    from eitskin.fem.mesh import mesh_for_elements

    grid = grid_for(skin.outline, FIELD_PIXELS)
    forward = ForwardModel(mesh_for_elements(skin, FIELD_ELEMENTS), skin, protocol)
    kept = electrode_fields(forward, skin.conductivity_s_per_m, grid)
    drive, measure = ([protocol.drive_measure[:, k].astype(int) for k in pair]
                      for pair in ((0, 1), (2, 3)))  # fmt: skip
    fields = between_pixels(grid, kept)

    def products(e: FloatArray) -> FloatArray:
        return -np.asarray(
            ((e[..., drive[0]] - e[..., drive[1]]) * (e[..., measure[0]] - e[..., measure[1]])).sum(
                axis=-2
            )
        )

    unit = float(np.sqrt(np.mean(products(kept) ** 2)))

    return lambda place_mm: products(fields(place_mm)) / unit


def matern(p: FloatArray, q: FloatArray, length_mm: float) -> FloatArray:
    """Return the stationary kernel of smoothness 5/2, (n, k), for use without a description."""
    r = np.sqrt(5) / length_mm * np.linalg.norm(p[:, None] - q[None], axis=-1)
    return np.asarray((1 + r + r**2 / 3) * np.exp(-r))


@dataclass(frozen=True, eq=False)
class Kernel:
    """The kernel of places. With ``sensitivity`` None it is Matern 5/2 with ``length_mm`` times the
    scale.

    The likelihood chooses ``placement``, ``own`` (g) and ``noise`` (lambda). ``condition`` scales
    the kernel to a mean of 1 over the places, and each row's own term likewise.
    """

    sensitivity: Sensitivity | None
    centre_mm: tuple[float, float]
    length_mm: float = 1.0
    placement: Placement = Placement()
    own: float = 1.0
    noise: float = 0.03

    def features(self, place_mm: FloatArray) -> FloatArray:
        """Return J at places (n, 2), (n, m); for the stationary kernel (n, 0)."""
        if self.sensitivity is None:
            return np.zeros((len(place_mm), 0))
        return self.sensitivity(self.placement.to_skin(place_mm, self.centre_mm))

    def common(self, p: FloatArray, q: FloatArray, jp: FloatArray, jq: FloatArray) -> FloatArray:
        """Return the part that all rows share, (n, k), before scaling."""
        if self.sensitivity is None:
            return matern(p, q, self.length_mm * self.placement.scale)
        return np.asarray(jp @ jq.T / jp.shape[1])


def least_turn_deg(turn_deg: float, digits: int = 1) -> float:
    """Return the same direction within -180 to 180 degrees, rounded; never -0."""
    return round((turn_deg + 180) % 360 - 180, digits) + 0.0


def placement_text(placement: Placement) -> str:
    """Return the placement in words."""
    turn = least_turn_deg(placement.turn_deg)
    return (
        (f"turned by {turn:.1f} degrees" if turn else "not turned")
        + f", scaled by {placement.scale:.3f}"
        + (", mirrored" if placement.mirrored else "")
    )
