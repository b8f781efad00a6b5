"""Pictures: that they are drawn, repeat byte for byte, and show what they are given."""

from pathlib import Path

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.fem.grid import Grid, grid_for
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import polygon
from eitskin.skin.skin import Skin, paper_skin
from eitskin.view import pictures
from eitskin.view.panels import draw_frame, draw_panels, save_picture
from eitskin.view.pictures import Mark, Panel, found_mark

SKIN = paper_skin()
GRID = grid_for(SKIN.outline)


def read(path: Path) -> np.ndarray:
    from matplotlib.image import imread

    return np.asarray(imread(path)[..., :3])


def blob(grid: Grid, x: float, y: float) -> np.ndarray:
    return np.exp(-((grid.centres_mm() - (x, y)) ** 2).sum(axis=1) / 150)


def test_a_frame_is_drawn_and_repeats_byte_for_byte(tmp_path):
    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for file in files:
        truth, found = [Mark(30, 20, 9, 0.05)], [Mark(31, 20)]
        drawn = {"truth": truth, "found": found, "title": "one touch"}
        draw_frame(file, SKIN, GRID, blob(GRID, 30, 20), **drawn)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert files[0].read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    height, width, _ = read(files[0]).shape
    assert width > 2 * height > 800
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png"]


def test_red_is_where_the_change_is(tmp_path):
    """The image panel drawn alone: the reddest place has the blob's coordinates, the bluest those
    of its negative."""
    matplotlib = pictures.load_matplotlib()
    for sign, channel in ((1, 0), (-1, 2)):
        figure = matplotlib.figure.Figure(figsize=(4, 4), dpi=100)
        axes = figure.add_axes((0, 0, 1, 1))
        pictures.draw_panel(axes, SKIN, GRID, Panel("", sign * blob(GRID, -40, 55)))
        save_picture(figure, tmp_path / "one.png")
        pixels = read(tmp_path / "one.png")[::-1]
        excess = pixels[..., channel] - np.delete(pixels, channel, axis=2).max(axis=2)
        strong = np.argwhere(excess > 0.5 * excess.max()) / pixels.shape[:2]
        x0, x1 = axes.get_xlim()
        y0, y1 = axes.get_ylim()
        y, x = strong.mean(axis=0)
        assert (x0 + x * (x1 - x0), y0 + y * (y1 - y0)) == pytest.approx((-40, 55), abs=4)


def test_electrodes_are_numbered_from_0_outside_the_rim():
    ell = polygon([(0, 0), (120, 0), (120, 50), (50, 50), (50, 120), (0, 120)])
    skin = Skin("ell", ell, Electrodes(count=12))
    axes = pictures.load_matplotlib().figure.Figure().add_subplot()
    pictures.draw_panel(axes, skin, grid_for(skin.outline), Panel("ell"))
    texts = {text.get_text(): text.get_position() for text in axes.texts}
    assert sorted(texts, key=int) == [str(k) for k in range(12)]
    places = np.array([texts[str(k)] for k in range(12)])
    assert not skin.outline.contains(places).any()
    assert np.hypot(*(places - skin.electrode_centres_mm()).T) == pytest.approx(0.055 * 120)


def test_frame_without_truth_has_two_panels_and_units(tmp_path):
    flat = np.zeros(GRID.n_pixels)
    draw_frame(tmp_path / "two.png", SKIN, GRID, flat, unit="mS/m")
    draw_frame(tmp_path / "three.png", SKIN, GRID, flat, truth=[Mark(0, 0, 9, 1.0)])
    assert read(tmp_path / "three.png").shape[1] > 1.3 * read(tmp_path / "two.png").shape[1]


def test_many_panels(tmp_path):
    panels = []
    for x in range(0, 50, 10):
        marks = (Mark(x, 0, 9),), (Mark(x, 1, 8),)
        panels.append(Panel(str(x), blob(GRID, x, 0), *marks))
    draw_panels(tmp_path / "many.png", SKIN, GRID, panels, 3, title="five", note="a note")
    height, width, _ = read(tmp_path / "many.png").shape
    assert 0.7 < height / width < 1.1  # two rows of three, a bar, a note


def test_a_known_place_is_an_ellipse_of_ninety_percent():
    """Turned as the covariance is, and absent where it is not known."""
    from matplotlib.patches import Ellipse

    matplotlib = pictures.load_matplotlib()
    numbers = (1, 30.0, 20.0, 9.0, 5.0, 0.5, 0.0, 0.9)
    for touch, count in ((Touch(*numbers, 2.5, 1.5, 2.5), 1), (Touch(*numbers), 0)):
        axes = matplotlib.figure.Figure().add_subplot()
        panel = Panel("", blob(GRID, 30, 20), found=(found_mark(touch),))
        pictures.draw_panel(axes, SKIN, GRID, panel)
        ellipses = [one for one in axes.patches if type(one) is Ellipse]
        assert len(ellipses) == count
        for one in ellipses:
            assert one.get_width() == pytest.approx(2 * np.sqrt(4.605 * 4))
            assert one.get_height() == pytest.approx(2 * np.sqrt(4.605 * 1))
            assert one.get_angle() % 180 == pytest.approx(45)
