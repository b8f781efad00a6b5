"""``eitskin bench outputs``: parts add up, every contact and frame is counted."""

import pytest

from eitskin.device.open import open_device
from eitskin.scene.description import load_scene
from eitskin_studies.benchmarks import live_view, outputs
from eitskin_studies.harness.sections import fill_marks
from study_pages import page_copy

PARTS = ["scan", "solve", "link", "host", "sink udp", "contact to udp", "sink tuio"]


def test_taps_are_scenes(tmp_path):
    path = tmp_path / "taps.toml"
    path.write_text(outputs._scene([(0.1, 0.2), (0.5, 0.6)], 0.8, 500.0, 1))
    scene = load_scene(path)
    assert (scene.frames, len(scene.touches)) == (400, 2)


def test_the_page_has_the_places(tmp_path):
    counts = [{"url": name, "sent": 9, "dropped": 0, "failed": 0} for name in outputs.SINKS]
    load = outputs.Load(600.0, 28800, counts, 120.0, 120.5, 0.15)
    times = dict.fromkeys([*PARTS, "contact to tuio"], (1.0, 2.0))
    result = outputs.OutputTimes(times, 23, 24, 960, load, "a machine")
    page = page_copy(tmp_path, "outputs")
    fill_marks(page, "outputs", outputs.for_page(result, "eitskin bench outputs"))
    views = live_view.LiveViews((live_view.LiveView(1, 47.0, 0.1, 4, 28.0, 46.0, (110.0, 113.0)),))
    for mark in ("view", "view-load"):
        fill_marks(page, "outputs", live_view.for_page(views, "eitskin bench view", mark))
    text = page.read_text()
    assert text.count("| 28.0 ms | 46.0 ms |") == 2
    assert "23 of 24 contacts" in text and "120.5 MB at the end" in text
    assert "23 of 24 contacts" in outputs.as_text(result)


def test_the_live_pages_scene_is_one_that_a_board_can_scan(tmp_path):
    path = tmp_path / "moving.toml"
    path.write_text(live_view.SCENE)
    with open_device(f"sim:{path}?loop=1") as device:
        assert device.transport.capabilities.scene.rate_hz == pytest.approx(48.0)


@pytest.mark.long("test_the_page_has_the_places, test_a_scene_ends_by_itself; sinks/test_sinks.py")
def test_a_tap_through_everything():
    result = outputs.run(taps=1, seconds=0.5, load_s=1.0, seed=2)
    assert list(result.parts_ms) == [*PARTS, "contact to tuio"]
    assert (result.taps, result.sunk) == (1, 24) and result.load is not None
    low = {name: median for name, (median, _) in result.parts_ms.items()}
    assert low["scan"] + low["solve"] + low["link"] < low["contact to udp"]
    assert 5 < low["scan"] < 65 and 0 < low["host"] < low["scan"]
    frames = result.load.frames
    assert [one["sent"] + one["dropped"] for one in result.load.sinks] == [frames + 1] * 6
    assert pytest.approx(0) == sum(one["failed"] for one in result.load.sinks)
