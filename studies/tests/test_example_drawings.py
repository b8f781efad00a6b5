"""The drawings of ``examples/`` are what ``eitskin draw examples`` draws, and give the shapes that
they were drawn from."""

import io
from pathlib import Path

import ezdxf
import numpy as np
import pytest

from eitskin.errors import GeometryError
from eitskin.skin.drawing import read_drawing
from eitskin.skin.drawing_shapes import DrawingReading
from eitskin.skin.skin import load_skin
from eitskin_studies.experiments.shapes.example_drawings import (
    forearm_corners,
    hand_corners,
    hand_places_mm,
    hand_svg,
    write_drawings,
)
from eitskin_studies.experiments.shapes.rounded import Corner, as_outline

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_examples_are_what_the_command_draws(tmp_path):
    write_drawings(tmp_path)
    assert (tmp_path / "hand.svg").read_text() == (EXAMPLES / "hand.svg").read_text() == hand_svg()
    drawn, kept = (
        read_drawing(folder / "forearm.dxf", DrawingReading()).outline("skin")
        for folder in (tmp_path, EXAMPLES)
    )
    np.testing.assert_allclose(drawn.vertices_mm, kept.vertices_mm, atol=1e-9)


def test_dxf_bytes_are_the_same_in_two_runs(tmp_path):
    texts = []
    for _ in range(2):
        write_drawings(tmp_path)
        texts.append((tmp_path / "forearm.dxf").read_bytes())
    assert texts[0] == texts[1]
    assert ezdxf.read(io.StringIO(texts[0].decode())).modelspace()


def test_drawings_give_the_shapes_that_they_were_drawn_from():
    for name, corners in (("hand", hand_corners()), ("forearm", forearm_corners())):
        skin, _ = load_skin(EXAMPLES / f"{name}.toml")
        assert skin.outline.area_mm2 == pytest.approx(as_outline(corners).area_mm2, rel=1e-3)
        if name == "hand":
            np.testing.assert_allclose(skin.electrode_centres_mm(), hand_places_mm(), atol=0.3)
    with pytest.raises(GeometryError, match="the side after corner 0"):
        as_outline([Corner(0, 0, 9), Corner(10, 0, 9), Corner(10, 10, 9), Corner(0, 10, 9)])
