"""The table of formats in docs/guide/import-and-doctor.md: each command, on a file of that form."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from made_sources import UNTOUCHED, potentials, volts, written

from eitskin.cli.main import main
from eitskin.errors import FrameError
from eitskin.fem.grid import grid_for
from eitskin.frames.eidors import save_eidors
from eitskin.frames.frames import Frames, load_frames
from eitskin.frames.instrument_files import read_instrument_file
from eitskin.frames.orders import source_table
from eitskin.skin.protocol import adjacent, opposite
from eitskin.skin.skin import paper_skin

PAGE = Path(__file__).parents[3] / "docs/guide/import-and-doctor.md"
TABLE = PAGE.read_text(encoding="utf-8").partition("<!-- formats -->")[2].partition("<!-- end")[0]
COMMANDS = dict(re.findall(r"^\| ([^|]+?) \|.*`(eitskin import [^`]+)` \|$", TABLE, re.MULTILINE))
VOLTS = volts()
ROTATING = [
    adjacent(16).drive_measure.tolist().index(row)
    for row in source_table("rotating", adjacent(16)).tolist()
]


def sciospec(folder: Path, channels: int = 32, frequencies: int = 1) -> None:
    """One .eit per frame, with a phase in all numbers and channels without an electrode."""
    folder.mkdir()
    values = potentials().reshape(-1, 16, 16) * np.exp(0.1j)
    order = np.unique(adjacent(16).drive_measure[:, :2], axis=0).tolist()
    for number, frame in enumerate(values, 1):
        lines = ["18", "2", "setup", f"2025.02.12. 13:19:{number:02d}.685", "10000.0", "20000.0"]
        lines += ["1", str(frequencies), "0.001", "20.0", "0.0", "1.0", "1", "1", "1", "1"]
        lines += ["MeasurementChannels: " + ",".join(map(str, range(1, 17)))]
        lines += ["MeasurementChannelsIndependentFromInjectionPattern: 1,2,3"]
        for (a, b), of_drive in zip(order, frame, strict=True):
            lines.append(f"{a + 1} {b + 1}")
            every = np.r_[of_drive, np.full(channels - 16, -2.5e-6)]
            line = "\t".join(f"{z.real:.12g}\t{z.imag:.12g}" for z in every)
            lines += [line] + [line.replace("1", "2")] * (frequencies - 1)
        (folder / f"setup_{number}.eit").write_text("\n".join(lines))


def goe_mf(path: Path, head: bytes = b"") -> None:
    records = np.zeros((12, 256), dtype="<f4")
    records[:, :208] = VOLTS[:, ROTATING]
    path.write_bytes(head + records.tobytes())


def draeger(path: Path) -> None:
    head = b"---Draeger EIT-Software V2---\r\nFormat: 51\r\nFramerate [Hz]: 20\r\n"
    head = head[:4] + (200).to_bytes(2, "little") + head[6:]
    head = head.ljust(216, b"\0")
    records = np.zeros((12, 5495), dtype=np.uint8)
    for record, frame in zip(records, VOLTS[:, ROTATING], strict=True):
        numbers = np.zeros(600)
        numbers[322:530] = 0.3 * frame
        numbers[:208] = (frame + 0.00019607 * 0.3 * frame) / 0.00098242
        record[:4800] = np.frombuffer(numbers.tobytes(), dtype=np.uint8)
    path.write_bytes(head + records.tobytes())


def make(folder: Path, name: str) -> np.ndarray:
    """Write the files that a command needs, and return the frames that should come out."""
    wanted = VOLTS
    if name == "Sciospec":
        sciospec(folder / "setup")
    elif name.startswith("Goe-MF"):
        goe_mf(folder / "lung.get")
    elif name.startswith("Draeger"):
        draeger(folder / "lung.eit")
    elif name.startswith("OpenEIT"):
        wanted = volts(opposite(16).drive_measure)
        lines = ["magnitudes: " + "".join(f"{v:.9f}, " for v in np.abs(row)) for row in wanted]
        (folder / "spectra.log").write_text("OpenEIT\n" + "\n".join(lines))
    elif name == "EIT-kit":
        wanted = 100 * VOLTS
        lines = ["framei" + "".join(f"{v:.4f}" for v in -row) for row in wanted]
        (folder / "kit.txt").write_text("\n".join(["Board Initialized", *lines]))
    elif name == "EIDORS":
        protocol, skin = adjacent(16), paper_skin()
        frames = Frames(protocol, VOLTS[UNTOUCHED:], VOLTS[:1], tuple("abcd"))
        save_eidors(folder / "eidors.mat", skin, protocol, grid_for(skin.outline, 16),
                    elements=400, frames=frames)  # fmt: skip
        return np.vstack([np.repeat(VOLTS[:1], UNTOUCHED, axis=0), VOLTS[UNTOUCHED:]])
    elif name == "pyEIT":
        np.save(folder / "pyeit.npy", -1e3 * VOLTS)
    elif name.startswith("Arduino"):
        blocks = ["k\n" + "\n".join(" ".join(f"{v:.9f}" for v in row) for row in one)
                  for one in VOLTS.reshape(-1, 16, 13)]  # fmt: skip
        (folder / "arduino.txt").write_text("\n".join(blocks))
    elif name.startswith("12-bit"):
        counts = np.round(2048 + 5e4 * volts(snr_db=50))
        written(folder / "counts.csv", counts, form="%d")
        wanted = (counts - 2048) * 0.0008
    elif name.startswith("single-ended"):
        written(folder / "potentials.csv", potentials())
    elif name == "spreadsheet":
        lines = [";".join(map(str, range(1, 209)))]
        lines += [";".join(f"{v:.9f}".replace(".", ",") for v in row) for row in VOLTS]
        (folder / "sheet.csv").write_text("\r\n".join(lines), encoding="utf-8-sig")
    else:
        written(folder / "untouched.txt", VOLTS[:UNTOUCHED], ";")
        written(folder / "touched.txt", VOLTS[UNTOUCHED:], " ")
    return wanted


def test_the_table_has_what_people_have():
    for word in ("Sciospec", "Draeger", "Goe-MF", "OpenEIT", "EIT-kit", "EIDORS", "pyEIT",
                 "Arduino", "spreadsheet"):  # fmt: skip
        assert any(word in name for name in COMMANDS), word


@pytest.mark.parametrize("name", COMMANDS)
def test_the_command_of_a_format_works(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    wanted = make(tmp_path, name)
    assert main(shlex.split(COMMANDS[name])[1:]) == 0, capsys.readouterr().err
    capsys.readouterr()
    frames = load_frames("frames.npz")
    assert frames.n_frames == len(wanted) - UNTOUCHED
    reference = wanted[:UNTOUCHED].mean(axis=0)
    scale = np.abs(reference).max()
    assert np.allclose(frames.reference_v, reference, atol=4e-3 * scale)
    true = wanted[UNTOUCHED + 1] - reference
    got = frames.voltage_v[1] - frames.reference_v
    assert np.corrcoef(got, true)[0, 1] > 0.9
    assert main(["doctor", "frames.npz"]) == 0, capsys.readouterr().out
    capsys.readouterr()


def test_sciospecs_times_current_and_frequencies(tmp_path):
    sciospec(tmp_path / "s", frequencies=2)
    read = read_instrument_file(tmp_path / "s" / "setup_3.eit")
    assert read.current_a == 0.001 and read.in_volts and read.time_s is not None
    assert read.voltage.shape == (1, 256) and "2 frequencies" in read.notes[0]


def test_draegers_get_before_2006_and_carefusion(tmp_path):
    head = b"---Draeger EIT-Software---\r\nDate: 18-02-2004\r\n\r\nFrames: 12\r\n\r\n\r\n"
    goe_mf(tmp_path / "d.get", head)
    read = read_instrument_file(tmp_path / "d.get")
    assert np.allclose(read.voltage, VOLTS[:, ROTATING], rtol=1e-6)
    text = '<?xml version="1.0" ?><EIT_File><Header>0400 bytes</Header>'
    records = np.zeros((3, 262), dtype="<f4")
    records[:, 36:244] = VOLTS[:3]
    content = b"\xff\xfe" + text.encode("utf-16-le")
    (tmp_path / "c.eit").write_bytes(content.ljust(400, b" ") + records.tobytes())
    assert np.allclose(read_instrument_file(tmp_path / "c.eit").voltage, VOLTS[:3], rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.get", b"1234"),
        ("b.get", b"---Draeger EIT-Software---\r\n"),
        ("c.eit", b"hello\n"),
        ("d.eit", b"18\n2\nname\n"),
        ("e.eit", b"\xff\xfe<\0x\0"),
        ("f.eit", b"Draeger Framerate [Hz]: 0 Format: 32\n"),
        ("g.eit", b"9\nname\n2020.01.01 10:00:00\n1\n1\n0\n1\n0.01\n20\n1 2\n1 2 3\n"),
    ],
)
def test_a_damaged_file_is_an_error_of_one_line(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FrameError, match=name) as caught:
        read_instrument_file(tmp_path / name)
    assert "\n" not in str(caught.value)
