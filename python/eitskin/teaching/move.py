"""Find how a skin moved when it was remounted, and move its outline, electrodes, grid, and force
law accordingly."""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.grid import Grid
from eitskin.model.force_law import ForceLaw, monomials
from eitskin.skin.outline import polygon
from eitskin.skin.skin import Skin
from eitskin.teaching.kernel import Placement, rotation


@dataclass(frozen=True)
class Move:
    """The map from new places to old ones: mirror in y, turn counterclockwise by ``turn_deg`` about
    the middle of the skin, then shift."""

    turn_deg: float = 0.0
    shift_mm: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False

    @property
    def _placement(self) -> Placement:
        return Placement(self.turn_deg, mirrored=self.mirrored)

    def to_old(self, place_mm: FloatArray, centre_mm: tuple[float, float]) -> FloatArray:
        """Return places (n, 2) in the coordinates of the old model."""
        return self._placement.to_skin(place_mm, centre_mm) + self.shift_mm

    def to_new(self, place_mm: FloatArray, centre_mm: tuple[float, float]) -> FloatArray:
        """Return old places (n, 2) in the new coordinates."""
        away = (place_mm - np.add(centre_mm, self.shift_mm)) @ rotation(self.turn_deg)
        return np.asarray(away * (1, -1 if self.mirrored else 1) + centre_mm)

    def skin(self, skin: Skin) -> Skin:
        """Return ``skin`` in the new coordinates."""
        turned, centre = self._placement.skin_in_places(skin), skin.outline.centre_mm
        dx, dy = (self.to_new(np.array([centre]), centre)[0] - centre).tolist()
        corners = [(x + dx, y + dy) for x, y in turned.outline.vertices_mm]
        return replace(turned, outline=polygon(corners))

    def grid(self, grid: Grid, centre_mm: tuple[float, float]) -> Grid:
        """Return ``grid`` shifted with the skin, but not turned."""
        middle = self.to_new(np.array([centre_mm]), centre_mm)[0] - centre_mm
        x, y = (grid.origin_mm + middle).tolist()
        return replace(grid, origin_mm=(x, y))

    def law(self, law: ForceLaw, grid: Grid, centre_mm: tuple[float, float]) -> ForceLaw:
        """Return ``law`` in the new coordinates, on ``grid``."""
        at = grid.centres_mm()
        u, v = at.T / law.radius_mm
        gains = law.gains_at(self.to_old(at, centre_mm))
        found = np.linalg.lstsq(monomials(u, v, law.order), gains, rcond=None)[0]
        return replace(law, gain=found.astype(np.float32))


UNMOVED = Move()
