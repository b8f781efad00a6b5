"""Outlines and electrodes out of SVG and DXF files: sizes, sides, transforms, and a refusal of one
line for the rest."""

import math
import sys
from pathlib import Path

import ezdxf
import numpy as np
import pytest

from eitskin.errors import ConfigError, FileError, GeometryError, MissingExtraError
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.skin.drawing import read_drawing
from eitskin.skin.drawing_shapes import DrawingReading
from eitskin.skin.outline import Outline
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import Skin, load_skin, skin_from_table, skin_to_table

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" {} >{}</svg>'
MM = 'width="100mm" height="80mm" viewBox="0 0 100 80"'
BOX = '<rect id="skin" x="10" y="10" width="60" height="40"/>'


def svg(folder: Path, body: str, head: str = MM) -> Path:
    path = folder / "a.svg"
    path.write_text(HEAD.format(head, body), encoding="utf-8")
    return path


def outline(path: Path, element: str | None = None, **reading: float) -> Outline:
    return read_drawing(path, DrawingReading(**reading)).outline(element)


def described(
    folder: Path, body: str, skin: str = "", electrodes: str = "count = 8", head: str = MM
) -> Skin:
    """The skin of a description that names a drawing with ``body``."""
    svg(folder, body, head)
    path = folder / "skin.toml"
    path.write_text(
        f'[skin]\noutline = "a.svg"\n{skin}\n[electrodes]\n{electrodes}\n', encoding="utf-8"
    )
    return load_skin(path)[0]


def assert_centres(skin: Skin, wanted: list[tuple[float, float]]) -> None:
    np.testing.assert_allclose(skin.electrode_centres_mm(), wanted, atol=1e-4)


def test_y_goes_up_from_the_lower_edge_of_the_page(tmp_path):
    assert outline(svg(tmp_path, BOX)).bounding_box_mm == pytest.approx((10, 30, 70, 70), abs=1e-4)
    shifted = 'width="50mm" height="40mm" viewBox="10 20 100 80"'
    shape = outline(svg(tmp_path, BOX, shifted))
    assert shape.bounding_box_mm == pytest.approx((0, 25, 30, 45), abs=1e-4)


@pytest.mark.parametrize(
    ("head", "reading", "width_mm"),
    [
        ('width="10cm" height="8cm" viewBox="0 0 100 80"', {}, 60.0),
        ('width="4in" viewBox="0 0 100 80"', {}, 60 * 1.016),
        ('width="100mm" height="80mm"', {}, 60 * 25.4 / 96),
        ('width="100" height="80" viewBox="0 0 100 80"', {"scale_mm": 2.0}, 120.0),
        ("", {"scale_mm": 0.5}, 30.0),
    ],
)
def test_units(tmp_path, head, reading, width_mm):
    x0, _, x1, _ = outline(svg(tmp_path, BOX, head), **reading).bounding_box_mm
    assert x1 - x0 == pytest.approx(width_mm, rel=1e-6)


def test_transforms_and_groups(tmp_path):
    body = (
        '<g id="layer" transform="translate(50 40) rotate(90) scale(2)"><path class="rim" d="M0 0'
        ' h20 v10 h-20 z"/></g>'
    )
    shape = outline(svg(tmp_path, body + '<circle cx="9" cy="9" r="5"/>'), "layer")
    assert shape.bounding_box_mm == pytest.approx((30, 0, 50, 40), abs=1e-4)
    assert outline(svg(tmp_path, body), "rim").area_mm2 == pytest.approx(800, rel=1e-6)


def test_copies_are_placed(tmp_path):
    body = '<defs><rect id="r" width="20" height="10"/></defs><use href="#r" x="30" y="40"/>'
    assert outline(svg(tmp_path, body)).bounding_box_mm == pytest.approx((30, 30, 50, 40), abs=1e-4)


@pytest.mark.parametrize("tolerance", [0.02, 0.3])
@pytest.mark.parametrize(
    "body",
    [
        '<circle cx="50" cy="40" r="30"/>',
        '<path d="M20 40 A30 30 0 0 1 80 40 A30 30 0 0 1 20 40 Z"/>',
        # a circle of four cubic curves lies within 0.03 % of the radius
        (
            '<path d="M80 40 C80 56.5685 66.5685 70 50 70 S20 56.5685 20 40 S33.4315 10 50 10 S80'
            ' 23.4315 80 40 Z"/>'
        ),
    ],
)
def test_curves_are_flat_to_the_tolerance(tmp_path, body, tolerance):
    shape = outline(svg(tmp_path, body), tolerance_mm=tolerance)
    corners = np.array(shape.vertices_mm)
    middles = (corners + np.roll(corners, -1, axis=0)) / 2
    off = 30 - np.hypot(middles[:, 0] - 50, middles[:, 1] - 40)
    assert off.max() <= tolerance + 0.01
    assert off.max() >= tolerance / 8  # and no finer than asked for


def test_open_pieces_are_joined(tmp_path):
    body = (
        '<path d="M10 10 H70"/><path d="M10 50 V10"/><path d="M70 10 V50"/><path d="M70 50 H10"/>'
    )
    assert outline(svg(tmp_path, body)).area_mm2 == pytest.approx(2400, rel=1e-6)
    with pytest.raises(GeometryError, match="no closed outline among 3 shapes"):
        outline(svg(tmp_path, body.replace('<path d="M70 10 V50"/>', "")))


MARKS = (
    '<g><circle id="electrode-{}" cx="10" cy="30" r="1"/><circle id="electrode-{}" cx="40" cy="11"'
    ' r="1"/>'
    + '<circle id="electrode-{}" cx="70" cy="30" r="1"/><circle id="electrode-{}" cx="40" cy="49"'
    ' r="1"/></g>'
)


def test_marks_are_numbered_by_their_ids(tmp_path):
    """The marks are drawn left, top, right and bottom. Their ids determine electrode 0 and the
    direction, and 10 comes after 9."""
    skin = described(tmp_path, BOX + MARKS.format(2, 9, 10, 11), electrodes='marked = "electrode"')
    assert_centres(skin, [(10, 50), (40, 70), (70, 50), (40, 30)])
    assert skin.electrodes.clockwise and skin.electrodes.count == 4
    skin = described(tmp_path, BOX + MARKS.format(3, 2, 1, 0), electrodes='marked = "electrode"')
    assert_centres(skin, [(40, 30), (70, 50), (40, 70), (10, 50)])
    assert not skin.electrodes.clockwise
    assert skin_from_table(skin_to_table(skin), "again") == skin


def test_marks_without_numbers_lie_along_the_rim(tmp_path):
    body = BOX + MARKS.format(0, 1, 2, 3).replace('id="electrode-', 'class="e" name="')
    skin = described(
        tmp_path, body, electrodes='marked = "e"\nstart_angle_deg = 0\ndirection = "clockwise"'
    )
    assert_centres(skin, [(70, 50), (40, 30), (10, 50), (40, 70)])


@pytest.mark.parametrize(
    ("electrodes", "wanted"),
    [
        ("points_mm = [[40, 72], [8, 50], [40, 29], [70, 50]]",
         [(40, 70), (10, 50), (40, 30), (70, 50)]),
        ("fractions = [0.0, 0.25, 0.5, 0.75]\nstart_angle_deg = 90",
         [(40, 70), (10, 50), (40, 30), (70, 50)]),
    ],
    ids=["points", "fractions"],
)  # fmt: skip
def test_places_on_a_drawings_rim(tmp_path, electrodes, wanted):
    assert_centres(described(tmp_path, BOX, electrodes=electrodes), wanted)


def test_points_on_a_disks_rim(tmp_path):
    path = tmp_path / "disk.toml"
    points = "[[0, 52], [-50, 0], [0, -50], [49, 0]]"
    path.write_text(f"[skin]\ndiameter_mm = 100\n[electrodes]\npoints_mm = {points}\n")
    assert_centres(load_skin(path)[0], [(0, 50), (-50, 0), (0, -50), (50, 0)])


def dxf(folder: Path, units: int = 4) -> tuple[ezdxf.document.Drawing, Path]:
    document = ezdxf.new("R2000", units=units)
    return document, folder / "a.dxf"


@pytest.mark.parametrize(
    ("units", "scale_mm", "width_mm"),
    [(4, None, 60), (5, None, 600), (1, None, 1524), (0, 2.0, 120)],
)
def test_dxf_units(tmp_path, units, scale_mm, width_mm):
    document, path = dxf(tmp_path, units)
    document.modelspace().add_lwpolyline([(0, 0), (60, 0), (60, 40), (0, 40)], close=True)
    document.saveas(path)
    shape = read_drawing(path, DrawingReading(scale_mm)).outline()
    assert shape.bounding_box_mm == pytest.approx((0, 0, width_mm, width_mm * 2 / 3))


def test_dxf_pieces_blocks_and_layers(tmp_path):
    document, path = dxf(tmp_path)
    block = document.blocks.new("stadium")
    block.add_line((0, 0), (100, 0), {"layer": "rim"})
    block.add_arc((100, 30), 30, -90, 90, dxfattribs={"layer": "rim"})
    block.add_line((100, 60), (0, 60), {"layer": "rim"})
    block.add_arc((0, 30), 30, 90, 270, dxfattribs={"layer": "rim"})
    space = document.modelspace()
    space.add_blockref("stadium", (5, 7))
    space.add_circle((50, 40), 4, {"layer": "notes"})
    for x, y in ((5, 7), (105, 7), (105, 67), (5, 67)):
        space.add_point((x, y), {"layer": "contacts"})
    document.saveas(path)
    drawing = read_drawing(path, DrawingReading())
    shape = drawing.outline("rim", "contacts")
    assert shape.area_mm2 == pytest.approx(6000 + math.pi * 900, rel=2e-3)
    assert shape.bounding_box_mm == pytest.approx((-25, 7, 135, 67), abs=0.1)
    assert len(drawing.marked("contacts")) == 4
    said = r"2 closed outlines; name one with element = \.\.\.; names in it are: notes, rim"
    with pytest.raises(GeometryError, match=said):
        drawing.outline()


@pytest.mark.parametrize(
    ("body", "skin", "electrodes", "head", "error", "message"),
    [
        ("", "", "", MM, ConfigError, "nothing is drawn in it"),
        ('<path d="M10 10 H70 V50"/>', "", "", MM, GeometryError,
         "no closed outline among 1 shapes"),
        (BOX + BOX.replace("skin", "other"), "", "", MM, GeometryError,
         "2 closed outlines; .* other, skin"),
        (BOX, 'element = "rim"', "", MM, ConfigError,
         "nothing is named 'rim'; names in it are: skin"),
        (BOX, "", "", 'width="100" height="80"', ConfigError, "no unit such as mm; give scale_mm"),
        (BOX, "", "", 'width="100mm" height="90mm" viewBox="0 0 100 80"', ConfigError,
         "by 1 and 1.125 mm a unit"),
        (BOX, "", "", 'width="100mm" viewBox="0 0 100"', ConfigError, "viewBox = '0 0 100'"),
        ('<path d="M10 10 L70 50 V10 L10 50 Z"/>', "", "", MM, GeometryError,
         "crosses or touches itself"),
        (BOX, "scale_mm = -1", "", MM, ConfigError, "scale_mm = -1 is out of range"),
        (BOX, "tolerance_mm = 0", "", MM, ConfigError, "tolerance_mm = 0 is out of range"),
        (BOX, "", 'marked = "e"', MM, ConfigError, "nothing is marked 'e'"),
        (BOX, "", "marked = 3", MM, ConfigError, "marked must be a word"),
        (BOX, "", "points_mm = [[40, 80], [10, 50], [40, 30], [70, 50]]", MM, GeometryError,
         "electrode 0 .* is 10 mm from the"),
        (BOX, "", "points_mm = [[40, 70], [40, 30], [10, 50], [70, 50]]", MM, GeometryError,
         "not in order along the rim; give"),
        (BOX, "", "points_mm = [[40, 70], [39, 70], [10, 50], [70, 50]]", MM, GeometryError,
         "0 and 1 .* overlap"),
        (BOX, "", "points_mm = []", MM, ConfigError, "points_mm is empty"),
        (BOX, "", "fractions = [0, 0.2, 0.4, 1.2]", MM, GeometryError, "fraction 3 .* is 1.2"),
        (BOX, "", "count = 5\nfractions = [0, 0.2, 0.4, 0.6]", MM, GeometryError,
         "4 entries for 5 electrodes"),
        (BOX, "", "fractions = [0, 0.2]\npositions_mm = [0, 9]", MM, ConfigError, "both say where"),
        (BOX, "", "snap_mm = 2", MM, ConfigError, "snap_mm goes with"),
        (BOX + MARKS.format(1, 1, 2, 3), "", "marked = 'electrode'", MM, GeometryError,
         "two marks are numbered 1"),
        ('<g id="a"><use href="#a"/></g>', "", "", MM, ConfigError,
         "within each other, over 100 deep"),
        ("<g>" * 2000 + "</g>" * 2000, "", "", MM, ConfigError, "within each other, over 100 deep"),
    ],
)  # fmt: skip
def test_refused(tmp_path, body, skin, electrodes, head, error, message):
    with pytest.raises(error, match=message) as caught:
        described(tmp_path, body, skin, electrodes, head)
    text = str(caught.value)
    assert "\n" not in text and ("a.svg" in text or "skin.toml" in text)


def test_copies_of_copies_are_refused_at_once(tmp_path):
    body = '<path id="c0" d="M0 0h9v9z"/>' + "".join(
        f'<g id="c{k + 1}">{f"""<use href="#c{k}"/>""" * 10}</g>' for k in range(12)
    )
    with pytest.raises(ConfigError, match="over 20000 elements"):
        read_drawing(svg(tmp_path, body), DrawingReading())


def test_other_refusals(tmp_path):
    (tmp_path / "a.png").write_bytes(b"")
    (tmp_path / "b.svg").write_bytes(b"<html/>")
    document, path = dxf(tmp_path, 0)
    document.modelspace().add_circle((0, 0), 30)
    document.saveas(path)
    for name, error, message in (
        ("none.svg", FileError, "no such drawing"),
        ("a.png", ConfigError, r"must be \.svg or \.dxf"),
        ("b.svg", ConfigError, "not an SVG drawing but <html>"),
        ("a.dxf", ConfigError, r"\$INSUNITS = 0 is not a unit of length; give scale_mm"),
    ):
        with pytest.raises(error, match=message):
            read_drawing(tmp_path / name, DrawingReading())
    with pytest.raises(ConfigError, match="only a skin description's file names a drawing"):
        skin_from_table({"skin": {"outline": "a.svg"}}, "a model")
    with pytest.raises(ConfigError, match="goes with outline"):
        skin_from_table({"skin": {"diameter_mm": 100, "element": "rim"}}, "here")


@pytest.mark.parametrize(
    ("name", "library"), [("drawing_svg", "svgelements"), ("drawing_dxf", "ezdxf")]
)
def test_an_absent_library_is_named(monkeypatch, tmp_path, name, library):
    path = tmp_path / ("a.svg" if library == "svgelements" else "a.dxf")
    path.write_text("x")
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, f"eitskin.skin.{name}", raising=False)
    with pytest.raises(MissingExtraError, match=rf"needs {library}, .*eitskin\[drawing\]"):
        read_drawing(path, DrawingReading())


def test_a_model_does_not_need_the_drawing(tmp_path):
    skin = described(tmp_path, BOX)
    settings = BuildSettings(rank=5, pixels_across=8, elements=300, samples=0)
    model = build_model(skin, adjacent(8), settings)
    (tmp_path / "a.svg").unlink()
    assert decode_model(encode_model(model), "model").skin == skin
