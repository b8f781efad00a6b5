"""Read DXF files with ezdxf: lines, polylines, arcs, circles, ellipses, splines and points of the
model space, in mm."""

import io
import logging
import math
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

from eitskin.errors import ConfigError, EitskinError, missing_extra
from eitskin.skin.drawing_shapes import (
    MAX_DEPTH,
    MAX_PIECES,
    MAX_SHAPES,
    DrawingReading,
    DrawnShape,
    limited,
)

try:
    import ezdxf.disassemble
    import ezdxf.path
    import ezdxf.recover
except ModuleNotFoundError as error:
    raise missing_extra("drawing", "ezdxf") from error

# values of $INSUNITS in the header: inches, feet, millimetres, centimetres, metres, mils,
# micrometres,
# decimetres
UNITS_MM = {1: 25.4, 2: 304.8, 4: 1.0, 5: 10.0, 6: 1000.0, 9: 0.0254, 13: 1e-3, 14: 100.0}
DRAWN = {"LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"}


def read_dxf(content: bytes, where: str, reading: DrawingReading) -> tuple[list[DrawnShape], str]:
    """Return every line and point of the DXF file ``content``, and words for the entities that are
    neither; blocks are expanded."""
    talk = logging.getLogger("ezdxf")
    before = talk.level
    talk.setLevel(logging.CRITICAL)  # the user need not see what ezdxf repairs in a file
    try:
        document, _ = ezdxf.recover.read(io.BytesIO(content))
        scale = reading.scale_mm or _scale_of(document, where)
        _refuse_copies(document, where)
        entities = list(ezdxf.disassemble.recursive_decompose(document.modelspace()))
        tolerance = reading.tolerance_mm / scale
        shapes = limited(
            (one for entity in entities for one in _shapes(entity, scale, tolerance)), where
        )
        return shapes, _left_out(document, entities)
    except EitskinError:
        raise
    except Exception as error:  # ezdxf raises many kinds of errors for a damaged file
        raise ConfigError(
            f"{where}: cannot be read as DXF ({type(error).__name__}: {error}); export it again"
        ) from None
    finally:
        talk.setLevel(before)


def _left_out(document: Any, entities: list[Any]) -> str:
    """Return words for entities that are no lines, and for those in paper space."""
    other = Counter(one.dxftype() for one in entities if one.dxftype() not in (*DRAWN, "POINT"))
    paper = Counter(
        one.dxftype()
        for layout in document.layouts
        if not layout.is_modelspace
        for one in layout
        if one.dxftype() != "VIEWPORT"
    )
    said = ""
    if other:
        said += f"; left out: {_counted(other)}, of which only outlines as lines count"
    if paper:
        said += f"; left out: {_counted(paper)} in paper space, move them to model space"
    return said


def _counted(kinds: Counter[str]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in kinds.most_common(5))


def _scale_of(document: Any, where: str) -> float:
    unit = document.header.get("$INSUNITS", 0)
    if unit not in UNITS_MM:
        raise ConfigError(
            f"{where}: $INSUNITS = {unit} is not a unit of length; give scale_mm, the mm per unit"
            " of the drawing"
        )
    return UNITS_MM[unit]


def _refuse_copies(document: Any, where: str) -> None:
    """Reject blocks that insert each other in a circle, and drawings with more copies than any
    outline needs, before a copy is made."""
    counts: dict[str, int] = {}

    def count(layout: Any, depth: int) -> int:
        if depth > MAX_DEPTH:
            raise ConfigError(
                f"{where}: blocks within each other, over {MAX_DEPTH} deep; explode them"
            )
        total = 0
        for one in layout:
            total += 1
            if one.dxftype() == "INSERT" and one.dxf.name in document.blocks:
                name = one.dxf.name.lower()
                if name not in counts:
                    counts[name] = count(document.blocks.get(name), depth + 1)
                total += max(1, one.dxf.row_count * one.dxf.column_count) * max(1, counts[name])
        return total

    if count(document.modelspace(), 0) > MAX_SHAPES:
        raise ConfigError(f"{where}: over {MAX_SHAPES} entities; export the outline alone")


def _shapes(entity: Any, scale: float, tolerance: float) -> Iterator[DrawnShape]:
    names = frozenset({str(entity.dxf.get("layer", "0"))})
    if entity.dxftype() == "POINT":
        place = entity.dxf.location
        yield DrawnShape("", names, scale * np.array([[place.x, place.y]]), False)
    if entity.dxftype() not in DRAWN:
        return
    for path in ezdxf.path.make_path(entity).sub_paths():
        points = (
            np.array(
                [(v.x, v.y) for v in islice(path.flattening(tolerance, 4), 4 * MAX_PIECES)]
            ).reshape(-1, 2)
            * scale
        )
        if len(points) < 2:
            continue
        closed = len(points) > 3 and math.dist(points[0], points[-1]) <= 1e-6 * float(
            np.ptp(points, axis=0).max()
        )
        yield DrawnShape("", names, points[:-1] if closed else points, closed)
