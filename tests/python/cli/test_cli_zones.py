"""Zones files: read, and refused in a line."""

from pathlib import Path

import pytest

from eitskin.errors import EitskinError
from eitskin.public import stream
from eitskin.session.zones import load_zones, refuse_off_skin
from small_models import prebuilt

PAD = '[[pad]]\nname = "{}"\nx_mm = {}\ny_mm = 0\nradius_mm = {}\n'
KEY = '[[key]]\nname = "{}"\ncorners_mm = {}\n'
RING = '[[ring]]\nname = "{}"\nx_mm = 0\ny_mm = 0\ninner_mm = {}\nouter_mm = {}\n'
SQUARE = "[[0, 0], [20, 0], [20, 20], [0, 20]]"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "zones.toml"
    path.write_text(text)
    return path


def test_zones_may_touch_and_lie_in_a_rings_hole(tmp_path):
    text = KEY.format("a", SQUARE) + KEY.format("b", "[[20, 0], [40, 0], [40, 20], [20, 20]]")
    text += RING.format("volume", 60, 80) + PAD.format("left", -30, 20)
    assert [zone.name for zone in load_zones(written(tmp_path, text))] == [
        "a", "b", "left", "volume",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (PAD.format("a", 0, 20) + PAD.format("b", 30, 20), "'a' and 'b' cross"),
        (PAD.format("a", 0, 20) + PAD.format("b", 5, 5), "'a' and 'b' cross"),
        (PAD.format("a", 0, 20) + PAD.format("b", 0, 20), "'a' and 'b' cross"),
        (KEY.format("a", SQUARE) + KEY.format("b", SQUARE), "'a' and 'b' cross"),
        (RING.format("r", 30, 50) + PAD.format("p", 40, 5), "cross"),
        (RING.format("r", 30, 50) + RING.format("s", 40, 60), "cross"),
        (PAD.format("a", 0, 5) + PAD.format("a", 50, 5), "'a' comes twice"),
        (KEY.format("a", "[[0, 0], [1, 0]]"), "3 to 64 corners"),
        (KEY.format("a", '[[0, 0], [1, 0], ["x", 3]]'), "3 to 64 corners"),
        (KEY.format("a", "[[0, 0], [20, 20], [20, 0], [0, 20]]"), "cross"),
        (RING.format("r", 30, 20), "inner_mm = 30 must be below outer_mm = 20"),
        (PAD.format("a", "nan", 5), "x_mm"),
        (PAD.format("a", 0, -5), "radius_mm"),
        (PAD.format("", 0, 5), "name must be"),
        ('[[pads]]\nname = "a"\n', "did you mean 'pad'"),
        ('[pad]\nname = "a"\n', "[[pad]]"),
        ('[[pad]]\nname = "a"\nsize = 3\n', "unknown key 'size'"),
        ("", "has 0 zones"),
        ("".join(PAD.format(k, 3 * k, 1) for k in range(65)), "has 65 zones"),
        ("[[pad", "not valid TOML"),
    ],
)
def test_a_zones_file_that_cannot_be_is_refused_in_a_line(tmp_path, text, says):
    with pytest.raises(EitskinError) as error:
        load_zones(written(tmp_path, text))
    assert says in str(error.value) and "\n" not in str(error.value)
    assert "zones.toml" in str(error.value)


@pytest.mark.parametrize(
    ("text", "off"),
    [
        (PAD.format("a", 120, 5), True),
        (PAD.format("a", 120, 40), False),  # a part of it is on the skin
        (PAD.format("a", 0, 0.5), False),  # smaller than a pixel
        (RING.format("r", 150, 160), True),
        (RING.format("r", 80, 160), False),
        (RING.format("r", 95, 160), False),  # no pixel's centre is in it
        (KEY.format("k", "[[-900, 0], [-800, 0], [-800, 9]]"), True),
        (KEY.format("k", "[[-900, -900], [900, -900], [0, 900]]"), False),  # around the skin
    ],
)
def test_a_zone_that_no_finger_can_press_is_refused(tmp_path, text, off):
    zones = load_zones(written(tmp_path, text))
    if not off:
        refuse_off_skin(zones, prebuilt()[0].grid)
        return
    with pytest.raises(EitskinError, match="lies off the skin, which goes from x = -9"):
        refuse_off_skin(zones, prebuilt()[0].grid)


def test_no_stream_begins_with_such_a_zone(tmp_path):
    path = written(tmp_path, PAD.format("far", 300, 20))
    with pytest.raises(EitskinError, match="'far': lies off the skin"):
        next(stream("sim:two_touch", zones=path, frames=2))
