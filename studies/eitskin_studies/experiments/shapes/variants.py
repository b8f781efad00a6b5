"""The skins of the experiment: shapes with electrodes evenly along the rim or where somebody would
put them."""

from dataclasses import dataclass
from pathlib import Path

import numpy.typing as npt

from eitskin.fileio import write_bytes
from eitskin.scene.random_touches import TouchRules, rim_distance_mm
from eitskin.skin.drawing import read_drawing
from eitskin.skin.drawing_shapes import DrawingReading
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import Outline
from eitskin.skin.placement import Placed, by_marks, by_points
from eitskin.skin.skin import Skin, paper_skin, size_to_paper
from eitskin_studies.experiments.shapes.example_drawings import (
    hand_pairs_mm,
    hand_region,
    hand_svg,
    rectangle_corners,
    write_forearm_dxf,
)
from eitskin_studies.experiments.shapes.rounded import as_outline

WRIST_DEG = -90.0  # where electrode 0 of a hand is: the middle of the wrist
BANDS = ("rim third", "middle third", "innermost third")


@dataclass(frozen=True, eq=False)
class ShapeVariant:
    """A skin under its ``name`` here; ``hand``: its touches lie on fingers or the palm, else at
    some depth within the rim."""

    name: str
    skin: Skin
    hand: bool = False

    @property
    def scale(self) -> float:
        """Its size over the paper's skin's: touches, raster and gate are scaled by it."""
        return size_to_paper(self.skin.outline)

    @property
    def rules(self) -> TouchRules:
        """The usual random touches, scaled."""
        usual, s = TouchRules(), self.scale
        radius = (usual.radius_mm[0] * s, usual.radius_mm[1] * s)
        return TouchRules(
            usual.count, radius, usual.contrast, usual.gap_mm * s, usual.rim_margin_mm * s
        )

    def regions(self, points_mm: npt.ArrayLike, deepest_mm: float) -> list[str]:
        """Name the region of each of ``points_mm`` (k, 2): a hand's palm, thumb or fingers; else
        which third of the way from the rim to the place that is ``deepest_mm`` within it."""
        if self.hand:
            return [
                name if name in ("palm", "thumb") else "fingers" for name in hand_region(points_mm)
            ]
        depth = rim_distance_mm(self.skin.outline, points_mm) / deepest_mm
        return [BANDS[int(min(max(3 * value, 0), 2))] for value in depth]


def variants(folder: Path) -> list[ShapeVariant]:
    """All of them; the drawings that two are read from are written to ``folder``.

    Raises:
        FileError: it cannot be written.
        MissingExtraError: a drawing's library is not installed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / "hand.svg", hand_svg().encode("utf-8"))
    write_forearm_dxf(folder / "forearm.dxf")
    drawn = read_drawing(folder / "hand.svg", DrawingReading())
    hand = drawn.outline("skin", "electrode")
    forearm = read_drawing(folder / "forearm.dxf", DrawingReading()).outline("skin")
    placed = by_marks(hand, drawn.marked("electrode"), WRIST_DEG, None)
    pairs = by_points(hand, hand_pairs_mm(), WRIST_DEG, None)
    return [
        ShapeVariant("disk, 16", paper_skin()),
        ShapeVariant(
            "rectangle, 16", _evenly("rectangle", as_outline(rectangle_corners()), 16, -90.0)
        ),
        ShapeVariant("forearm, 16", _evenly("forearm", forearm, 16, 180.0)),
        ShapeVariant("hand, 16 evenly", _evenly("hand", hand, 16, WRIST_DEG), True),
        ShapeVariant("hand, 16 placed", _at("hand, placed", hand, placed), True),
        ShapeVariant("hand, 16 in pairs", _at("hand in pairs", hand, pairs), True),
        ShapeVariant("hand, 32 evenly", _evenly("hand of 32", hand, 32, WRIST_DEG), True),
    ]


def _evenly(name: str, outline: Outline, count: int, start_deg: float) -> Skin:
    return Skin(name, outline, Electrodes(count, start_angle_deg=start_deg))


def _at(name: str, outline: Outline, placed: Placed) -> Skin:
    """``placed`` from the wrist's middle on."""
    count, places = len(placed.positions_mm), placed.positions_mm
    return Skin(
        name,
        outline,
        Electrodes(
            count, start_angle_deg=WRIST_DEG, clockwise=placed.clockwise, positions_mm=places
        ),
    )
