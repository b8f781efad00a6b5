"""Read SVG files with svgelements: shapes with their transforms, in mm with y up. (0, 0) is the
lower left corner of the page."""

import io
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.errors import ConfigError, EitskinError, missing_extra
from eitskin.skin.drawing_shapes import (
    MAX_DEPTH,
    MAX_POINTS,
    MAX_SHAPES,
    DrawingReading,
    DrawnShape,
    TooManyPoints,
    arc_pieces,
    bezier_pieces,
    flattened,
    limited,
)

try:
    import svgelements
except ModuleNotFoundError as error:
    raise missing_extra("drawing", "svgelements") from error

MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "q": 0.25}
MM_A_PIXEL = 25.4 / 96
MAX_STYLE = 10_000  # characters of all style sheets and style attributes, per 20 elements
WORKED = ("d", "points", "transform")  # attributes that take longer to parse the longer they are
WORD = re.compile(r"[A-Za-z]|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
# After a closing command without a move the parser searches backwards for the start of the path,
# which is slow: it counts as LOOSE_WORDS words.
LOOSE, LOOSE_WORDS = re.compile(r"[zZ](?!\s*(?:[mM]|$))"), 400
MAX_WORDS = 40_000
SHOWING = ("display", "visibility", "opacity")
NOT_SHOWN = re.compile(r"(?:^|;)(?:display:none|opacity:0*\.?0*%?);")
HIDDEN = re.compile(r"(?:^|;)(?:display:none|opacity:0*\.?0*%?|visibility:(?:hidden|collapse));")
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


@dataclass(frozen=True)
class SvgPage:
    """The scale in mm per user unit, and the user coordinates of the page's left and lower
    edges."""

    scale_mm: float
    left: float
    bottom: float


def read_svg(content: bytes, where: str, reading: DrawingReading) -> tuple[list[DrawnShape], str]:
    """Return every visible shape of the SVG file ``content``, and words for what is hidden."""
    try:
        root = ET.fromstring(content)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise ConfigError(f"{where}: not valid SVG ({error}); export it again") from None
    if root.tag.rpartition("}")[2] != "svg":
        raise ConfigError(
            f"{where}: not an SVG drawing but <{root.tag.rpartition('}')[2]}>; export it again"
        )
    _refuse_copies(root, where)
    page = _page(root, where, reading)
    for key in ("width", "height", "viewBox", "preserveAspectRatio", "x", "y"):
        root.attrib.pop(key, None)
    try:
        tree = svgelements.SVG.parse(io.BytesIO(ET.tostring(root)), reify=True, ppi=96.0)
        shapes = limited(_shapes(tree, frozenset(), page, reading.tolerance_mm), where)
        hidden = sum(HIDDEN.search(_style_of(one)) is not None for one in root.iter())
        said = f"; {hidden} hidden shapes or groups were left out: show what is meant"
        return shapes, said if hidden else ""
    except EitskinError:
        raise
    except Exception as error:  # the parser defines no error type; damage raises many kinds
        raise ConfigError(
            f"{where}: cannot be read as SVG ({type(error).__name__}: {error}); export it again"
        ) from None


def _page(root: ET.Element, where: str, reading: DrawingReading) -> SvgPage:
    try:
        box = [float(word) for word in re.split(r"[\s,]+", root.get("viewBox", "").strip()) if word]
    except ValueError:
        box = []
    if root.get("viewBox") is not None and (
        len(box) != 4 or not all(map(math.isfinite, box)) or min(box[2:]) <= 0
    ):
        raise ConfigError(
            f"{where}: viewBox = {root.get('viewBox')!r} is not four numbers, width and height"
            " above 0; repair it"
        )
    sizes = [_length_mm(root.get(key)) for key in ("width", "height")]
    scale = reading.scale_mm
    if scale is None:
        given = [
            size / side if box else MM_A_PIXEL
            for size, side in zip(sizes, box[2:] or (1, 1), strict=True)
            if size
        ]
        if not given:
            raise ConfigError(
                f"{where}: width and height have no unit such as mm; give scale_mm, mm a unit"
            )
        if max(given) > 1.001 * min(given):
            raise ConfigError(
                f"{where}: width and height scale it by {given[0]:g} and {given[-1]:g} mm a unit;"
                " give scale_mm"
            )
        scale = given[0]
    if box:
        return SvgPage(scale, box[0], box[1] + box[3])
    return SvgPage(scale, 0.0, sizes[1] / MM_A_PIXEL if sizes[1] else 0.0)


def _length_mm(text: str | None) -> float | None:
    """Return a length with a physical unit in mm, or None for any other text."""
    found = re.fullmatch(r"\s*\+?(\d*\.?\d+(?:[eE][+-]?\d+)?)\s*([a-zA-Z]+)\s*", text or "")
    value = float(found[1]) * MM.get(found[2].lower(), 0.0) if found else 0.0
    return value if math.isfinite(value) and value > 0 else None


def _refuse_copies(root: ET.Element, where: str) -> None:
    """Reject <use> elements that refer to each other in a circle, and more copies of copies than
    could be parsed in reasonable time."""
    by_id = {one.get("id"): one for one in root.iter() if one.get("id")}
    counts: dict[int, tuple[int, int]] = {}  # number of elements, and of words in their paths

    def count(one: ET.Element, depth: int) -> tuple[int, int]:
        if depth > MAX_DEPTH:
            raise ConfigError(
                f"{where}: groups or copies within each other, over {MAX_DEPTH} deep; flatten the"
                " drawing"
            )
        if id(one) not in counts:
            target = next(
                (value for key, value in one.attrib.items() if key.rpartition("}")[2] == "href"), ""
            )
            is_copy = one.tag.rpartition("}")[2] == "use" and target.startswith("#")
            copied = by_id.get(target[1:]) if is_copy else None
            words = sum(1 for key in WORKED for _ in WORD.finditer(one.get(key, "")))
            words += LOOSE_WORDS * sum(1 for _ in LOOSE.finditer(one.get("d", "")))
            children = [*one] if copied is None else [*one, copied]
            below = [(1, words), *(count(child, depth + 1) for child in children)]
            counts[id(one)] = sum(n for n, _ in below), sum(n for _, n in below)
        return counts[id(one)]

    elements, words = count(root, 0)
    if elements > MAX_SHAPES:
        raise ConfigError(f"{where}: over {MAX_SHAPES} elements; export the outline alone")
    if words > MAX_WORDS:
        raise ConfigError(
            f"{where}: paths and transforms of over {MAX_WORDS} numbers and letters; export the"
            " outline alone, or simplify it"
        )
    sheets = [one for one in root.iter() if str(one.tag).rpartition("}")[2] == "style"]
    styles = [one.text or "" for one in sheets] + [one.get("style", "") for one in root.iter()]
    if sum(map(len, styles)) > MAX_STYLE * max(1, elements // 20):
        raise ConfigError(f"{where}: style sheets over {MAX_STYLE} characters; export plain SVG")


def _shapes(
    one: Any, around: frozenset[str], page: SvgPage, tolerance_mm: float
) -> Iterator[DrawnShape]:
    values = one.values if isinstance(one.values, dict) else {}
    attributes = values.get("attributes", {})
    if NOT_SHOWN.search(_style(attributes)):
        return
    if isinstance(one, svgelements.Shape) and str(values.get("visibility")) in (
        "hidden",
        "collapse",
    ):
        return
    own = {attributes.get("id"), attributes.get(LABEL), *str(attributes.get("class", "")).split()}
    names = around | {str(name) for name in own if name}
    if isinstance(one, list) and not isinstance(one, svgelements.Shape):
        for child in one:
            yield from _shapes(child, names, page, tolerance_mm)
    elif isinstance(one, svgelements.Shape):
        for run in _runs(abs(svgelements.Path(one)), tolerance_mm / page.scale_mm):
            points = (np.array(run) - (page.left, page.bottom)) * (page.scale_mm, -page.scale_mm)
            closed = len(points) > 3 and math.dist(points[0], points[-1]) <= 1e-6 * float(
                np.ptp(points, axis=0).max()
            )
            yield DrawnShape(
                str(attributes.get("id") or ""),
                names,
                points[:-1] if closed else points,
                closed,
                id(one),
            )


def _style_of(one: ET.Element) -> str:
    return _style({str(key): value for key, value in one.attrib.items()})


def _style(attributes: Mapping[str, Any]) -> str:
    """Return what an element says of its own visibility, in the form of a style without blanks."""
    own = [f"{key}:{attributes[key]}" for key in SHOWING if attributes.get(key) is not None]
    return ";".join([*own, str(attributes.get("style", ""))]).replace(" ", "") + ";"


def _runs(path: Any, tolerance: float) -> Iterator[list[tuple[float, float]]]:
    """Yield each subpath as flattened points; a closed one ends on its first point."""
    run: list[tuple[float, float]] = []
    for piece in path:
        if isinstance(piece, svgelements.Move):
            if len(run) > 1:
                yield run
            run = [_pair(piece.end)]
        elif isinstance(piece, (svgelements.CubicBezier, svgelements.QuadraticBezier)):
            pieces = bezier_pieces([_pair(point) for point in _controls(piece)], tolerance)
            run += flattened(_along(piece), pieces)
        elif isinstance(piece, svgelements.Arc):
            pieces = arc_pieces(max(piece.rx, piece.ry), piece.sweep, tolerance)
            run += flattened(_along(piece), pieces)
        elif piece.end is not None:
            run.append(_pair(piece.end))
        if len(run) > MAX_POINTS:
            raise TooManyPoints
    if len(run) > 1:
        yield run


def _controls(piece: Any) -> list[Any]:
    if isinstance(piece, svgelements.QuadraticBezier):
        return [piece.start, piece.control, piece.end]
    return [piece.start, piece.control1, piece.control2, piece.end]


def _along(piece: Any) -> Callable[[float], tuple[float, float]]:
    """Return the function that maps the parameter of a curve to its point."""
    return lambda t: _pair(piece.point(t))


def _pair(point: Any) -> tuple[float, float]:
    return float(point.x), float(point.y)
