"""A file of presses is read as it was written. Values that cannot be presses are refused with one
line that names the press and what to do."""

import numpy as np
import pytest

from eitskin.errors import FileError, FrameError
from eitskin.skin.protocol import opposite
from eitskin.teaching.presses import Presses, joined, load_presses, save_presses


def some(count: int = 3) -> Presses:
    draw, protocol = np.random.default_rng(1), opposite(8)
    rows = (count, protocol.n_rows)
    untouched, pressed, place = (draw.normal(size=size) for size in (rows, rows, (count, 2)))
    return Presses(protocol, untouched, pressed, place)


def test_a_file_gives_back_its_presses(tmp_path):
    whole = joined(some(), some(2))
    save_presses(tmp_path / "a.npz", whole)
    read = load_presses(tmp_path / "a.npz")
    assert len(read) == 5 and read.protocol.hash == whole.protocol.hash
    assert (read.pressed == whole.pressed).all() and (read.place_mm == whole.place_mm).all()
    assert read.depth_mm is None and (read.take([1, 3]).untouched == whole.untouched[[1, 3]]).all()


def test_what_cannot_be_presses_is_refused(tmp_path):
    made = some()
    arrays = {name: getattr(made, name) for name in ("untouched", "pressed", "place_mm")}
    for change, words in (
        ({"place_mm": np.zeros((2, 2))}, "shape"),
        ({"place_mm": np.full((3, 2), np.inf)}, "give it in mm"),
        ({"depth_mm": np.full(3, -1.0)}, "depth_mm must be"),
        ({"pressed": np.array(["a"])}, "must be numbers"),
        ({"version": 9}, "upgrade"),
    ):
        path = tmp_path / "bad.npz"
        np.savez(path, drive_measure=opposite(8).drive_measure, **{**arrays, **change})
        with pytest.raises(FrameError, match=words):
            load_presses(path)
    (tmp_path / "none.npz").write_bytes(b"PK no zip")
    with pytest.raises(FileError, match=r"not a readable \.npz presses file"):
        load_presses(tmp_path / "none.npz")
