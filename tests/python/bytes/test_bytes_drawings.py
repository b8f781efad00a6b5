"""Damaged SVG and DXF files: an outline, or a refusal of one line."""

from pathlib import Path

import pytest
from bytes_damage import ODD_BYTES, any_bytes, bounded, read_or_refuse, written
from hypothesis import given

from eitskin.skin.drawing import read_drawing
from eitskin.skin.drawing_shapes import DrawingReading
from eitskin.skin.outline import polygon

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
HAND, FOREARM = ((EXAMPLES / name).read_bytes() for name in ("hand.svg", "forearm.dxf"))
CURVES = b"""<svg width="9cm" height="9cm" viewBox="0 0 90 90">
<g transform="rotate(9) translate(2,3)">
<path id="a" d="m10,10 c20-5 30 5 40 0 q9,9 0 20 t-5 9 a9 5 30 1 0 -20 4 z"/></g>
<use href="#a" x="3"/>
<rect x="1" y="2" width="30" height="20" rx="4"/><polygon points="1,2 30,4 5,60"/></svg>"""
MORE = b'nan 1e999 -1 " < /> &#0; A z'.split()
WORDS = (*ODD_BYTES, *MORE, b"matrix(0 0 0 0 0 0)", b"9" * 400)


@pytest.mark.parametrize("scale_mm", [None, 1.0])
@given(content=any_bytes([HAND, CURVES], WORDS))
@bounded(150)
def test_any_svg_is_read_or_refused_in_a_line(tmp_path, scale_mm, content):
    _read(written(tmp_path, "a.svg", content), scale_mm)


@given(content=any_bytes([FOREARM, FOREARM.replace(b"LWPOLYLINE", b"SPLINE")], WORDS))
@bounded(80)
def test_any_dxf_is_read_or_refused_in_a_line(tmp_path, content):
    _read(written(tmp_path, "a.dxf", content), 1.0)


def _read(path: Path, scale_mm: float | None) -> None:
    drawing = read_or_refuse(read_drawing, path, DrawingReading(scale_mm))
    if drawing is not None:
        for element in (None, "skin", "a"):
            outline = read_or_refuse(drawing.outline, element)
            if outline is not None:
                assert polygon(outline.vertices_mm) == outline
