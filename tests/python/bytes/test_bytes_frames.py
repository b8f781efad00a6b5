"""Any bytes as a file of frames, own or somebody else's: frames, or a refusal of one line; nothing
half written."""

import io
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from bytes_damage import ODD_BYTES, ODD_WORDS, any_bytes, bounded, read_or_refuse, written
from hypothesis import given
from hypothesis import strategies as st

from eitskin.cli.main import main
from eitskin.frames.frames import Frames, load_frames, save_frames
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.source import SourceOptions
from eitskin.skin.protocol import adjacent
from fresh_python import words

PROTOCOL = adjacent(8)
ROWS = PROTOCOL.n_rows
VOLTS = 1 + 0.01 * np.sin(np.arange(3 * ROWS)).reshape(3, ROWS)


def own_file(folder: Path, **extra: Any) -> bytes:
    frames = Frames(PROTOCOL, VOLTS, VOLTS[:1], ("a", "b", "c"), meta={"unit": "V"}, **extra)
    save_frames(folder / "own.npz", frames)
    return (folder / "own.npz").read_bytes()


@pytest.fixture(scope="module")
def own(tmp_path_factory) -> list[bytes]:
    folder = tmp_path_factory.mktemp("own")
    return [own_file(folder), own_file(folder, time_s=np.arange(3.0))]


def stored(**arrays: Any) -> bytes:
    """An .npz without compression, so that damage reaches the arrays and not only the zip."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


FIELDS: dict[str, Any] = {
    "format": np.array("eitskin-frames"), "version": np.array(1, dtype=np.int32),
    "voltage_v": VOLTS, "reference_voltage_v": VOLTS[:1],
    "drive_measure": np.asarray(PROTOCOL.drive_measure), "n_electrodes": np.array(8),
    "current_a": np.array(1e-3), "frame_name": np.array(["a", "b", "c"]),
    "meta": np.array(json.dumps({"unit": "V"})),
}  # fmt: skip
FOREIGN = {
    "v": VOLTS,
    "ref": VOLTS[0],
    "names": np.array(["x", "y", "z"]),
    "table": np.asarray(PROTOCOL.drive_measure),
}
ARCHIVES = [stored(**FIELDS), stored(**FOREIGN)]
ODD_ARRAYS: tuple[Any, ...] = (
    np.array(np.nan), np.array([]), np.array("text\nof two lines"), np.array([b"\xff\n"]),
    np.array(2**63, dtype=np.uint64),
    np.array(1 + 2j), np.array(True), np.array("2020-01-01", dtype="datetime64[D]"),
    np.zeros((2, 2, 2)), np.zeros((0, 3)),
    np.array("[" * 3000), np.array("9" * 5000), np.array("{}"), np.array("[]"), np.array(-1),
    np.array(1e300), np.array("\0"),
    np.array([(1, 2.0)], dtype=[("a", "i4"), ("b", "f8")]), np.full((3, ROWS), 1e308),
    np.zeros((3, ROWS), dtype="f2"),
    np.full((ROWS, 4), -5), np.full((3, ROWS), np.inf),
)  # fmt: skip


@given(content=any_bytes(ARCHIVES))
@bounded(200)
def test_any_archive_is_frames_or_refused(tmp_path, content):
    path = written(tmp_path, "x.npz", content)
    frames = read_or_refuse(load_frames, path)
    if frames is not None:
        assert np.isfinite(frames.voltage_v).all() and np.isfinite(frames.reference_voltage_v).all()
    options = ImportOptions(SourceOptions(voltage="v", reference="ref", names="names"))
    read_or_refuse(import_frames, path, options, PROTOCOL, None)


@given(data=st.data())
@bounded(60)
def test_a_damaged_frames_file_is_refused(own, tmp_path, data):
    path = written(tmp_path, "x.npz", data.draw(any_bytes(own)))
    read_or_refuse(load_frames, path)


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_each_field_may_hold_anything(tmp_path, name):
    for k, value in enumerate(ODD_ARRAYS):
        path = written(tmp_path, f"{k}.npz", stored(**{**FIELDS, name: value}))
        read_or_refuse(load_frames, path)
        read_or_refuse(load_frames, path, allow_nonfinite=True)


def test_each_array_of_a_foreign_file_may_hold_anything(tmp_path):
    keys = {
        "voltage": "v", "reference": "ref", "names": "names", "time": "t",
        "protocol_table": "table",
    }  # fmt: skip
    good = {**FOREIGN, "t": np.arange(3.0)}
    for key, value in ((key, value) for key in keys.values() for value in ODD_ARRAYS):
        path = written(tmp_path, "x.npz", stored(**{**good, key: value, "odd\nname": np.array(1)}))
        for part in (None, "in-phase"):
            options = ImportOptions(SourceOptions(**keys, complex_part=part))
            read_or_refuse(import_frames, path, options, None, None, 8)
            read_or_refuse(import_frames, path, options, None, None, 8, lenient=True)
        absent = ImportOptions(SourceOptions(voltage="not there"))
        assert read_or_refuse(import_frames, path, absent, PROTOCOL, None) is None


TABLE = "\n".join(",".join(f"{value:.5f}" for value in row) for row in VOLTS).encode()
COLUMNS = "quiet;one;two\n" + "\n".join(
    ";".join(f"{value:.4f}".replace(".", ",") for value in row) for row in VOLTS.T
)
TABLES = [TABLE, COLUMNS.encode(), b"# comment\n" + TABLE.replace(b",", b"\t") + b"\n"]


@given(content=any_bytes(TABLES, ODD_BYTES + ODD_WORDS))
@bounded(200)
def test_any_text_table_is_frames_or_refused(tmp_path, content):
    path = written(tmp_path, "x.csv", content)
    for untouched in (
        {"reference_frames": "0"},
        {"reference_columns": "0"},
        {"reference_columns": "quiet"},
    ):
        options = ImportOptions(SourceOptions(**untouched))
        frames = read_or_refuse(import_frames, path, options, PROTOCOL, None)
        assert frames is None or np.isfinite(frames.voltage_v).all()
    as_table = ImportOptions(SourceOptions(reference_frames="0"), table_file=str(path))
    read_or_refuse(import_frames, written(tmp_path, "v.csv", TABLE), as_table, None, None, 8)


ELECTRODES = b"\n".join(b"%d,%d,%d,%d" % tuple(row) for row in PROTOCOL.drive_measure.tolist())


@given(content=any_bytes([ELECTRODES], ODD_BYTES + ODD_WORDS))
@bounded(100)
def test_any_protocol_table_is_one_or_refused(tmp_path, content):
    options = ImportOptions(
        SourceOptions(reference_frames="0"), table_file=str(written(tmp_path, "t.csv", content))
    )
    volts = written(tmp_path, "v.csv", TABLE)
    read_or_refuse(lambda: import_frames(volts, options, None, None, 8))


@cache
def mat_files() -> list[bytes]:
    arrays = {
        "v": VOLTS,
        "ref": VOLTS[:1],
        "s": {"names": ["a", "b"], "deep": {"x": 1.5}},
        "c": np.array([1, "a", [2.0]], dtype=object),
    }
    made = []
    for compressed in (False, True):
        stream = io.BytesIO()
        scipy.io.savemat(stream, arrays, do_compression=compressed)
        # the head's text names the day
        made.append(b"MATLAB 5.0".ljust(116) + stream.getvalue()[116:])
    return made


@given(data=st.data())
@bounded(250)
def test_any_matlab_file_is_frames_or_refused(tmp_path, data):
    path = written(tmp_path, "x.mat", data.draw(any_bytes(mat_files())))
    options = ImportOptions(SourceOptions(voltage="v", reference="ref"))
    frames = read_or_refuse(import_frames, path, options, PROTOCOL, None)
    assert frames is None or np.isfinite(frames.voltage_v).all()


def test_a_refused_import_leaves_what_was_there(tmp_path):
    target = written(tmp_path, "out.npz", b"as it was")
    source = written(tmp_path, "x.csv", TABLE[: len(TABLE) // 2] + b"x")
    options = "--protocol adjacent --electrodes 8 --reference-frames 0"
    assert main(words(f"import {source} {options} -o {target}")) != 0
    assert target.read_bytes() == b"as it was"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.npz", "x.csv"]
