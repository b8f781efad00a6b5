"""Skins of other shapes than a disk: a strip, a small pad, an L and an open ring. The doctor finds
nothing, a press raises no diagnostic, and its place is found. The rank follows the electrodes."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.frames.doctor import examine, subject_from_frames
from eitskin.model.build import BuildSettings, build_model, default_rank
from eitskin.scene.description import load_scene
from eitskin.scene.library_scenes import find_scene
from eitskin.scene.runner import run_scene
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import load_skin, paper_skin
from eitskin.solve.reconstructor import Reconstructor

ARC = np.linspace(np.radians(30), np.radians(330), 24)
RING = [(60 * np.cos(a), 60 * np.sin(a)) for a in ARC]
RING += [(40 * np.cos(a), 40 * np.sin(a)) for a in ARC[::-1]]
SHAPES = {
    "strip": ([(0, 0), (400, 0), (400, 20), (0, 20)], (148, 9), 4.0, 1.0),
    "pad": ([(0, 0), (20, 0), (20, 20), (0, 20)], (13, 8), 2.0, 0.5),
    "L": ([(0, 0), (120, 0), (120, 30), (30, 30), (30, 120), (0, 120)], (80, 14), 5.0, 1.5),
    "open ring": (RING, (-50, 3), 4.0, 1.5),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_press_on_a_skin_of_another_shape(tmp_path, shape):
    outline, place, radius, within_mm = SHAPES[shape]
    width = 3.0 if shape != "pad" else 1.5
    points = ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in outline)
    (tmp_path / "skin.toml").write_text(
        f'[skin]\nname = "s"\npolygon_mm = [{points}]\nthickness_mm = 2.0\n'
        f"[electrodes]\ncount = 16\nwidth_mm = {width}\n"
    )
    (tmp_path / "press.toml").write_text(
        '[scene]\nskin = "skin.toml"\nframes = 2\nquiet_frames = 8\n'
        f"[[touch]]\nradius_mm = {radius}\nx_mm = {place[0]}\ny_mm = {place[1]}\n"
        "[effects.noise]\nsnr_db = 60.0\n"
    )
    skin, protocol = load_skin(tmp_path / "skin.toml")
    frames = run_scene(load_scene(tmp_path / "press.toml"))
    report = examine(subject_from_frames(frames, skin))
    assert not [one for one in report.findings if one.name in ("unit", "channel-gain")]
    assert report.healthy
    model = build_model(skin, protocol, BuildSettings(samples=0))
    solver = Reconstructor(model)
    solver.tare(frames.reference_voltage_v)
    for frame in frames.voltage_v:
        result = solver.reconstruct(frame)
        assert not result.info.found
        found = [(touch.x_mm, touch.y_mm) for touch in result.touches]
        assert len(found) == 1 and np.hypot(*np.subtract(found[0], place)) < within_mm


@pytest.mark.parametrize(
    ("electrodes", "rows", "rank"), [(8, 20, 20), (16, 104, 64), (24, 252, 96), (32, 464, 128)]
)
def test_the_default_rank_follows_the_electrodes(electrodes, rows, rank):
    assert default_rank(electrodes, (rows, rows, 812)) == rank


def test_32_electrodes_have_no_model_mismatch():
    skin = replace(paper_skin(), electrodes=Electrodes(count=32, width_mm=4.0))
    protocol = adjacent(32)
    frames = run_scene(replace(find_scene("two_touch"), skin=skin, protocol=protocol, frames=2))
    solver = Reconstructor(build_model(skin, protocol, BuildSettings(samples=0)))
    solver.tare(frames.reference_voltage_v)
    result = solver.reconstruct(frames.voltage_v[0])
    assert len(result.touches) == 2 and not result.info.found
