"""The results file: every field, its shape and unit, read without pickle."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from eitskin.core.results import Reconstruction
from eitskin.errors import FileError
from eitskin.frames.results_file import save_results
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt, session

FIELDS = {
    "format", "version", "frame", "frame_name", "image_s_per_m", "pixel_mm", "image_origin_mm",
    "image_is", "solver_image_s_per_m",
    "touch_frame", "touch_id",
    "touch_xy_mm", "touch_radius_mm", "touch_strength_s_per_m_mm2", "touch_explained",
    "touch_force_n", "touch_confidence", "touch_place_mm2", "touch_long_mm", "info",
    "touch_radius_sd_mm",
}  # fmt: skip


@pytest.fixture(scope="module")
def results() -> dict[int, Reconstruction]:
    """Frames 2, 0 and 9, asked for in this order."""
    reconstructor = Reconstructor(prebuilt()[0])
    reconstructor.tare(session().untouched_v)
    return {number: reconstructor.reconstruct(session().frames_v[number]) for number in (2, 0, 9)}


def test_every_field(tmp_path, results):
    path, model = tmp_path / "out.npz", prebuilt()[0]
    save_results(path, model, session().as_frames(), results)
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.npz"]
    with np.load(path, allow_pickle=False) as archive:
        saved = {name: archive[name] for name in archive.files}
    assert set(saved) == FIELDS
    assert (str(saved["format"]), int(saved["version"])) == ("eitskin-results", 2)
    assert saved["frame"].tolist() == [0, 2, 9]
    assert saved["frame_name"].tolist() == ["test-s3-0", "test-s3-2", "test-s3-9"]
    assert saved["image_s_per_m"].shape == saved["solver_image_s_per_m"].shape == (3, 32, 32)
    assert saved["image_is"].tolist() == [results[number].image_is for number in (0, 2, 9)]
    for place, number in enumerate((0, 2, 9)):
        image = saved["image_s_per_m"][place]
        assert (
            image[model.grid.index[:, 1], model.grid.index[:, 0]] == results[number].image
        ).all()
        assert np.isnan(image).sum() == 32 * 32 - 812
        solved = model.grid.values(saved["solver_image_s_per_m"][place])
        assert (solved == results[number].solver_image).all()
    assert float(saved["pixel_mm"]) == pytest.approx(194 / 32)
    assert saved["image_origin_mm"] == pytest.approx([-97, -97])
    touches = [(number, touch) for number in (0, 2, 9) for touch in results[number].touches]
    assert len(touches) >= 3
    assert saved["touch_frame"].tolist() == [number for number, _ in touches]
    assert saved["touch_id"].tolist() == [touch.id for _, touch in touches]
    assert saved["touch_xy_mm"].tolist() == [[touch.x_mm, touch.y_mm] for _, touch in touches]
    for field, name in (
        ("radius_mm",) * 2,
        ("strength_s_per_m_mm2",) * 2,
        ("explained",) * 2,
        ("force_n",) * 2,
    ):
        assert saved[f"touch_{name}"].tolist() == [getattr(touch, field) for _, touch in touches]
    place = [(t.x_variance_mm2, t.xy_covariance_mm2, t.y_variance_mm2) for _, t in touches]
    np.testing.assert_array_equal(saved["touch_place_mm2"], np.array(place, dtype=float))
    long_mm = [(t.long_x_mm or 0, t.long_y_mm or 0) for _, t in touches]
    np.testing.assert_array_equal(saved["touch_long_mm"], np.array(long_mm, dtype=float))
    sd_mm = [touch.radius_sd_mm for _, touch in touches]
    np.testing.assert_array_equal(saved["touch_radius_sd_mm"], np.array(sd_mm, dtype=float))
    known = [touch.confidence for _, touch in touches]
    np.testing.assert_array_equal(saved["touch_confidence"], np.array(known, dtype=float))
    info = json.loads(str(saved["info"]))
    assert [entry["stop"] for entry in info] == ["iterations"] * 3
    assert info[1]["lambda"] == results[2].info.lambda_ and "lambda_" not in info[1]


def test_the_documented_fields_are_the_saved_ones(tmp_path, results):
    """Names and types of the list in docs/reference/frames-format.md, one by one."""
    page = (
        Path(__file__).resolve().parents[3] / "docs" / "reference" / "frames-format.md"
    ).read_text(encoding="utf-8")
    fields = page.split("# The results file")[1].replace("\n  ", " ")
    rows = re.findall(r"^- (`.*?`), ((?:text|float|int)[^:]*):", fields, re.MULTILINE)
    documented = {name: kind for names, kind in rows for name in re.findall(r"`(\w+)`", names)}
    save_results(tmp_path / "out.npz", prebuilt()[0], session().as_frames(), results)
    with np.load(tmp_path / "out.npz") as saved:
        assert set(documented) == set(saved.files) == FIELDS
        for name, kind in documented.items():
            wanted = re.findall(r"float64|int64|int32|text", kind)
            kinds = {"text": "U", "float64": "f8", "int64": "i8", "int32": "i4"}
            assert (
                saved[name].dtype.str[1:].startswith(kinds[wanted[-1 if name == "version" else 0]])
            ), name


def test_a_pixel_lies_where_the_grid_says(tmp_path, results):
    """Row 0 is the lowest y: the peak of the picture, by origin and pixel size, is the peak of the
    pixels."""
    model = prebuilt()[0]
    save_results(tmp_path / "out.npz", model, session().as_frames(), results)
    with np.load(tmp_path / "out.npz") as saved:
        row, column = np.unravel_index(np.nanargmax(saved["image_s_per_m"][0]), (32, 32))
        x, y = saved["image_origin_mm"] + (np.array([column, row]) + 0.5) * saved["pixel_mm"]
    assert (x, y) == pytest.approx(tuple(model.grid.centres_mm()[np.argmax(results[0].image)]))


def test_no_results(tmp_path):
    save_results(tmp_path / "out.npz", prebuilt()[0], session().as_frames(), {})
    with np.load(tmp_path / "out.npz") as saved:
        assert set(saved.files) == FIELDS
        assert saved["image_s_per_m"].shape == (0, 32, 32) and saved["touch_xy_mm"].shape == (0, 2)


def test_frames_without_touches(tmp_path):
    reconstructor = Reconstructor(prebuilt()[0])
    reconstructor.tare(session().untouched_v)
    untouched = {0: reconstructor.reconstruct(session().reference_v)}
    save_results(tmp_path / "out.npz", prebuilt()[0], session().as_frames(), untouched)
    with np.load(tmp_path / "out.npz") as saved:
        assert saved["touch_frame"].shape == (0,) and not np.nansum(saved["image_s_per_m"])


def test_where_it_cannot_be_written(tmp_path, results):
    with pytest.raises(FileError, match="cannot write there"):
        save_results(tmp_path / "none" / "out.npz", prebuilt()[0], session().as_frames(), results)
    (tmp_path / "out.npz").mkdir()
    with pytest.raises(FileError, match="cannot write it"):
        save_results(tmp_path / "out.npz", prebuilt()[0], session().as_frames(), results)
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.npz"]
