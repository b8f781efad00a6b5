"""Logs of instruments as their own sources write them, to frames: labels, no delimiter at all,
frames over several lines, broken lines; and .npy arrays."""

from pathlib import Path

import numpy as np
import pytest
from injected import healthy_frames

from eitskin.errors import EitskinError, FileError, FrameError, UsageError
from eitskin.frames.frames import load_frames
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.lines import LineFormat, LineReader
from eitskin.frames.source import SourceOptions
from eitskin.frames.tables import read_table
from eitskin.skin.protocol import adjacent, opposite


def taken(path: Path, protocol: object = None, **options: object) -> np.ndarray:
    source = SourceOptions(reference_frames="0", **options)
    reading = ImportOptions(source=source)
    frames = import_frames(path, reading, protocol or adjacent(16), None)
    return np.vstack([frames.reference_voltage_v, frames.voltage_v])


def test_a_spectra_log(tmp_path):
    """OpenEIT's firmware in mode c: a banner, then "magnitudes: " and 192 numbers, each with a
    comma after it."""
    volts = np.round(np.abs(healthy_frames(1, opposite(16)).reference_voltage_v[:3]) * 1e5, 4)
    lines = ["OpenEIT", "mode 3: imaging"]
    lines += ["magnitudes: " + "".join(f"{v:11.4f}," for v in row) for row in volts]
    path = tmp_path / "spectra.log"
    path.write_bytes("\r\n".join(lines).encode())
    assert np.array_equal(taken(path, opposite(16)), volts)
    path.write_text("\n".join(line.replace(",", " , ").replace(":", " :") for line in lines))
    assert np.array_equal(taken(path, opposite(16)), volts)
    table = read_table(path)
    assert (table.form.label, table.form.delimiter, table.n_columns) == ("magnitudes", "comma", 192)
    assert table.notes == ("2 lines without the label 'magnitudes' passed over",)


def test_an_eit_kit_message(tmp_path):
    """EIT-kit: "origin" and "framei" with four decimals each and nothing between the numbers;
    pairs at driving electrodes are left out."""
    volts = np.round(np.abs(healthy_frames(2).reference_voltage_v[:3]) * 300, 4) + 0.001
    lines = [f"{word}" + "".join(f"{v:.4f}" for v in row)
             for word, row in zip(("origin", "framei", "framei"), volts, strict=True)]  # fmt: skip
    path = tmp_path / "kit.txt"
    path.write_text("\n".join(["Board Initialized", *lines]))
    got = taken(path, label="framei", delimiter="decimals:4")
    assert np.allclose(got, volts[1:], atol=1e-12)
    with pytest.raises(FrameError, match="line 4 has 1 cells, line 2 has 208"):
        path.write_text("\n".join([*lines[:2], lines[1], lines[2][:-2]]))
        taken(path, label="framei", delimiter="decimals:4")


def test_frames_over_several_lines(tmp_path):
    volts = healthy_frames(3).reference_voltage_v[:2]
    text = "".join(f"frame {k}:\n" + "".join(f"{v!r}\n" for v in row.tolist()) + "done\n"
                   for k, row in enumerate(volts))  # fmt: skip
    (tmp_path / "v.txt").write_text(text)
    assert np.array_equal(taken(tmp_path / "v.txt", label="frame"), volts)
    reader = LineReader(LineFormat("comma", "frame"), wanted=4)
    reported = [
        reader.feed(n, line) for n, line in enumerate(("frame 7", "1,2,", "3,4,", "5,6", ""))
    ]
    found = [[row.cells for row in rows] for rows in reported]
    assert found == [[], [], [("1", "2", "3", "4")], [], []]


def test_several_labels_must_be_chosen_from(tmp_path):
    path = tmp_path / "two.txt"
    path.write_text("mags: 1,2\nphases: 3,4\nmags: 5,6\nphases: 7,8\n")
    with pytest.raises(UsageError, match=r"'mags' \(2\), 'phases' \(2\); say with --label"):
        read_table(path)
    assert read_table(path, label="mags").numbers([0, 1]).tolist() == [[1, 2], [5, 6]]


def test_bad_lines_are_named_or_left_out_and_counted(tmp_path):
    rows = [",".join(map(repr, row)) for row in healthy_frames(4).reference_voltage_v.tolist()]
    rows[0], rows[5] = rows[0].partition(",")[2], rows[5] + ",1"
    path = tmp_path / "b.csv"
    path.write_text("\n".join(rows))
    with pytest.raises(FrameError, match=r"line 2 has 208 cells, line 1 has 207; .*--skip-bad"):
        taken(path)
    assert taken(path, skip_bad_lines=True).shape == (10, 208)
    assert read_table(path, skip_bad_lines=True).notes == (
        "2 lines left out that do not have 208 cells, first line 1 with 207",
    )


@pytest.mark.parametrize("delimiter", ("\t", "  "))
def test_tabs_spaces_and_times_in_milliseconds(tmp_path, delimiter):
    volts = healthy_frames(5).reference_voltage_v[:3]
    path = tmp_path / "t.txt"
    np.savetxt(path, np.column_stack([[0, 20, 40], volts]), delimiter=delimiter, fmt="%.17g")
    source = SourceOptions(columns="1:", time="0", time_scale=1e-3, reference_frames="0")
    frames = import_frames(path, ImportOptions(source=source), adjacent(16), None)
    assert np.array_equal(frames.voltage_v, volts[1:]) and frames.time_s is not None
    assert frames.time_s.tolist() == [0.02, 0.04]


def test_a_bare_array(tmp_path):
    volts = healthy_frames(6).reference_voltage_v[:3]
    np.save(tmp_path / "a.npy", volts)
    assert np.array_equal(taken(tmp_path / "a.npy"), volts)
    np.save(tmp_path / "z.npy", volts * 1j)
    with pytest.raises(UsageError, match="the numbers are complex"):
        taken(tmp_path / "z.npy")
    (tmp_path / "c.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:300])
    with pytest.raises(FileError, match=r"not a readable \.npy"):
        taken(tmp_path / "c.npy")


def test_steps_of_columns_and_long_lists():
    from eitskin.frames.tables import chosen

    names = tuple(f"channel {k}" for k in range(400))
    assert chosen("1:8:3,2", 10, (), "--columns") == (1, 4, 7, 2)
    for bad in ("1:8:0", "1:8:-1", "1:99:2"):
        with pytest.raises(UsageError, match="out of range"):
            chosen(bad, 10, (), "--columns")
    with pytest.raises(UsageError, match=r"'x' is not a number.*channel 0, .*\.\.\.$") as caught:
        chosen("x," * 500, 400, names, "--columns")
    assert len(str(caught.value)) < 700


def test_a_foreign_file_for_a_frames_file_names_import(tmp_path):
    (tmp_path / "x.csv").write_text("1,2,3\n")
    with pytest.raises(EitskinError, match=r"not a frames file; convert it:  eitskin import"):
        load_frames(tmp_path / "x.csv")
