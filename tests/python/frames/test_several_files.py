"""Recordings in several files: a reference in a file of its own, one frame per file, each file with
its own delimiter."""

import numpy as np
import pytest
from made_sources import UNTOUCHED, volts, written

from eitskin.cli.main import main
from eitskin.errors import EitskinError, FileError, FrameError, UsageError
from eitskin.frames.frames import load_frames
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.several_files import natural
from eitskin.frames.source import SourceOptions
from eitskin.skin.protocol import adjacent

VOLTS = np.round(volts(), 9)
QUIET, TOUCHED = VOLTS[:UNTOUCHED], VOLTS[UNTOUCHED:]
ADJACENT = ["--protocol", "adjacent", "--electrodes", "16"]


def taken(path, reference_file=None, **options):
    source = SourceOptions(
        reference_file=None if reference_file is None else str(reference_file), **options
    )
    return import_frames(path, ImportOptions(source=source), adjacent(16), None)


def same(frames, quiet=QUIET, touched=TOUCHED):
    assert np.allclose(frames.reference_voltage_v, quiet, atol=1e-9)
    assert np.allclose(frames.voltage_v, touched, atol=1e-9)


@pytest.mark.parametrize("delimiter", (",", ";", "\t", "|", " "))
def test_the_reference_in_a_file_of_its_own_with_its_own_delimiter(tmp_path, delimiter):
    touched = written(tmp_path / "touched.txt", TOUCHED, " ")
    quiet = written(tmp_path / "ref.csv", QUIET, delimiter)
    same(taken(touched, quiet))


@pytest.mark.parametrize(
    "kind", ("no last line end", "column", "header", "npy", "npz", "with time")
)
def test_the_reference_file_may_have_another_form(tmp_path, kind):
    touched = written(tmp_path / "touched.csv", np.column_stack([np.arange(4) / 9, TOUCHED]))
    options = {"columns": "1:209", "time": "0"}
    path, quiet = tmp_path / "ref.csv", QUIET
    if kind == "no last line end":
        path.write_text(written(path, QUIET).read_text().rstrip("\n"))
    elif kind == "column":
        quiet = QUIET[:1]
        written(path, quiet.T)
    elif kind == "header":
        body = written(path, QUIET).read_text()
        path.write_text(",".join(map(str, range(208))) + "\n" + body)
    elif kind == "with time":
        written(path, np.column_stack([np.arange(8) / 9, QUIET]))
    else:
        path = tmp_path / f"ref.{kind}"
        np.save(path, QUIET) if kind == "npy" else np.savez(path, quiet=QUIET)
    same(taken(touched, path, **options), quiet)


@pytest.mark.parametrize("how", ("list", "folder", "pattern"))
def test_one_frame_per_file_in_natural_order(tmp_path, how):
    folder = tmp_path / "a run"
    folder.mkdir()
    paths = [
        written(folder / f"frame{k}.txt", frame, (",", " ", ";")[k % 3])
        for k, frame in enumerate(VOLTS)
    ]
    (folder / "notes.pdf").write_bytes(b"%PDF")
    given = {"list": paths, "folder": folder, "pattern": folder / "frame*.txt"}[how]
    frames = taken(given, reference_frames="0:8")
    same(frames)
    assert frames.frame_name == ("frame8", "frame9", "frame10", "frame11")
    assert natural("frame10") > natural("frame9")
    assert [f.name for f in sorted(folder.glob("frame*"))][2] == "frame10.txt"  # not natural


def test_a_folder_that_holds_the_reference_file_too(tmp_path):
    for k, frame in enumerate(TOUCHED):
        written(tmp_path / f"t{k}.csv", frame)
    quiet = written(tmp_path / "ref.csv", QUIET)
    same(taken(tmp_path, quiet))
    same(taken(sorted(tmp_path.glob("*.csv")), quiet))


def test_several_recordings_one_after_another(tmp_path):
    first, second = written(tmp_path / "a.csv", VOLTS[:10]), written(tmp_path / "b.tsv", VOLTS[10:])
    frames = taken([first, second], reference_frames="0:8")
    same(frames)
    assert frames.frame_name == ("a:8", "a:9", "b:0", "b:1")


def test_arrays_in_several_files(tmp_path):
    for k, frame in enumerate(VOLTS):
        np.savez(tmp_path / f"f{k}.npz", v=frame)
    same(taken(tmp_path, reference_frames="0:8"))


@pytest.mark.parametrize("rows", (13, 16))
def test_a_file_that_is_one_frame_of_a_line_for_each_drive(tmp_path, rows):
    written(tmp_path / "f0.txt", QUIET[0].reshape(16, 13))
    written(tmp_path / "f1.txt", TOUCHED[0].reshape(16, 13))
    frames = taken(tmp_path, reference_frames="0")
    same(frames, QUIET[:1], TOUCHED[:1])
    assert frames.meta["notes"] == ["16 lines of 13 numbers are taken for one frame"]


def test_a_layout_keeps_the_reference_file_and_reads_a_folder(tmp_path, capsys, monkeypatch):
    (tmp_path / "run 1").mkdir()
    for k, frame in enumerate(TOUCHED):
        written(tmp_path / "run 1" / f"f{k}.txt", frame, " ")
    quiet = written(tmp_path / "ref.txt", QUIET, ";")
    layout, out = tmp_path / "l.toml", tmp_path / "f.npz"
    words = ["import", str(tmp_path / "run 1"), "-o", str(out), *ADJACENT]
    assert main([*words, "--reference-file", str(quiet), "--save-layout", str(layout)]) == 0
    assert 'reference_file = "ref.txt"' in layout.read_text()
    monkeypatch.chdir("/")
    again = tmp_path / "again.npz"
    assert main(["import", str(tmp_path / "run 1"), "-o", str(again), "--layout", str(layout)]) == 0
    same(load_frames(again))
    capsys.readouterr()


def test_the_doctor_reads_what_import_reads(tmp_path, capsys):
    quiet = written(tmp_path / "ref.txt", -QUIET, ";")
    for k, frame in enumerate(TOUCHED):
        written(tmp_path / f"f {k}.csv", -frame)
    pattern = str(tmp_path / "f *.csv")
    code = main(["doctor", pattern, "--reference-file", str(quiet), *ADJACENT])
    out = capsys.readouterr().out
    assert code == 11 and "--sign reversed" in out
    assert f"eitskin import '{pattern}' -o frames.npz --protocol adjacent" in out
    assert f"--reference-file {quiet}" in out


@pytest.mark.parametrize(
    ("name", "kind", "said"),
    [
        ("absent*.csv", FileError, "no file has a name of this pattern"),
        ("empty", FileError, "the folder has no file that ends in .csv"),
        ("absent.csv", FileError, "no such table"),
        ("unequal", EitskinError, "b.csv.*a frame should have 208 channels"),
    ],
)
def test_what_is_not_there_is_named(tmp_path, name, kind, said):
    (tmp_path / "empty").mkdir()
    (tmp_path / "unequal").mkdir()
    written(tmp_path / "unequal" / "a.csv", QUIET)
    written(tmp_path / "unequal" / "b.csv", QUIET[:, :207])
    with pytest.raises(kind, match=said):
        taken(tmp_path / name, reference_frames="0")


def test_two_references_contradict_each_other(tmp_path):
    path = written(tmp_path / "a.csv", VOLTS)
    with pytest.raises(UsageError, match="--reference-file does not go with another reference"):
        taken(path, path, reference_frames="0:8")
    with pytest.raises(FileError, match="no such table"):
        taken(path, tmp_path / "ref.csv")
    short = written(tmp_path / "short.csv", QUIET[:, :200])
    with pytest.raises(FrameError, match=r"short\.csv.*should have 208 channels"):
        taken(path, short)


def test_a_frames_file_is_not_joined(tmp_path, capsys):
    path, out = written(tmp_path / "a.csv", VOLTS), tmp_path / "a.npz"
    words = ["--reference-frames", "0:8", *ADJACENT]
    assert main(["import", str(path), "-o", str(out), *words]) == 0
    with pytest.raises(UsageError, match="already a frames file; it cannot be joined"):
        taken([out, path], reference_frames="0:8")
    capsys.readouterr()
