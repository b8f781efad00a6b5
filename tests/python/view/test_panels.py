"""Pictures whose titles, labels and legends are whole: one, two or twelve frames of a disk, a long
rectangle and a hand, with long names."""

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk, polygon
from eitskin.skin.skin import Skin, load_skin
from eitskin.view.panel_texts import wrapped
from eitskin.view.panels import frame_figure, panels_figure, save_picture
from eitskin.view.pictures import Mark, Panel

HAND = Path(__file__).parents[3] / "examples" / "hand.toml"
LONG = "a recording of the second morning, electrode 5 loose, $x_1$, by the window"
NOTE = "the first 36 of 1200 frames; " * 4


BAND = polygon([(0, 0), (400, 0), (400, 40), (0, 40)])
SKINS = {
    "disk": Skin("disk", disk(194.0), Electrodes(16)),
    "long": Skin("long", BAND, Electrodes(16, 4.0)),
    "hand": load_skin(HAND)[0],
}


def panels(skin: Skin, count: int) -> list[Panel]:
    grid = grid_for(skin.outline)
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    values = np.exp(-((grid.centres_mm() - (x, y)) ** 2).sum(axis=1) / 150)
    found = Mark(x + 2, y, 8.0, place_mm2=(3.0, 1.0, 3.0))
    names = (f"{LONG} {k}\nMIoU 0.83, touches 0.91" for k in range(count))
    return [Panel(name, values, (Mark(x, y, 9.0),), (found,)) for name in names]


def boxes(figure: Any) -> dict[str, Any]:
    """Every text that is seen, with its box in pixels."""
    from matplotlib.text import Text

    figure.draw_without_rendering()
    unseen = set()  # ticks beyond their axes, and all of axes that are switched off
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in axis.get_major_ticks():
                if not axes.axison or not low <= tick.get_loc() <= high:
                    unseen |= {tick.label1, tick.label2}
            if not axes.axison:
                unseen.add(axis.label)
    texts = [one for one in figure.findobj(Text) if one.get_visible() and one not in unseen]
    return {
        f"{one.get_text()} {k}": one.get_window_extent()
        for k, one in enumerate(texts)
        if one.get_text().strip()
    }


def assert_whole(figure: Any) -> None:
    width, height = figure.get_size_inches() * figure.dpi
    placed = boxes(figure)
    assert len(placed) >= 4
    for text, box in placed.items():
        inside = box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height
        assert inside, f"{text!r} lies outside: {box}"
    outside = [one for one in placed.items() if len(one[0]) > 8]  # no electrode, no tick
    for (first, a), (second, b) in combinations(outside, 2):
        over = min(a.x1, b.x1) - max(a.x0, b.x0) > 1 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1
        assert not over, f"{first!r} lies on {second!r}"


@pytest.mark.parametrize("name", SKINS)
@pytest.mark.parametrize(
    "count", (1, pytest.param(2, marks=pytest.mark.long("1 and 12 panels")), 12)
)
def test_every_text_is_whole(name, count):
    skin, given = SKINS[name], panels(SKINS[name], count)
    grid = grid_for(skin.outline)
    figure = panels_figure(skin, grid, given, title=LONG, note=NOTE, legend=True)
    assert_whole(figure)
    width, height = figure.get_size_inches()
    assert width < 16 and height < 16
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    box = figure.axes[0].get_position().bounds * np.tile(figure.get_size_inches(), 2)
    small = count > 2
    margin = 2 * (0.03 if small else 0.10) * max(x1 - x0, y1 - y0)
    assert box[2] / box[3] == pytest.approx((x1 - x0 + margin) / (y1 - y0 + margin), rel=0.01)


@pytest.mark.parametrize("name", SKINS)
def test_one_frame_at_large_is_whole(name):
    skin = SKINS[name]
    panel = panels(skin, 1)[0]
    seen = {"truth": panel.truth, "found": panel.found, "title": LONG}
    assert_whole(frame_figure(skin, grid_for(skin.outline), panel.values, **seen))


def test_words_that_are_too_long_are_cut():
    assert "".join(wrapped("W" * 300, 2.0, 8)) == "W" * 300
    assert len(wrapped("W" * 300, 2.0, 8)) > 8
    assert wrapped("one two\nthree", 5.0, 8) == ["one two", "three"]


@pytest.mark.parametrize(
    ("name", "begins"), [("a.png", b"\x89PNG"), ("a.svg", b"<?xml"), ("a.PDF", b"%PDF")]
)
def test_the_suffix_says_the_format(tmp_path, name, begins):
    skin = SKINS["disk"]
    written = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        figure = panels_figure(skin, grid_for(skin.outline), [Panel("a")])
        save_picture(figure, tmp_path / folder / name)
        written.append((tmp_path / folder / name).read_bytes())
    assert written[0] == written[1] and written[0].startswith(begins)
    for bad in ("a.txt", "a"):
        with pytest.raises(UsageError, match=r"use \.png, \.svg, \.pdf"):
            save_picture(figure, tmp_path / bad)


@pytest.mark.parametrize("kind", ("webp", "gif"))
def test_a_film_of_frames(tmp_path, kind):
    from PIL import Image

    from eitskin.view.film import MAX_FRAMES, draw_film, thinned
    from small_models import small_model

    model = small_model()
    values = np.zeros(model.grid.n_pixels)
    few = [Panel(f"frame {k}", np.roll(np.r_[1.0, values[1:]], 9 * k)) for k in range(3)]
    draw_film(tmp_path / f"f.{kind}", model, few, [0.0, 0.1, 5.0])
    with Image.open(tmp_path / f"f.{kind}") as film:
        assert film.n_frames == 3 and film.size[0] > 200
        durations = []
        for k in range(3):
            film.seek(k)
            film.load()
            durations.append(film.info["duration"])
    assert durations == [100, 2000, 2000]
    kept = thinned(10 * MAX_FRAMES + 7)
    assert len(kept) == MAX_FRAMES and (kept[0], kept[-1]) == (0, 10 * MAX_FRAMES + 6)
    with pytest.raises(UsageError, match=r"'\.mp4' is not a format of a film; use \.webp, \.gif"):
        draw_film(tmp_path / "f.mp4", model, few, [0.0, 0.1, 5.0])
