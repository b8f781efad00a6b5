"""Read the outline and the electrodes of a skin from an SVG or DXF drawing.

Shapes are in mm with y up; one of them is the skin's rim. A skin keeps only the polygon and the
places: nothing depends on the drawing once it has been read.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.config import first_few
from eitskin.errors import ConfigError, GeometryError
from eitskin.fileio import read_bytes
from eitskin.skin.drawing_shapes import DrawingReading, DrawnShape
from eitskin.skin.outline import Outline, polygon

MAX_BYTES = 2_000_000
JOIN_MM = 0.01  # two ends of lines that are closer than this are the same point


@dataclass(frozen=True, eq=False)
class Drawing:
    """The shapes that a file draws; ``where`` names the file in errors, and ``left_out`` what it
    holds besides, such as "; 2 hidden shapes were left out"."""

    where: str
    shapes: tuple[DrawnShape, ...]
    left_out: str = ""

    def marked(self, mark: str) -> tuple[DrawnShape, ...]:
        """Return the shapes that ``mark`` names by id, class, layer or group, and those whose id is
        ``mark`` followed by a number, in any order.

        Raises:
            ConfigError: no shape has this mark.
        """
        numbered = re.compile(re.escape(mark) + r"[ _.-]?\d+")
        found = tuple(
            one for one in self.shapes if mark in one.names or numbered.fullmatch(one.name)
        )
        if not found:
            raise ConfigError(
                f"{self.where}: nothing is marked {mark!r}; {self._known()}{self.left_out}"
            )
        return found

    def outline(self, element: str | None = None, mark: str | None = None) -> Outline:
        """Return the only closed outline among the shapes named ``element`` (None: all shapes) that
        do not carry ``mark``.

        Raises:
            ConfigError: nothing is named ``element`` or marked ``mark``.
            GeometryError: there is no closed outline or more than one, or it is not a valid
                polygon.
        """
        marks = {id(one) for one in self.marked(mark)} if mark is not None else set()
        shapes = [one for one in self.shapes if id(one) not in marks]
        if element is not None:
            shapes = [one for one in shapes if element in one.names]
            if not shapes:
                raise ConfigError(
                    f"{self.where}: nothing is named {element!r}; {self._known()}{self.left_out}"
                )
        closed = [one for one in shapes if one.closed] + joined(
            [one for one in shapes if not one.closed]
        )
        if not closed:
            raise GeometryError(
                f"{self.where}: no closed outline among {len(shapes)} shapes; close the rim's line"
                f"{self.left_out}"
            )
        if len(closed) > 1 and len({one.part_of for one in closed} - {None}) == 1:
            name = next(iter(sorted(closed[0].names)), "") if element is None else element
            raise GeometryError(
                f"{self.where}: {f'{name!r} itself' if name else 'the only shape'} has"
                f" {len(closed)} closed parts, but a skin has one rim and no holes; split the path"
                " (in Inkscape: Path, Break Apart), and name the outer part with element = ..."
            )
        if len(closed) > 1:
            raise GeometryError(
                f"{self.where}: {len(closed)} closed outlines; name one with element = ...;"
                f" {_names_of(closed)}"
            )
        try:
            return polygon(_without_repeats(closed[0].points_mm))
        except GeometryError as error:
            raise GeometryError(f"{self.where}: {error}") from None

    def _known(self) -> str:
        return _names_of(self.shapes)


def read_drawing(path: Path, reading: DrawingReading) -> Drawing:
    """Read the drawing in the file ``path``; the ending .svg or .dxf gives its format.

    Raises:
        FileError: the file cannot be read.
        ConfigError: the file has another format, is damaged, or does not state its scale.
        MissingExtraError: the library that parses it is not installed.
    """
    kind = path.suffix.lower()
    if kind not in (".svg", ".dxf"):
        raise ConfigError(f"{path}: a drawing must be .svg or .dxf")
    content = read_bytes(path, "drawing", MAX_BYTES)
    if kind == ".svg":
        from eitskin.skin.drawing_svg import read_svg as read
    else:
        from eitskin.skin.drawing_dxf import read_dxf as read
    shapes, left_out = read(content, str(path), reading)
    if not shapes:
        raise ConfigError(
            f"{path}: nothing is drawn in it; draw the rim as one closed line{left_out}"
        )
    return Drawing(str(path), tuple(shapes), left_out)


def joined(open_shapes: Sequence[DrawnShape]) -> list[DrawnShape]:
    """Join open shapes at ends that meet, and return the closed shapes. A joint takes exactly two
    ends; shapes that do not close are left out."""
    left = {k: one for k, one in enumerate(open_shapes) if len(one.points_mm) > 1}
    ends, closed = _Ends(left), []
    while left:
        first = next(reversed(left))
        chain, names = left.pop(first).points_mm, []
        while not _meet(chain[0], chain[-1]):
            unused = (found for found in ends.near(chain[-1]) if found[0] in left)
            found = list(islice(unused, 2))
            if len(found) != 1:
                break
            k, end = found[0]
            piece = left.pop(k)
            chain = np.concatenate(
                [chain, (piece.points_mm if end == 0 else piece.points_mm[::-1])[1:]]
            )
            names.append(piece.names)
        else:
            if len(chain) > 3:
                closed.append(DrawnShape("", frozenset().union(*names), chain[:-1], True))
    return closed


class _Ends:
    """The ends of lines, sorted by position into cells of ``JOIN_MM``."""

    def __init__(self, lines: Mapping[int, DrawnShape]) -> None:
        self._cells: dict[tuple[int, int], list[tuple[int, int, FloatArray]]] = {}
        for k, one in lines.items():
            for end in (0, -1):
                point = one.points_mm[end]
                if np.isfinite(point).all():
                    self._cells.setdefault(_cell(point), []).append((k, end, point))

    def near(self, point: FloatArray) -> Iterator[tuple[int, int]]:
        """Yield the number of each line that ends at ``point``, and which end it is (0 or -1)."""
        if not np.isfinite(point).all():
            return
        column, row = _cell(point)
        for cell in product((column - 1, column, column + 1), (row - 1, row, row + 1)):
            for k, end, other in self._cells.get(cell, ()):
                if _meet(other, point):
                    yield k, end


def _cell(point: FloatArray) -> tuple[int, int]:
    return math.floor(point[0] / JOIN_MM), math.floor(point[1] / JOIN_MM)


def _meet(a: FloatArray, b: FloatArray) -> bool:
    return math.hypot(a[0] - b[0], a[1] - b[1]) <= JOIN_MM


def _without_repeats(points_mm: FloatArray) -> FloatArray:
    """Return ``points_mm`` without points that almost coincide with the one before, as the joints
    of a drawing's pieces do."""
    size = float(np.ptp(points_mm, axis=0).max())
    if not (np.isfinite(points_mm).all() and size > 0):
        return points_mm
    steps = points_mm - np.roll(points_mm, 1, axis=0)
    return points_mm[np.hypot(steps[:, 0], steps[:, 1]) > 2e-6 * size]


def _names_of(shapes: Sequence[DrawnShape]) -> str:
    known = sorted({name for one in shapes for name in one.names if name})
    return f"names in it are: {first_few(known, 12)}" if known else "no shape in it has a name"
