"""The shapes that skins have: a rounded rectangle, a forearm's developed sheet, a hand; and the
examples' drawings of them.

``eitskin draw examples -o examples`` writes hand.svg and forearm.dxf there.
"""

import importlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import missing_extra
from eitskin.fileio import write_beside, write_bytes
from eitskin.skin.placement import nearest_on_rim
from eitskin_studies.experiments.shapes.rounded import Corner, as_outline, as_polyline, as_svg_path

PAGE_MM = (170.0, 210.0)
MILLIMETRES = 4  # $INSUNITS of a DXF file
# base and tip's centre, and half the width, of each finger as it stretches from the palm; from the
# thumb to the little finger
FINGERS = {
    "thumb": ((47.0, 42.0), (15.0, 88.0), 11.0),
    "index": ((60.0, 100.0), (45.0, 160.0), 10.5),
    "middle": ((84.0, 104.0), (82.0, 177.0), 11.0),
    "ring": ((108.0, 100.0), (118.0, 165.0), 10.5),
    "little": ((129.0, 88.0), (149.0, 137.0), 10.0),
}


def rectangle_corners() -> list[Corner]:
    """200 x 140 mm, corners of 20 mm."""
    return [Corner(x, y, 20.0) for x, y in ((-100, -70), (100, -70), (100, 70), (-100, 70))]


def forearm_corners() -> list[Corner]:
    """A forearm's sheet laid flat: 220 mm long, 170 mm around the wrist, 250 mm below the elbow."""
    return [Corner(x, y, 20.0) for x, y in ((-110, -85), (110, -125), (110, 125), (-110, 85))]


def hand_corners() -> list[Corner]:
    """A right hand seen on its back, 178 mm from the wrist to the middle finger's tip; fingers are
    rounded at the tip by nearly half their width, webs by 3.5 mm."""
    tips = {name: _tip_corners(name) for name in FINGERS}
    webs = [Corner(122, 90, 3.5), Corner(97, 92, 3.5), Corner(73, 91, 3.5), Corner(50, 70, 8.0)]
    corners = [Corner(54, 10, 8.0), Corner(114, 10, 8.0), Corner(130, 50, 30.0)]
    corners += [
        *tips["little"],
        webs[0],
        *tips["ring"],
        webs[1],
        *tips["middle"],
        webs[2],
        *tips["index"],
        webs[3],
    ]
    return [*corners, *tips["thumb"], Corner(43, 36, 15.0)]


def _tip_corners(name: str) -> list[Corner]:
    base, tip, half = FINGERS[name]
    along = np.subtract(tip, base) / math.dist(tip, base)
    across, end = np.array([along[1], -along[0]]), np.asarray(tip) + half * along
    places = [end + side * half * across for side in (1, -1)]
    return [Corner(float(x), float(y), 0.85 * half) for x, y in places]


def hand_places_mm() -> FloatArray:
    """Return 16 places of electrodes on the hand's rim (16, 2), as a person might choose them:
    three at the wrist, two on the palm's outer edge, fingertips, webs between fingers, two on the
    thumb's side; counterclockwise from the wrist's middle.
    """
    tips = {
        name: np.asarray(tip) + half * np.subtract(tip, base) / math.dist(tip, base)
        for name, (base, tip, half) in FINGERS.items()
    }
    wanted = [
        (84, 10), (108, 10), (122, 32), (133, 75), tips["little"], (126, 108), tips["ring"],
        (98, 121), tips["middle"],
        (70, 120), tips["index"], (44, 82), tips["thumb"], (24, 60), (46, 33), (60, 10),
    ]  # fmt: skip
    outline = as_outline(hand_corners())
    arc_mm, _ = nearest_on_rim(
        outline, np.array([np.asarray(place, dtype=np.float64) for place in wanted])
    )
    return outline.points_at(arc_mm)


def hand_pairs_mm() -> FloatArray:
    """16 electrodes of which each finger has two, one on either side of its tip; the others at the
    wrist, the palm's edges and beside the thumb; counterclockwise from the wrist's middle, (16, 2)
    near the rim."""
    sides = {}
    for name, (base, tip, half) in FINGERS.items():
        along = np.subtract(tip, base) / math.dist(tip, base)
        sides[name] = [
            np.asarray(tip) + side * half * np.array([along[1], -along[0]]) for side in (1, -1)
        ]
    fingers = [place for name in ("little", "ring", "middle", "index") for place in sides[name]]
    places = [
        (96, 10),
        (120, 28),
        (133, 70),
        *fingers,
        (41, 88),
        *sides["thumb"],
        (46, 33),
        (68, 10),
    ]
    return np.array([np.asarray(place, dtype=np.float64) for place in places])


def hand_region(points_mm: npt.ArrayLike) -> list[str]:
    """The finger that each of ``points_mm`` (k, 2) lies on, or "palm"."""
    regions = []
    for point in np.asarray(points_mm, dtype=np.float64).reshape(-1, 2):
        name = "palm"
        for finger, (base, tip, half) in FINGERS.items():
            along = np.subtract(tip, base)
            share = float((point - base) @ along / (along @ along))
            beside = math.dist(point, np.asarray(base) + min(max(share, 0.0), 1.0) * along)
            if share > 0 and beside <= half + 3.0:
                name = finger
        regions.append(name)
    return regions


def hand_svg() -> str:
    """The hand with its marked electrodes, as an SVG file in mm."""
    width, height = PAGE_MM
    marks = "\n".join(
        f'    <circle class="electrode" id="electrode-{k}" cx="{x:.3f}" cy="{height - y:.3f}"'
        ' r="2"/>'
        for k, (x, y) in enumerate(hand_places_mm())
    )
    page = f'width="{width:g}mm" height="{height:g}mm" viewBox="0 0 {width:g} {height:g}"'
    corners = as_svg_path(hand_corners(), height)
    return f"""<svg xmlns="http://www.w3.org/2000/svg" {page}>
  <path id="skin" fill="none" stroke="black" stroke-width="0.5" d="{corners}"/>
  <g id="electrodes" fill="goldenrod">
{marks}
  </g>
</svg>
"""


def write_forearm_dxf(path: Path) -> None:
    """The forearm as a DXF file in mm: its rim on the layer "skin", a centre line on "notes".

    Raises:
        MissingExtraError: ezdxf is not installed.
        FileError: it cannot be written.
    """
    try:
        ezdxf: Any = importlib.import_module("ezdxf")
    except ModuleNotFoundError:
        raise missing_extra("drawing", "ezdxf") from None
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = (
        True  # no dates: two runs write the same bytes
    )
    try:
        document = ezdxf.new("R2000", units=MILLIMETRES)
        space = document.modelspace()
        space.add_lwpolyline(
            as_polyline(forearm_corners()), "xyb", close=True, dxfattribs={"layer": "skin"}
        )
        space.add_line((-110, 0), (110, 0), dxfattribs={"layer": "notes"})
        with write_beside(path) as temporary:
            document.saveas(temporary)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def write_drawings(folder: Path) -> None:
    """Write hand.svg and forearm.dxf into ``folder``."""
    write_bytes(folder / "hand.svg", hand_svg().encode("utf-8"))
    write_forearm_dxf(folder / "forearm.dxf")
