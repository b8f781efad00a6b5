"""A skin: its outline, electrodes and conductive layer, read from TOML and written back as a
table."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.config import check_keys, choice, integer, load_toml, number
from eitskin.errors import ConfigError, GeometryError
from eitskin.skin.drawing import Drawing, read_drawing
from eitskin.skin.drawing_shapes import TOLERANCE_MM, DrawingReading
from eitskin.skin.eidors import EidorsModel, read_eidors
from eitskin.skin.electrodes import MAX_COUNT, MIN_COUNT, Electrodes
from eitskin.skin.outline import MAX_SIZE_MM, MIN_SIZE_MM, Outline, disk, polygon
from eitskin.skin.placement import SNAP_MM, Placed, by_fractions, by_marks, by_points
from eitskin.skin.protocol import Protocol, protocol_from_table
from eitskin.skin.protocol import table as protocol_table
from eitskin.skin.uncertainty import (
    DEFAULT_UNCERTAINTY,
    Uncertainty,
    uncertainty_from_table,
    uncertainty_to_table,
)
from eitskin.surface.covered import CoveredSurface, covered_link, covered_surface
from eitskin.surface.outline import rim_circle, simplified
from eitskin.surface.surface_map import SurfaceMap

OUTLINES = ("diameter_mm", "polygon_mm", "outline", "surface")
DRAWING_KEYS = ("element", "scale_mm", "tolerance_mm")
SURFACE_KEYS = ("surface_unit", "link")
SKIN_KEYS = (
    "name",
    *OUTLINES,
    *DRAWING_KEYS,
    *SURFACE_KEYS,
    "thickness_mm",
    "conductivity_s_per_m",
)
PLACES = ("positions_mm", "fractions", "points_mm", "marked", "vertices")
ELECTRODE_KEYS = (
    "count",
    "width_mm",
    "start_angle_deg",
    "direction",
    *PLACES,
    "snap_mm",
    "contact_impedance_ohm_m2",
)
MIN_GAP_PER_WIDTH = 0.05
PAPER_DIAMETER_MM = 194.0


@dataclass(frozen=True)
class Skin:
    """A conductive sheet of constant thickness with electrodes at its rim. ``uncertainty`` states
    how far a real skin may differ from this description; None means that nothing is stated. A skin
    on a ``surface`` has the outline of its flattened copy, whose rim has the true lengths.

    Raises:
        GeometryError: electrodes overlap, nearly touch (a gap below 5 % of their width) or are
            wider than the rim, or the sheet's conductivity or thickness is not above 0.
    """

    name: str
    outline: Outline
    electrodes: Electrodes
    conductivity_s_per_m: float = 0.01
    thickness_mm: float = 12.0
    uncertainty: Uncertainty | None = DEFAULT_UNCERTAINTY
    surface: SurfaceMap | None = None

    def __post_init__(self) -> None:
        for key in ("conductivity_s_per_m", "thickness_mm"):
            value = getattr(self, key)
            if not (isfinite(value) and value > 0):
                raise GeometryError(f"skin {self.name!r}: {key} = {value:g} must be above 0")
        _refuse_overlap(self)

    def electrode_spans_mm(self) -> FloatArray:
        """Return the arc lengths (counterclockwise) at which each electrode starts and ends,
        (count, 2).

        Starts lie in [0, perimeter). The end of an electrode that straddles arc length 0 exceeds
        the perimeter.
        """
        perimeter, half = self.outline.perimeter_mm, self.electrodes.width_mm / 2
        starts = np.mod(self._centre_arc_lengths_mm() - half, perimeter)
        return np.column_stack([starts, starts + self.electrodes.width_mm])

    def electrode_centres_mm(self) -> FloatArray:
        """Return the rim's point in the middle of each electrode, (count, 2)."""
        return self.outline.points_at(self._centre_arc_lengths_mm())

    def _centre_arc_lengths_mm(self) -> FloatArray:
        electrodes, perimeter = self.electrodes, self.outline.perimeter_mm
        if electrodes.positions_mm is None:
            along = np.arange(electrodes.count) * (perimeter / electrodes.count)
        else:
            along = np.array(electrodes.positions_mm, dtype=np.float64)
        start = self.outline.arc_length_at_angle(electrodes.start_angle_deg)
        place = start - along if electrodes.clockwise else start + along
        return np.asarray(np.mod(place, perimeter))


def _refuse_overlap(skin: Skin) -> None:
    count, width = skin.electrodes.count, skin.electrodes.width_mm
    perimeter, least = skin.outline.perimeter_mm, MIN_GAP_PER_WIDTH * width
    if count * (width + least) > perimeter:
        raise GeometryError(
            f"skin {skin.name!r}: {count} electrodes of {width:g} mm do not fit on a rim of"
            f" {perimeter:g} mm; use fewer or narrower ones"
        )
    starts = skin.electrode_spans_mm()[:, 0]
    order = np.argsort(starts, kind="stable")
    gaps = np.diff(np.append(starts[order], starts[order[0]] + perimeter)) - width
    worst = int(np.argmin(gaps))
    if gaps[worst] < least * (1 - 1e-9):
        first, second = sorted((int(order[worst]), int(order[(worst + 1) % count])))
        raise GeometryError(
            f"skin {skin.name!r}: electrodes {first} and {second} (from 0) overlap or nearly touch"
            f" (gap {gaps[worst]:.3g} mm, at least {least:.3g} mm is needed); move them apart or"
            " make them narrower"
        )


def size_to_paper(outline: Outline) -> float:
    """Return the size of the outline relative to the paper's skin: the diameter of the disk of
    equal area over 194 mm. Default lengths are scaled by it."""
    return 2 * float(np.sqrt(outline.area_mm2 / np.pi)) / PAPER_DIAMETER_MM


def paper_skin() -> Skin:
    """Return the hydrogel skin of the paper: a disk of 194 mm, 12 mm thick, with 16 electrodes of 4
    mm and 0.01 S/m."""
    return Skin("paper", disk(PAPER_DIAMETER_MM), Electrodes())


def skin_from_table(table: Mapping[str, Any], where: str, folder: Path | None = None) -> Skin:
    """Return the skin in a parsed TOML ``table`` with [skin] and [electrodes]; ``where`` names its
    source in errors. A drawing that the table names is read from ``folder``; without ``folder``, as
    for the table of a stored model, naming a drawing is an error.

    Raises:
    ConfigError: a key is unknown, or a value has the wrong type or is out of range.
    GeometryError: the outline or the electrodes are not possible.
    FileError, MissingExtraError: a drawing cannot be read.
    """
    check_keys(table, ("skin", "electrodes", "protocol", "uncertainty"), where)
    sheet, place = _subtable(table, "skin", where, required=True), f"{where} [skin]"
    check_keys(sheet, SKIN_KEYS, place)
    name = sheet.get("name", "skin")
    if not isinstance(name, str) or not name:
        raise ConfigError(f"{place}: name must be a word in quotes, not {name!r}")
    if not name.isprintable():
        raise ConfigError(f"{place}: name {name!r} has characters that cannot be printed")
    contacts = _subtable(table, "electrodes", where)
    try:
        drawing = _drawing_of(sheet, place, folder)
        covered = _surface_of(sheet, place, folder)
        if covered is None:
            outline = _outline_from_table(sheet, place, drawing, contacts.get("marked"))
        else:
            outline = outline_on(covered.map)
        return Skin(
            name=name,
            outline=outline,
            electrodes=_electrodes_from_table(
                contacts, f"{where} [electrodes]", outline, drawing, covered
            ),
            conductivity_s_per_m=number(
                sheet, "conductivity_s_per_m", 0.01, place, low=0, high=1e8, open_low=True
            ),
            thickness_mm=number(sheet, "thickness_mm", 12.0, place, low=0, high=1e4, open_low=True),
            uncertainty=uncertainty_from_table(table.get("uncertainty"), where),
            surface=None if covered is None else covered.map,
        )
    except GeometryError as error:
        raise GeometryError(f"{where}: {error}") from None


def load_skin(path: str | Path) -> tuple[Skin, Protocol]:
    """Return the skin and the protocol in the TOML file ``path``; without [protocol], the protocol
    is adjacent. A .mat file is read as an EIDORS model.

    Raises:
        FileError: the file, or a drawing that it names, cannot be read.
        ConfigError, GeometryError, ProtocolError: the description is not valid.
        MissingExtraError: the library that reads a drawing is not installed.
    """
    if Path(path).suffix.lower() == ".mat":
        return skin_of_eidors(read_eidors(path))
    table, where = load_toml(path, "skin description"), str(path)
    skin = skin_from_table(table, where, Path(path).parent)
    return skin, protocol_from_table(
        _subtable(table, "protocol", where), skin.electrodes.count, f"{where} [protocol]"
    )


def skin_of_eidors(model: EidorsModel) -> tuple[Skin, Protocol]:
    """Return the skin and the protocol of an EIDORS ``model``. Electrodes get the mean width and
    the mean contact impedance."""
    outline, origin_mm = model.outline()
    middles, width_mm = model.contacts()
    default, thickness_m = Electrodes(), 1e-3 * model.thickness_mm
    placed = by_points(outline, middles - origin_mm, default.start_angle_deg, None, width_mm)
    skin = Skin(
        name=model.name,
        outline=outline,
        electrodes=Electrodes(
            count=len(middles),
            width_mm=width_mm,
            clockwise=placed.clockwise,
            positions_mm=placed.positions_mm,
            contact_impedance_ohm_m2=float(model.contact_ohm_m.mean()) * thickness_m,
        ),
        conductivity_s_per_m=model.sheet_s / thickness_m,
        thickness_mm=model.thickness_mm,
    )
    return skin, protocol_table(len(middles), model.rows, model.current_a)


def skin_to_table(skin: Skin) -> dict[str, Any]:
    """Return a table from which ``skin_from_table`` makes an equal skin."""
    outline, electrodes = skin.outline, skin.electrodes
    sheet: dict[str, Any] = {"name": skin.name}
    if outline.diameter_mm is not None:
        sheet["diameter_mm"] = outline.diameter_mm
    else:
        sheet["polygon_mm"] = [[x, y] for x, y in outline.vertices_mm]
    sheet |= {"thickness_mm": skin.thickness_mm, "conductivity_s_per_m": skin.conductivity_s_per_m}
    contacts: dict[str, Any] = {
        "count": electrodes.count,
        "width_mm": electrodes.width_mm,
        "start_angle_deg": electrodes.start_angle_deg,
        "direction": "clockwise" if electrodes.clockwise else "counterclockwise",
    }
    if electrodes.positions_mm is not None:
        contacts["positions_mm"] = list(electrodes.positions_mm)
    contacts["contact_impedance_ohm_m2"] = electrodes.contact_impedance_ohm_m2
    table: dict[str, Any] = {"skin": sheet, "electrodes": contacts}
    if skin.uncertainty != DEFAULT_UNCERTAINTY:
        table["uncertainty"] = uncertainty_to_table(skin.uncertainty)
    return table


def _subtable(
    table: Mapping[str, Any], key: str, where: str, *, required: bool = False
) -> Mapping[str, Any]:
    value = table.get(key)
    if value is None and not required:
        return {}
    if not isinstance(value, Mapping):
        raise ConfigError(
            f"{where}: a table [{key}] is needed"
            + ("" if value is None else f", not {key} = {value!r}")
        )
    return value


def _drawing_of(sheet: Mapping[str, Any], where: str, folder: Path | None) -> Drawing | None:
    """Read the drawing that [skin] names, if it names one."""
    if sum(key in sheet for key in OUTLINES) != 1:
        raise ConfigError(
            f"{where}: give either diameter_mm or polygon_mm, or outline = a drawing's file, or"
            " surface = a mesh file"
        )
    if "outline" not in sheet:
        for key in DRAWING_KEYS:
            if key in sheet:
                raise ConfigError(f"{where}: {key} goes with outline = a drawing's file; remove it")
        return None
    path = _file_of(sheet, "outline", "a drawing", where, folder)
    scale = (
        number(sheet, "scale_mm", None, where, low=0, high=1e6, open_low=True)
        if "scale_mm" in sheet
        else None
    )
    tolerance = number(sheet, "tolerance_mm", TOLERANCE_MM, where, low=1e-3, high=10)
    return read_drawing(path, DrawingReading(scale, tolerance))


def _file_of(
    sheet: Mapping[str, Any], key: str, what: str, where: str, folder: Path | None
) -> Path:
    """Return the path of the file that ``key`` names, which holds ``what``."""
    name = sheet[key]
    if not isinstance(name, str) or not name or "\0" in name:
        raise ConfigError(
            f"{where}: {key} must be the name of {what}'s file in quotes, not {name!r}"
        )
    if folder is None:
        raise ConfigError(
            f"{where}: {key} = {name!r} cannot be read from here; only a skin description's file"
            f" names {what}"
        )
    return folder / name


def _surface_of(sheet: Mapping[str, Any], where: str, folder: Path | None) -> CoveredSurface | None:
    """Read the surface that [skin] names, if it names one."""
    if "surface" not in sheet:
        for key in SURFACE_KEYS:
            if key in sheet:
                raise ConfigError(f"{where}: {key} goes with surface = a mesh file; remove it")
        return None
    path = _file_of(sheet, "surface", "a mesh", where, folder)
    file, _, link = str(sheet["surface"]).partition("#")
    if file.lower().endswith(".urdf"):
        for key in SURFACE_KEYS:
            if key in sheet:
                raise ConfigError(
                    f"{where}: {key} goes with a mesh file; remove it, a URDF says it"
                )
        return covered_link(_file_of({"surface": file}, "surface", "a URDF", where, folder), link)
    unit = choice(sheet, "surface_unit", "mm", ("mm", "m"), where)
    return covered_surface(path, unit, _word(sheet, "link", where) or "")


def outline_on(surface: SurfaceMap) -> Outline:
    """Return the outline of the flattened copy: a disk if its rim is round."""
    rim = surface.rim_mm
    circle = rim_circle(rim)
    if circle is None:
        return polygon(simplified(rim).tolist())
    return disk(2 * circle[1])


def _outline_from_table(
    sheet: Mapping[str, Any], where: str, drawing: Drawing | None, marked: object
) -> Outline:
    if drawing is not None:
        mark = marked if isinstance(marked, str) else None
        return drawing.outline(_word(sheet, "element", where), mark)
    if "diameter_mm" in sheet:
        return disk(number(sheet, "diameter_mm", None, where, low=MIN_SIZE_MM, high=MAX_SIZE_MM))
    return polygon(_points(sheet, "polygon_mm", where))


def _electrodes_from_table(
    table: Mapping[str, Any],
    where: str,
    outline: Outline,
    drawing: Drawing | None,
    covered: CoveredSurface | None,
) -> Electrodes:
    check_keys(table, ELECTRODE_KEYS, where)
    default = Electrodes()
    start = number(table, "start_angle_deg", default.start_angle_deg, where, low=-360, high=360)
    way = choice(table, "direction", "counterclockwise", ("clockwise", "counterclockwise"), where)
    placed = _places(table, where, outline, drawing, covered, start, way == "clockwise")
    count, width, key = default.count, default.width_mm, "contact_impedance_ohm_m2"
    if placed is not None and "positions_mm" not in table:
        count = len(placed.positions_mm) if len(placed.positions_mm) <= MAX_COUNT else count
    return Electrodes(
        count=integer(table, "count", count, where, low=MIN_COUNT, high=MAX_COUNT),
        width_mm=number(table, "width_mm", width, where, low=0, high=MAX_SIZE_MM, open_low=True),
        start_angle_deg=start,
        clockwise=way == "clockwise" if placed is None else placed.clockwise,
        positions_mm=None if placed is None else placed.positions_mm,
        contact_impedance_ohm_m2=number(table, key, getattr(default, key), where, low=0, high=1e6),
    )


def _places(
    table: Mapping[str, Any],
    where: str,
    outline: Outline,
    drawing: Drawing | None,
    covered: CoveredSurface | None,
    start_deg: float,
    clockwise: bool,
) -> Placed | None:
    """Return the places of the electrodes as the table gives them, or None if they are evenly
    spaced."""
    given = [key for key in PLACES if key in table]
    if len(given) > 1:
        raise ConfigError(
            f"{where}: {given[0]} and {given[1]} both say where electrodes are; keep one"
        )
    if "snap_mm" in table and given not in (["points_mm"], ["marked"], ["vertices"]):
        raise ConfigError(f"{where}: snap_mm goes with points_mm, vertices or marked; remove it")
    if not given:
        return None
    snap = number(table, "snap_mm", SNAP_MM, where, low=0, high=MAX_SIZE_MM)
    way = clockwise if "direction" in table else None
    if given == ["marked"]:
        mark = _word(table, "marked", where)
        if drawing is None or mark is None:
            raise ConfigError(
                f"{where}: marked names marks of a drawing, but [skin] has no outline = a drawing's"
                " file"
            )
        return by_marks(outline, drawing.marked(mark), start_deg, way, snap)
    if covered is not None and given in (["points_mm"], ["vertices"]):
        if given == ["points_mm"]:
            points = _points(table, "points_mm", where, 3)
        else:
            points = covered.vertices_mm(_numbers(table, "vertices", where), where)
        if not points:
            raise ConfigError(f"{where}: {given[0]} is empty; give one entry for each electrode")
        return by_points(outline, covered.on_rim(points, snap), start_deg, way, MAX_SIZE_MM)
    if given == ["vertices"]:
        raise ConfigError(f"{where}: vertices goes with surface = a mesh file; remove it")
    if given == ["points_mm"]:
        points = _points(table, "points_mm", where)
        if not points:
            raise ConfigError(f"{where}: points_mm is empty; give [x, y] for each electrode")
        return by_points(outline, points, start_deg, way, snap)
    values = _numbers(table, given[0], where)
    if given == ["fractions"]:
        return by_fractions(outline, values, clockwise)
    return Placed(tuple(float(value) for value in values), clockwise)


def _word(table: Mapping[str, Any], key: str, where: str) -> str | None:
    value = table.get(key)
    if value is not None and (not isinstance(value, str) or not value):
        raise ConfigError(f"{where}: {key} must be a word in quotes, not {value!r}")
    return value


def _numbers(table: Mapping[str, Any], key: str, where: str) -> list[float]:
    values = table[key]
    if not (isinstance(values, list) and all(_is_number(value) for value in values)):
        raise ConfigError(f"{where}: {key} must be a list of numbers")
    return values


def _points(
    table: Mapping[str, Any], key: str, where: str, dimensions: int = 2
) -> list[list[float]]:
    points, form = table[key], ("[x, y]", "[x, y, z]")[dimensions - 2]
    if not isinstance(points, list):
        raise ConfigError(f"{where}: {key} must be a list of {form} points")
    for k, point in enumerate(points):
        good = isinstance(point, list) and len(point) == dimensions
        if not (good and all(map(_is_number, point))):
            raise ConfigError(f"{where}: {key} entry {k} (from 0) must be {form}, not {point!r}")
    return points


def _is_number(value: object) -> bool:
    """Return whether ``value`` is a number that a float can hold; truth values do not count."""
    return isinstance(value, float) or (
        isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63
    )
