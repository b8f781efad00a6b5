"""Skins: where electrodes lie, which cannot be, and TOML there and back."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.errors import ConfigError, EitskinError, GeometryError, ProtocolError
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk, polygon
from eitskin.skin.protocol import adjacent, opposite
from eitskin.skin.skin import Skin, load_skin, paper_skin, skin_from_table, skin_to_table

RECTANGLE = polygon([(0, 0), (200, 0), (200, 100), (0, 100)])


def _angles(skin: Skin) -> np.ndarray[Any, Any]:
    x, y = skin.electrode_centres_mm().T
    return np.degrees(np.arctan2(y, x)) % 360


def test_paper_skin():
    skin = paper_skin()
    found = skin.outline.diameter_mm, skin.thickness_mm, skin.conductivity_s_per_m
    assert found == (194, 12, 0.01)
    assert (skin.electrodes.count, skin.electrodes.width_mm) == (16, 4)
    np.testing.assert_allclose(_angles(skin), (90 + np.arange(16) * 22.5) % 360, atol=1e-9)
    spans = skin.electrode_spans_mm()
    np.testing.assert_allclose(spans[:, 1] - spans[:, 0], 4, rtol=1e-12)
    assert (spans[:, 0] >= 0).all() and (spans[:, 0] < skin.outline.perimeter_mm).all()


def test_clockwise_numbering_and_start():
    skin = Skin("tank", disk(280), Electrodes(16, 25, start_angle_deg=90, clockwise=True))
    np.testing.assert_allclose(_angles(skin), (90 - np.arange(16) * 22.5) % 360, atol=1e-9)
    skin = Skin("tank", disk(280), Electrodes(8, 25, start_angle_deg=-450))
    np.testing.assert_allclose(_angles(skin), (270 + np.arange(8) * 45) % 360, atol=1e-9)


def test_kit4_angles(shared_data):
    with np.load(shared_data / "kit4_dev.npz") as data:
        angles = data["electrode_angle_deg"] % 360
    skin = Skin("kit4", disk(280), Electrodes(16, 25, start_angle_deg=90, clockwise=True))
    np.testing.assert_allclose(_angles(skin), angles, atol=1e-9)


def test_positions_along_the_rim():
    places = (0.0, 50.0, 150.0, 350.0)
    for clockwise, centres in (
        (False, [(100, 0), (150, 0), (200, 50), (50, 100)]),
        (True, [(100, 0), (50, 0), (0, 50), (150, 100)]),
    ):
        skin = Skin("r", RECTANGLE, Electrodes(4, 5, 270, clockwise, places))
        np.testing.assert_allclose(skin.electrode_centres_mm(), centres)


def test_evenly_by_arc_length_on_a_polygon():
    skin = Skin("r", RECTANGLE, Electrodes(12, 5, start_angle_deg=0))
    first = [(200, 50), (200, 100), (150, 100), (100, 100)]
    np.testing.assert_allclose(skin.electrode_centres_mm()[:4], first)
    spans = skin.electrode_spans_mm()
    assert sorted(np.round(np.diff(np.sort(spans[:, 0])), 9).tolist()) == [50.0] * 11


@pytest.mark.parametrize(
    ("electrodes", "message"),
    [
        (Electrodes(16, 40), "16 electrodes of 40 mm do not fit"),
        (Electrodes(4, 10, positions_mm=(0.0, 100.0, 105.0, 300.0)),
         r"electrodes 1 and 2 \(from 0\) overlap"),
        (Electrodes(4, 10, positions_mm=(0.0, 100.0, 200.0, 605.0)),
         r"electrodes 0 and 3 \(from 0\) overlap"),
        (Electrodes(4, 10, positions_mm=(0.0, 100.0, 110.2, 300.0)), "gap 0.2 mm, at least 0.5 mm"),
        (Electrodes(4, 1000), "do not fit"),
    ],
)  # fmt: skip
def test_overlap_is_refused(electrodes, message):
    with pytest.raises(GeometryError, match=message):
        Skin("s", disk(194), electrodes)


@pytest.mark.parametrize(
    "arguments",
    [
        {"count": 3},
        {"count": 300},
        {"width_mm": 0.0},
        {"width_mm": float("nan")},
        {"start_angle_deg": float("inf")},
        {"contact_impedance_ohm_m2": -1.0},
        {"count": 4, "positions_mm": (0.0, 1.0, 2.0)},
        {"count": 4, "positions_mm": (0.0, 2.0, 1.0, 3.0)},
        {"count": 4, "positions_mm": (0.0, 2.0, float("nan"), 3.0)},
    ],
)
def test_refused_electrodes(arguments):
    with pytest.raises(GeometryError, match="electrodes: "):
        Electrodes(**arguments)


@pytest.mark.parametrize("key", ["conductivity_s_per_m", "thickness_mm"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_refused_sheet(key, value):
    with pytest.raises(GeometryError, match=key):
        Skin("s", disk(194), Electrodes(), **{key: value})


@pytest.mark.parametrize(
    "skin",
    [
        paper_skin(),
        Skin("tank", disk(280), Electrodes(16, 25, 90, True, None, 0.0), 0.3, 70.0),
        Skin(
            "pad", RECTANGLE, Electrodes(5, 3.5, -12.5, False, (0.0, 9.0, 33.3, 77.0, 400.0), 0.5)
        ),
        Skin(
            "l",
            polygon([(0, 0), (0, 100), (30, 100), (30, 30), (100, 30), (100, 0)]),
            Electrodes(8),
        ),
    ],
    ids=lambda skin: skin.name,
)
def test_table_round_trip(skin):
    assert skin_from_table(skin_to_table(skin), "here") == skin


def _write(folder: Path, text: str) -> Path:
    path = folder / "skin.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_load_the_documented_file(tmp_path):
    text = """
[skin]
name = "paper"
diameter_mm = 194.0
thickness_mm = 12.0
conductivity_s_per_m = 0.01
[electrodes]
count = 16
width_mm = 4.0
start_angle_deg = 90.0
direction = "counterclockwise"
contact_impedance_ohm_m2 = 0.01
[protocol]
kind = "adjacent"
current_a = 0.001
"""
    skin, protocol = load_skin(_write(tmp_path, text))
    assert skin == paper_skin()
    assert protocol.hash == adjacent(16).hash and protocol.current_a == 1e-3


def test_load_with_defaults_and_a_polygon(tmp_path):
    outline = "[skin]\npolygon_mm = [[0, 0], [0, 100], [200, 100], [200, 0]]\n"
    scan = '[protocol]\nkind = "opposite"\ncurrent_a = 0.002\n'
    skin, protocol = load_skin(_write(tmp_path, outline + scan))
    assert skin.electrodes == Electrodes()
    assert skin.outline.area_mm2 == pytest.approx(20000)
    assert protocol.hash == opposite(16).hash and protocol.current_a == 0.002


DISK = "[skin]\ndiameter_mm = 194\n"


CROSSED = "polygon_mm = [[0, 0], [5, 5], [5, 0], [0, 5]]"
REFUSED: dict[type[EitskinError], dict[str, str]] = {
    ConfigError: {
        "[skin]\ndiametre_mm = 3\n": (
            r"\[skin\]: unknown key 'diametre_mm'; did you mean 'diameter_mm'"
        ),
        DISK + "[electrode]\n": "unknown key 'electrode'; did you mean 'electrodes'",
        DISK + "[electrodes]\nwidth = 3\n": "did you mean 'width_mm'",
        DISK + "[protocol]\nknd = 'adjacent'\n": "did you mean 'kind'",
        DISK + "[protocol]\nkind = 'adjacant'\n": "did you mean 'adjacent'",
        DISK + "[electrodes]\ndirection = 'left'\n": "direction = 'left' is not known",
        "[skin]\ndiameter_mm = '194'\n": "diameter_mm must be a number",
        "[skin]\ndiameter_mm = -1\n": "out of range",
        DISK + "thickness_mm = 0\n": "thickness_mm = 0 is out of range",
        DISK + "name = 3\n": "name must be a word",
        "[skin]\nname = 'x'\n": "either diameter_mm or polygon_mm",
        DISK + "polygon_mm = []\n": "either diameter_mm or polygon_mm",
        "[skin]\npolygon_mm = 3\n": "must be a list",
        "[skin]\npolygon_mm = [[0, 0], [1]]\n": r"entry 1 \(from 0\)",
        DISK + "[electrodes]\ncount = 16.5\n": "whole number",
        DISK + "[electrodes]\npositions_mm = [1, 'a']\n": "list of numbers",
        DISK + "[protocol]\nkind = 'skip'\n": "'skip' is required",
        DISK + "[protocol]\nskip = 2\n": 'skip goes with kind = "skip"',
        DISK + "[protocol]\nkind = 'table'\n": "needs table =",
        DISK + "[protocol]\nkind = 'table'\ntable = [[0, 1, 2]]\n": "row 0",
        DISK + "[protocol]\ncurrent_a = 0\n": "current_a = 0 is out of range",
        "skin = 3\n": r"a table \[skin\] is needed",
        "": r"a table \[skin\] is needed",
        "[skin\n": "not valid TOML",
    },
    GeometryError: {
        f"[skin]\n{CROSSED}\n": r"skin\.toml: outline: it crosses",
        "[skin]\ndiameter_mm = 20\n": r"skin\.toml: skin 'skin': 16 electrodes .* do not fit",
        DISK + "[electrodes]\npositions_mm = [1, 2]\n": "2 entries for 16",
    },
    ProtocolError: {
        DISK + "[protocol]\nkind = 'skip'\nskip = 9\n": r"\[protocol\].*to skip-6",
        DISK + "[protocol]\nkind = 'table'\ntable = [[0, 1, 2, 16]]\n": "0 to 15",
    },
}


@pytest.mark.parametrize(
    ("error", "text", "message"),
    [(error, *case) for error, cases in REFUSED.items() for case in cases.items()],
)
def test_refused_files(tmp_path, text, error, message):
    with pytest.raises(error, match=message) as caught:
        load_skin(_write(tmp_path, text))
    assert "\n" not in str(caught.value) and "skin.toml" in str(caught.value)


@pytest.mark.parametrize("name", ["a\ud800", "a\nb", "a\x1b[2J"])
def test_a_name_that_cannot_be_printed_is_refused(name):
    """A lone surrogate can stand in a model's JSON; no file and no terminal can be given it."""
    table = skin_to_table(paper_skin())
    table["skin"]["name"] = name
    with pytest.raises(ConfigError, match="has characters that cannot be printed") as error:
        skin_from_table(table, "x.toml")
    assert str(error.value).isprintable()
