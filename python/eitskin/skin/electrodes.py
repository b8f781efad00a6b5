"""The electrodes at a skin's rim: their number, width, places and contact impedance."""

from dataclasses import dataclass
from math import isfinite

from eitskin.errors import GeometryError

MIN_COUNT = 4
MAX_COUNT = 255


@dataclass(frozen=True)
class Electrodes:
    """Electrodes of equal width, numbered from 0 along the rim.

    The start point is where a ray from the outline's centre at ``start_angle_deg`` meets the rim.
    Electrode centres lie at ``positions_mm`` along the rim from there, in the numbering direction;
    None spaces them evenly with electrode 0 at the start point. ``contact_impedance_ohm_m2`` is the
    impedance of a unit of contact area; 0 makes an ideal shunt.
    """

    count: int = 16
    width_mm: float = 4.0
    start_angle_deg: float = 90.0
    clockwise: bool = False
    positions_mm: tuple[float, ...] | None = None
    contact_impedance_ohm_m2: float = 0.01

    def __post_init__(self) -> None:
        if not MIN_COUNT <= self.count <= MAX_COUNT:
            raise GeometryError(
                f"electrodes: count = {self.count} is out of range; use {MIN_COUNT} to {MAX_COUNT}"
            )
        if not (isfinite(self.width_mm) and self.width_mm > 0):
            raise GeometryError(f"electrodes: width_mm = {self.width_mm:g} must be above 0")
        if not isfinite(self.start_angle_deg):
            raise GeometryError("electrodes: start_angle_deg must be a finite number")
        if not (isfinite(self.contact_impedance_ohm_m2) and self.contact_impedance_ohm_m2 >= 0):
            raise GeometryError(
                f"electrodes: contact_impedance_ohm_m2 = {self.contact_impedance_ohm_m2:g} must be"
                " at least 0"
            )
        if self.positions_mm is not None:
            _check_positions(self.positions_mm, self.count)


def _check_positions(positions_mm: tuple[float, ...], count: int) -> None:
    if len(positions_mm) != count:
        raise GeometryError(
            f"electrodes: positions_mm has {len(positions_mm)} entries for {count} electrodes; give"
            " one each"
        )
    if not all(isfinite(p) for p in positions_mm):
        raise GeometryError("electrodes: positions_mm must be finite numbers")
    for k in range(1, count):
        if positions_mm[k] <= positions_mm[k - 1]:
            raise GeometryError(
                f"electrodes: positions_mm must ascend, but electrode {k} (from 0) is not beyond"
                f" electrode {k - 1}"
            )
