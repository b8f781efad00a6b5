"""The frames file: what is saved comes back, and everything else is refused in one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.errors import EitskinError, FileError, FrameError
from eitskin.frames.frames import FORMAT, Frames, load_frames, save_frames
from eitskin.frames.paths import Paths
from eitskin.skin.protocol import adjacent, in_order

PROTOCOL = in_order(adjacent(8, current_a=2e-3), "by 3")
ROWS = 40


def make_frames(**changes: Any) -> Frames:
    rng = np.random.default_rng(1)
    fields: dict[str, Any] = {
        "protocol": PROTOCOL, "voltage_v": rng.normal(size=(3, ROWS)),
        "reference_voltage_v": rng.normal(size=(5, ROWS)), "frame_name": ("a", "b", "ü"),
        "time_s": np.array([0.0, 0.1, 0.25]), "touch_frame": np.array([0, 2, 2]),
        "touch_xy_mm": np.array([[0.0, 1.0], [2.0, 3.0], [-4.0, 5.5]]),
        "touch_radius_mm": np.array([6.0, 7.0, 8.0]),
        "touch_strength": np.array([2.0, -0.5, np.nan]),
        "truth_mask": rng.integers(-1, 2, size=(3, 4, 6)).astype(np.int8),
        "truth_mask_extent_mm": (-97.0, -97.0, 97.0, 97.0),
        "meta": {"source": "seed 1", "options": {"snr_db": 60.0}},
        "row_time_s": 1e-4 * PROTOCOL.scan_places,
        "paths": Paths(np.array([0, 0, 1, 1, 1]), np.array([0.0, 0.2, 0.1, 0.2, 0.3]),
                       np.arange(10.0).reshape(5, 2), np.full(5, 8.0), np.ones(5)),
    }  # fmt: skip
    return Frames(**(fields | changes))


def test_saved_frames_come_back_equal(tmp_path):
    frames = make_frames()
    save_frames(tmp_path / "f.npz", frames)
    back = load_frames(tmp_path / "f.npz")
    same = (
        "voltage_v", "reference_voltage_v", "time_s", "touch_frame", "touch_xy_mm",
        "touch_radius_mm", "truth_mask", "row_time_s",
    )  # fmt: skip
    for name in same:
        assert np.array_equal(getattr(back, name), getattr(frames, name)), name
        assert getattr(back, name).dtype == getattr(frames, name).dtype, name
    assert back.touch_strength is not None and back.touch_sign is not None
    assert np.array_equal(back.touch_strength, [2.0, -0.5, np.nan], equal_nan=True)
    assert back.touch_sign.tolist() == [1, -1, 0]
    assert back.truth_mask_extent_mm == frames.truth_mask_extent_mm
    assert back.frame_name == ("a", "b", "ü")
    assert back.meta == frames.meta
    assert (back.protocol.hash, back.protocol.current_a) == (PROTOCOL.hash, 2e-3)
    assert back.touches_in(2).tolist() == [1, 2] and back.touches_in(1).tolist() == []
    assert back.protocol.drive_order == PROTOCOL.drive_order == (0, 3, 6, 1, 4, 7, 2, 5)
    assert back.paths is not None
    for time_s, places in ((0.05, [[0.5, 1.5]]), (0.15, [[1.5, 2.5], [5.0, 6.0]]), (0.31, [])):
        assert back.paths.at(time_s)[0].tolist() == places


def test_equal_frames_give_equal_bytes(tmp_path):
    save_frames(tmp_path / "a.npz", make_frames())
    save_frames(tmp_path / "b.npz", make_frames())
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_failed_save_leaves_the_old_file(tmp_path):
    path = tmp_path / "f.npz"
    save_frames(path, make_frames())
    before = path.read_bytes()
    bad = np.zeros((3, ROWS))
    bad[1, 7] = np.nan
    with pytest.raises(FrameError, match="frame 1, row 7 is nan"):
        save_frames(path, make_frames(voltage_v=bad, allow_nonfinite=True))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["f.npz"]


def test_one_reference_frame_becomes_a_row_and_names_are_counted():
    frames = make_frames(reference_voltage_v=np.ones(ROWS), frame_name=())
    assert frames.reference_voltage_v.shape == (1, ROWS)
    assert frames.reference_v.tolist() == [1.0] * ROWS
    assert frames.frame_name == ("0", "1", "2")
    with pytest.raises(ValueError):
        frames.voltage_v[0, 0] = 1.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"voltage_v": np.zeros((3, 41))}, r"voltage_v has shape \(3, 41\)"),
        ({"voltage_v": np.zeros((3, ROWS), dtype=complex)},
         "must be real numbers, not complex128"),
        ({"voltage_v": np.full((3, ROWS), np.inf)}, "frame 0, row 0 is inf"),
        ({"reference_voltage_v": np.zeros((0, ROWS))}, "at least one untouched frame"),
        ({"frame_name": ("a",)}, "1 names for 3 frames"),
        ({"time_s": np.zeros(2)}, "time_s has shape"),
        ({"row_time_s": np.zeros(2)}, "row_time_s has shape"),
        ({"row_time_s": np.full(ROWS, np.nan)}, "row_time_s: frame 0, row 0 is nan"),
        ({"touch_frame": np.array([0, 3, 1])}, "there are 0 to 2"),
        ({"touch_frame": np.array([0.5, 1, 1])}, "whole numbers"),
        ({"touch_frame": None}, "touch_xy_mm without touch_frame"),
        ({"touch_xy_mm": np.zeros((3, 3))}, "touch_xy_mm has shape"),
        ({"touch_sign": np.array([1, 2, 0])}, "touch_sign must be 3 values"),
        ({"truth_mask": np.full((3, 4, 6), 2)}, "truth_mask must be"),
        ({"truth_mask_extent_mm": None}, "truth_mask_extent_mm"),
        ({"truth_mask_extent_mm": (1, 0, 0, 1)}, "truth_mask_extent_mm"),
    ],
)  # fmt: skip
def test_wrong_fields_are_named(change, said):
    with pytest.raises(FrameError, match=said) as caught:
        make_frames(**change)
    assert "\n" not in str(caught.value)


def rewritten(path: Path, **changes: Any) -> Path:
    """Save frames at ``path``, then change fields of the file (None removes one)."""
    save_frames(path, make_frames())
    with np.load(path) as archive:
        fields = {**dict(archive), **changes}
    np.savez(path, **{key: value for key, value in fields.items() if value is not None})
    return path


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": None}, "not an eitskin frames file .*voltage_v.*eitskin import"),
        ({"format": np.array("other")}, "eitskin import"),
        ({"version": np.array(2)}, "version 2; this eitskin reads 1"),
        ({"version": np.array("x")}, "'version'"),
        ({"voltage_v": None}, "'voltage_v' is missing"),
        ({"extra": np.zeros(2)}, "unknown field 'extra'"),
        ({"meta": np.array("{")}, "'meta' is not JSON"),
        ({"meta": np.array("[1]")}, "'meta' is not a JSON object"),
        ({"drive_measure": np.zeros((ROWS, 4), dtype=int)},
         "pair of one|two different|electrode"),
        ({"drive_measure": np.zeros((ROWS, 3), dtype=int)}, "table"),
        ({"n_electrodes": np.array(6)}, "electrode"),
        ({"current_a": np.array(0.0)}, "current_a"),
        ({"current_a": np.array("abc")}, "wrong type|current"),
        ({"voltage_v": np.array(["a"])}, "real numbers"),
        ({"touch_frame": np.array([0, 9, 1])}, "there are 0 to 2"),
        ({"drive_order": np.arange(7)}, "each drive once"),
        ({"path_time_s": None}, "path_touch without the other path fields"),
        ({"path_time_s": np.zeros(5)}, "path_time_s within a touch"),
        ({"path_radius_mm": np.full(5, np.nan)}, "path_radius_mm must be finite"),
    ],
)  # fmt: skip
def test_wrong_files_are_refused_in_one_line_naming_the_file(tmp_path, change, said):
    path = rewritten(tmp_path / "f.npz", **change)
    with pytest.raises(EitskinError, match=said) as caught:
        load_frames(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_pickled_objects_are_never_loaded(tmp_path):
    path = tmp_path / "f.npz"
    np.savez(
        path, format=np.array(FORMAT), version=np.array(1), meta=np.array([{"a": 1}], dtype=object)
    )
    with pytest.raises(FrameError, match="is missing"):
        load_frames(path)


def test_damaged_files_are_refused(tmp_path):
    path = tmp_path / "f.npz"
    save_frames(path, make_frames())
    whole = path.read_bytes()
    rng = np.random.default_rng(2)
    for length in (0, 1, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(EitskinError):
            load_frames(path)
    refused = 0
    for _ in range(60):
        flipped = bytearray(whole)
        flipped[int(rng.integers(len(whole)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(flipped))
        try:
            load_frames(path)
        except EitskinError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 30
    with pytest.raises(FileError, match="no such frames file"):
        load_frames(tmp_path / "absent.npz")
    with pytest.raises(FileError, match="cannot read"):
        load_frames(tmp_path)


def test_nonfinite_frames_load_only_for_the_doctor(tmp_path):
    bad = np.zeros((3, ROWS))
    bad[2, 3] = np.inf
    path = rewritten(tmp_path / "f.npz", voltage_v=bad)
    with pytest.raises(FrameError, match="frame 2, row 3"):
        load_frames(path)
    assert np.isinf(load_frames(path, allow_nonfinite=True).voltage_v[2, 3])
