"""The container of a skin: its measures from the description, its STL by OpenSCAD, its drawings."""

import math

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk, polygon
from eitskin.skin.skin import Skin, load_skin, paper_skin
from eitskin_hardware import make
from eitskin_hardware.container.container import (
    ContainerError,
    container_of,
    is_closed,
    make_stl,
    triangles,
    volume_mm3,
    write_scad,
)
from eitskin_hardware.container.drawing import draw_measures, draw_wires

RECTANGLE = load_skin(make.RECTANGLE)[0]


def dish_volume(container, perimeter_mm, area_mm2):
    """Floor and wall, round corners of the wall included, without holes and notch."""
    wall = perimeter_mm * container.wall_mm + math.pi * container.wall_mm**2
    floor = (area_mm2 + wall) * container.floor_mm
    holes = len(container.holes_mm) * math.pi * container.hole_mm**2 / 4 * container.wall_mm
    return floor + wall * (container.height_mm - container.floor_mm) - holes


PAPER = pytest.param(paper_skin(), marks=pytest.mark.long("the rectangle"), id="paper")


@pytest.mark.parametrize("skin", [PAPER, pytest.param(RECTANGLE, id="rectangle")])
def test_the_dish_is_a_closed_body_of_the_right_volume(tmp_path, skin):
    container = container_of(skin)
    write_scad(container, tmp_path)
    faces = triangles(make_stl(tmp_path, "dish"))
    assert is_closed(faces)
    expected = dish_volume(container, skin.outline.perimeter_mm, skin.outline.area_mm2)
    assert volume_mm3(faces) == pytest.approx(expected, rel=0.01)
    size = np.ptp(faces.reshape(-1, 3), axis=0)
    low_x, low_y, high_x, high_y = skin.outline.bounding_box_mm
    assert size[:2] == pytest.approx([high_x - low_x + 8, high_y - low_y + 8], abs=0.2)
    assert size[2] == pytest.approx(24.0)


def test_the_papers_dish_has_its_sixteen_holes():
    container = container_of(paper_skin())
    x, y, angle = container.holes_mm.T
    assert np.hypot(x, y) == pytest.approx(np.full(16, 97.0))
    assert np.cos(np.radians(angle)) == pytest.approx(x / 97.0)
    assert np.sin(np.radians(angle)) == pytest.approx(y / 97.0)
    assert (x[0], y[0]) == pytest.approx((0.0, 97.0)) and container.hole_mm == 4.0


def test_holes_of_a_rectangle_point_out_of_their_side():
    container = container_of(RECTANGLE)
    for x, y, angle in container.holes_mm:
        turn = math.radians(angle)
        ahead = (x + math.cos(turn), y + math.sin(turn))
        behind = (x - math.cos(turn), y - math.sin(turn))
        assert not RECTANGLE.outline.contains([ahead])[0]
        assert RECTANGLE.outline.contains([behind])[0]


def test_the_jig_fits_around_the_dish(tmp_path):
    container = container_of(RECTANGLE)
    write_scad(container, tmp_path)
    faces = triangles(make_stl(tmp_path, "jig"))
    assert is_closed(faces)
    corners = np.abs(faces.reshape(-1, 3)[:, :2])
    inside = container.wall_mm + container.clearance_mm
    assert (corners[corners[:, 1] < 40, 0] >= 80 + inside - 0.01).all()


SQUARE = polygon([[0, 0], [100, 0], [100, 100], [0, 100]])
REFUSED = {
    "a foil": (Skin("foil", SQUARE, Electrodes(8), thickness_mm=0.1), "clamp tape"),
    "posts too close": (Skin("tiny", disk(40.0), Electrodes(16)), "washers"),
}  # fmt: skip


@pytest.mark.parametrize(("skin", "says"), REFUSED.values(), ids=REFUSED)
def test_a_skin_that_holds_no_posts_is_refused(skin, says):
    with pytest.raises(ContainerError, match=says):
        container_of(skin)


def test_a_missing_openscad_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    write_scad(container_of(RECTANGLE), tmp_path)
    with pytest.raises(ContainerError, match="apt-get install openscad"):
        make_stl(tmp_path, "dish")


def test_drawings_repeat_and_name_each_wire(tmp_path):
    container = container_of(paper_skin())
    for draw in (draw_measures, draw_wires):
        draw(container, tmp_path / "a.svg")
        draw(container, tmp_path / "b.svg")
        assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert all(f">J2-{2 * k + 1}<" in text for k in range(16))


def test_the_command(tmp_path, capsys):
    assert main(["hardware", "container", "--paper", "-o", str(tmp_path)]) == 0
    assert "measures.svg" in capsys.readouterr().out
    assert main(["hardware", "container", "-o", str(tmp_path)]) == 2
    assert "give either" in capsys.readouterr().err
