"""Refusals of the command line: each has the documented exit code and one line that says what to
do, without a traceback, and leaves no file. tests/python/docs/mistakes.md has the most frequent
mistakes, which are not repeated here."""

import io
import re
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from eitm_bytes import sealed, sections_of
from eitskin.cli.main import COMMANDS, STUDIES, build_parser, main
from eitskin.config import load_toml
from eitskin.errors import sources_url
from eitskin.skin.protocol import opposite
from fresh_python import MAIN, run_python, without
from small_models import prebuilt, session, small_blob

ROOT = Path(__file__).resolve().parents[3]
USAGE, FILE, CONFIG, GEOMETRY, MODEL, PROTOCOL, FRAME, EXTRA, VERIFICATION = range(2, 11)


# ---- arguments ----


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("model", "required: ACTION"),
        ("model build x.toml", "required: -o/--output"),
        ("model build x.toml -o x --rank many", "invalid int value: 'many'"),
        ("model info --verbose", "unrecognized arguments: --verbose"),
        ("reconstruct x.npz --gap 1e", "invalid float value: '1e'"),
    ],
)
def test_arguments_that_cannot_be_parsed(refused, arguments, text):
    line = refused(USAGE, arguments)
    assert text in line and line.endswith("--help")


def test_an_option_of_another_command_is_not_suggested_as_itself(refused):
    assert "mean '--paper'" not in refused(USAGE, "model info x.eitm --paper")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command, capsys):
    with pytest.raises(SystemExit) as end:
        main([command, "--help"])
    assert end.value.code == 0
    assert f"usage: eitskin {command}" in capsys.readouterr().out
    assert command in build_parser().format_help()


@pytest.mark.parametrize("command", STUDIES)
def test_a_command_of_the_studies_says_where_they_are(command, refused, monkeypatch):
    monkeypatch.setattr("eitskin.cli.main.entry_points", lambda group: [])
    monkeypatch.setattr("eitskin.errors.checkout", lambda: Path("/my sources"))
    assert refused(EXTRA, f"{command} --help") == (
        f"eitskin {command} is not installed yet: run  pip install '/my sources/firmware/emulator'"
        " '/my sources/hardware' '/my sources/studies'"
    )
    monkeypatch.setattr("eitskin.errors.checkout", lambda: None)
    assert refused(EXTRA, f"{command} --help") == (
        f"eitskin {command} comes with eitskin's sources, not with the wheel: run  git clone"
        f" {sources_url()}  and in its folder  pip install ./firmware/emulator ./hardware ./studies"
    )


@pytest.mark.parametrize(
    "page",
    ["README.md", "docs/guide/scenes.md", "docs/guide/own-method.md", "studies/results/README.md"],
)
def test_a_page_installs_all_folders_that_the_studies_need(page):
    """The demo has installed eitskin and the emulator before the README comes to the studies."""
    folders = {"eitskin-emulator": "./firmware/emulator", "eitskin-hardware": "./hardware"}
    needed = load_toml(ROOT / "studies" / "pyproject.toml", "project")["project"]["dependencies"]
    own = {folders[one] for one in needed if one in folders}
    assert own == set(folders.values())
    text = (ROOT / page).read_text(encoding="utf-8")
    there = {"./firmware/emulator"} if page == "README.md" else set()
    commands = [one.split() for one in re.findall(r"pip install ([^`]*)`", text)]
    commands = [one for one in commands if "./studies" in one]
    assert commands and all(own <= set(one) | there for one in commands)


def test_version(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0 and capsys.readouterr().out == "eitskin 0.1.0\n"


# ---- models ----


def newer(blob: bytes) -> bytes:
    changed = bytearray(blob)
    struct.pack_into("<H", changed, 4, 9)
    return sealed(changed)


def corrupted(blob: bytes) -> bytes:
    changed = bytearray(blob)
    changed[len(blob) // 2] ^= 4
    return bytes(changed)


MODELS = {
    "truncated": (lambda blob: blob[: len(blob) // 2], "is truncated"),
    "cut in the header": (lambda blob: blob[:40], "is truncated (40 bytes)"),
    "corrupted": (corrupted, "is corrupted"),
    "newer": (newer, "format is 9.3, this eitskin reads 1.x"),
    "foreign": (lambda blob: b"\x93NUMPY" + blob, "is not an .eitm model"),
    "empty": (lambda blob: b"", "is not an .eitm model"),
}


@pytest.mark.parametrize(
    "command", ["model info", "model info --json", "model verify", "reconstruct FRAMES --model"]
)
@pytest.mark.parametrize("kind", MODELS)
def test_models_that_cannot_be_read(kind, command, refused, tmp_path, frames_file):
    change, text = MODELS[kind]
    path = tmp_path / "bad.eitm"
    path.write_bytes(change(small_blob()))
    outputs = f"-o {tmp_path / 'out.npz'} --picture {tmp_path / 'out.png'}"
    given = command.replace("FRAMES", str(frames_file))
    line = refused(MODEL, given, path, outputs if "FRAMES" in command else "")
    assert str(path) in line and text in line and ";" in line


def test_a_golden_image_of_other_bits_fails_verification(tmp_path, ran):
    """One bit of the stored image: read without complaint, but not what this core gives."""
    blob = bytearray(small_blob())
    place = sections_of(blob)["GOLD"]
    image = np.frombuffer(bytes(blob), "<f4", (place.size - 4 * 416) // 4, place.offset + 4 * 416)
    at = place.offset + 4 * 416 + 4 * int(np.argmax(image))
    blob[at] ^= 1
    path = tmp_path / "bits.eitm"
    path.write_bytes(sealed(blob))
    out, err = ran(VERIFICATION, f"model verify {path}")
    assert "does not reproduce the bits of the golden image" in err and err.count("\n") == 1
    assert "C float32" in out


# ---- frames ----


def with_nan(count: int) -> np.ndarray:
    values = np.full((1, 208), 1e-3)
    values[0, :count] = np.nan
    return values


@pytest.mark.parametrize(
    ("voltage", "text"),
    [
        (with_nan(150), "too many rows"),
        (np.full((1, 208), np.inf), "too many rows"),
        (np.zeros((1, 208)), "all voltages are zero; is the skin driven and connected?"),
    ],
    ids=["nan", "inf", "zero"],
)
@pytest.mark.parametrize("engine", ["c", "numpy"])
def test_frames_that_cannot_be_used(voltage, text, engine, tmp_path, changed_frames, ran):
    """The frame is named on its one line; nothing is written where nothing could be done."""
    path = changed_frames(first=1, voltage_v=voltage)
    outputs = f"-o {tmp_path / 'out.npz'} --picture {tmp_path / 'out.png'}"
    err = ran(FRAME, f"reconstruct {path} --engine {engine}", outputs)[1]
    assert err.startswith(f"eitskin: {path}: frame 0 (test-s3-0) refused: ")
    assert err.count("\n") == 1
    assert text in err
    assert [entry.name for entry in tmp_path.iterdir()] == ["changed.npz"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.nan, "row 20 (from 0) is not finite"),
        (np.inf, "reference frame 7 (from 0)"),
        (0.0, "all voltages are zero"),
    ],
)
def test_references_that_cannot_be_used(value, text, refused, changed_frames, tmp_path):
    untouched = session().untouched_v.copy()
    if value:
        untouched[7, 20] = value
    else:
        untouched[:] = 0
    path = changed_frames(first=1, reference_voltage_v=untouched)
    line = refused(FRAME, f"reconstruct {path} -o {tmp_path / 'out.npz'}")
    assert text in line and line.endswith(f"run  eitskin doctor {path}")


# one of each kind: tests/python/frames has all that can be wrong with a file
@pytest.mark.parametrize(
    ("changes", "code", "text"),
    [
        ({"voltage_v": np.ones(208)}, FRAME, "voltage_v"),
        ({"voltage_v": np.ones((0, 208)), "frame_name": np.zeros(0, "U1")}, FRAME,
         "nothing to reconstruct"),
        ({"reference_voltage_v": np.ones((2, 200))}, FRAME, "reference_voltage_v"),
        ({"voltage_v": None}, FRAME, "'voltage_v' is missing"),
        ({"drive_measure": opposite(16).drive_measure}, FRAME, "voltage_v"),
        ({"drive_measure": np.full((208, 4), 3, np.uint8)}, PROTOCOL, "two different electrodes"),
        ({"n_electrodes": np.array(12)}, PROTOCOL, "electrodes are 0 to 11"),
    ],
)  # fmt: skip
def test_frames_files_that_cannot_be_read(changes, code, text, refused, changed_frames, tmp_path):
    own = {"voltage_v": session().frames_v[:1], "frame_name": np.array(["a"])}
    path = changed_frames(truth=False, **(own | changes))
    outputs = f"-o {tmp_path / 'out.npz'} --picture {tmp_path / 'out.png'}"
    line = refused(code, f"reconstruct {path}", outputs)
    assert str(path) in line and text in line


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 broken"])
def test_what_is_no_frames_file(content, refused, tmp_path):
    path = tmp_path / "x.npz"
    path.write_bytes(content)
    assert str(path) in refused(FILE, f"reconstruct {path}")


def test_another_protocol_names_both_hashes_and_files(refused, changed_frames, tmp_path):
    rows = prebuilt()[0].protocol.drive_measure[::-1].copy()
    path = changed_frames(drive_measure=rows)
    line = refused(PROTOCOL, f"reconstruct {path} -o {tmp_path / 'out.npz'}")
    assert str(path) in line and "prebuilt paper skin" in line
    assert f"{prebuilt()[0].protocol.hash:016x}" in line
    assert line.count("16 electrodes, 208 rows)") == 2


# ---- skins ----

DISK = "[skin]\ndiameter_mm = 100.0\n"


# one of each exit code: tests/python/skin has all that can be wrong with a description
SKINS = {
    "overlapping electrodes": (DISK + "[electrodes]\nwidth_mm = 30.0\n", GEOMETRY,
    "do not fit on a rim of 314"),
    "not finite": ("[skin]\npolygon_mm = [[0,0],[nan,1],[5,5]]\n", GEOMETRY, "not finite"),
    "odd opposite": (DISK + '[electrodes]\ncount = 15\n[protocol]\nkind = "opposite"\n', PROTOCOL,
    "even number"),
    "repeated key": (DISK + "diameter_mm = 90.0\n", CONFIG, "not valid TOML"),
}  # fmt: skip


@pytest.mark.parametrize("kind", SKINS)
def test_skins_that_cannot_be(kind, refused, tmp_path):
    content, code, text = SKINS[kind]
    path = tmp_path / "skin.toml"
    path.write_text(content)
    line = refused(code, f"model build {path} -o {tmp_path / 'out.eitm'}")
    assert line.startswith(str(path)) and text in line


def test_a_description_that_is_no_text(refused, tmp_path):
    path = tmp_path / "skin.toml"
    path.write_bytes(b"[skin]\nname = '\xff\xfe'\n")
    assert "not UTF-8" in refused(CONFIG, f"model build {path} -o {tmp_path / 'out.eitm'}")
    path.write_bytes("[skin]\nname = 'x'\n".encode("utf-16"))
    assert "not UTF-8" in refused(CONFIG, f"model build {path} -o {tmp_path / 'out.eitm'}")


# ---- files ----


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ("model info NONE", "no such model; check the path"),
        ("model verify NONE", "no such model"),
        ("reconstruct FRAMES --model NONE -o OUT", "no such model"),
        # a folder instead of a file
        ("model info FOLDER", "FOLDER"),
        ("model build FOLDER -o OUT", "FOLDER"),
        ("reconstruct FOLDER", "FOLDER"),
        ("reconstruct FRAMES --model FOLDER", "FOLDER"),
    ],
)
def test_missing_files_and_folders_instead_of_files(command, text, refused, tmp_path, frames_file):
    for word, path in (("NONE", tmp_path / "none"), ("OUT", tmp_path / "out"),
                       ("FRAMES", frames_file), ("FOLDER", tmp_path)):  # fmt: skip
        command, text = command.replace(word, str(path)), text.replace(word, str(path))
    assert text in refused(FILE, command)


@pytest.mark.parametrize("place", ["none/out", "."])
def test_outputs_are_checked_before_the_work(place, refused, tmp_path, frames_file):
    """A folder that does not exist, and a folder where a file is wanted; nothing was read or
    computed before."""
    output = tmp_path / place
    text = "does not exist; make it first" if place != "." else "this is a folder"
    for arguments in (
        ("model", "build", "--paper", "-o", output),
        ("reconstruct", "unread.npz", "-o", output),
        ("reconstruct", "unread.npz", "--picture", output),
        ("demo", "--picture", output),
    ):
        assert text in refused(FILE, *arguments)


def test_a_disk_that_is_full(refused, tmp_path, frames_file, monkeypatch):
    def full(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    output = tmp_path / "out.npz"
    line = refused(FILE, f"reconstruct {frames_file} -o {output}")
    assert line == f"{output}: cannot write it (No space left on device)"


def test_a_folder_without_permission_is_refused_before_the_work(refused, tmp_path, monkeypatch):
    monkeypatch.setattr("eitskin.fileio.os.access", lambda path, how: False)
    line = refused(FILE, f"reconstruct unread.npz -o {tmp_path / 'out.npz'}")
    assert "cannot write there (Permission denied)" in line


def test_standard_output_on_a_full_disk(monkeypatch):
    said = io.StringIO()
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        monkeypatch.setattr(sys, "stderr", said)
        assert main(["scene", "list"]) == FILE
    assert said.getvalue() == "eitskin: output: No space left on device\n"


def test_a_name_that_the_terminal_cannot_show(monkeypatch):
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr("eitskin.cli.main.FIRST", "eitskin stream --device sim:k\u00e9\udcff")
    assert main([]) == 0
    out.flush()
    assert out.buffer.getvalue().endswith(rb"sim:k\xe9\udcff" + b"\n")


def test_a_folder_that_cannot_be_written(refused, tmp_path, monkeypatch):
    """As a plain user sees it; simulated, since tests may run as root."""

    def forbidden(*arguments: object, **keywords: object) -> tuple[int, str]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("eitskin.fileio.tempfile.mkstemp", forbidden)
    skin = tmp_path / "skin.toml"
    skin.write_text(DISK)
    small = ("--elements", 800, "--pixels", 8, "--samples", 0)
    line = refused(FILE, f"model build {skin} -o {tmp_path / 'out.eitm'}", *small)
    assert "cannot write there (Permission denied)" in line


# ---- options ----


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("--iterations 2000000", "--iterations 2000000 is out of range"),
        ("--mac-limit 0", "--mac-limit 0 is out of range; use 1 to 4294967295"),
        ("--gap 0", "--gap 0 is out of range"),
        ("--gap nan", "--gap nan is out of range"),
        ("--saturation-v -1", "--saturation-v -1 must be above 0"),
        ("--saturation-v inf", "saturation_v = inf is out of range"),
    ],
)
def test_options_of_reconstruct(arguments, text, refused, frames_file):
    assert text in refused(USAGE, f"reconstruct {frames_file}", arguments)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("--rank -1", "rank = -1 is out of range"),
        ("--rank 2000", "rank = 2000 is out of range"),
        ("--pixels 2", "2 pixels across is out of range"),
        ("--pixels 512", "pixels are more than a model's 65535"),
        ("--elements 99", "--elements 99 is out of range"),
        ("--elements 600000", "--elements 600000 is out of range"),
        ("--touch-change -1", "--touch-change -1 is out of range"),
        ("--touch-change nan", "--touch-change nan is out of range"),
        ("--regularisation -1 --elements 800 --pixels 8", "regularisation"),
        ("skin.toml", "give either a SKIN.toml or --paper"),
    ],
)
def test_options_of_model_build(arguments, text, refused, tmp_path):
    assert text in refused(USAGE, f"model build --paper -o {tmp_path / 'out.eitm'}", arguments)


def test_neither_a_skin_nor_the_paper(refused, tmp_path):
    assert "give either a SKIN.toml or --paper" in refused(
        USAGE, f"model build -o {tmp_path / 'out.eitm'}"
    )


@pytest.mark.parametrize("arguments", ["--snr-db -30", "--snr-db nan", "--seed -1"])
def test_options_of_the_demo(arguments, refused, tmp_path):
    assert "demo:" in refused(USAGE, f"demo --picture {tmp_path / 'out.png'}", arguments)


# ---- extras ----


@pytest.mark.parametrize(
    ("package", "extra", "arguments"),
    [
        ("scipy", "model", ["model", "build", "--paper", "-o", "OUT"]),
        ("netgen", "model", ["model", "build", "--paper", "-o", "OUT"]),
        ("matplotlib", "plot", ["reconstruct", "FRAMES", "-o", "OUT", "--picture", "PNG"]),
        ("matplotlib", "plot", ["demo", "--picture", "PNG"]),
        ("netgen", "model", ["demo", "--seed", "2", "--picture", "PNG"]),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else value,
)
def test_missing_extras_are_named_with_the_command_to_install_them(
    package, extra, arguments, tmp_path, frames_file
):
    files = {"OUT": tmp_path / "out", "PNG": tmp_path / "out.png", "FRAMES": frames_file}
    given = [files.get(a, a) for a in arguments]
    done = run_python(without(package) + MAIN, *given)
    assert (done.returncode, done.stdout) == (EXTRA, "")
    said = [line for line in done.stderr.splitlines() if line[:2] != "1/"]  # the demo's first step
    assert len(said) == 1 and said[0].startswith("eitskin: ") and package in said[0]
    assert done.stderr.endswith(f"run  pip install 'eitskin[{extra}]'\n")
    assert list(tmp_path.iterdir()) == []


def test_without_scipy_frames_are_reconstructed_and_scored(frames_file, tmp_path):
    output = tmp_path / "out.npz"
    done = run_python(
        without("scipy", "netgen", "matplotlib") + MAIN, "reconstruct", frames_file, "-o", output
    )
    assert done.returncode == 0
    assert "20 frames, 0 refused" in done.stdout and done.stderr == ""
    assert "compared with the truth of 20 frames" in done.stdout
    assert output.exists()


def test_frames_with_truth_import_no_scipy_where_it_is_installed(frames_file):
    code = (
        "import sys\nfrom eitskin.cli.main import main\nmain(sys.argv[1:])\n"
        "print([name for name in sys.modules if name.split('.')[0] == 'scipy'], file=sys.stderr)"
    )
    done = run_python(code, "reconstruct", frames_file)
    assert "compared with the truth of 20 frames" in done.stdout
    assert done.stderr == "[]\n"


# ---- ends ----


def test_an_interrupt_is_said_and_coded(refused, monkeypatch):
    def interrupted(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("eitskin.model.prebuilt.load_prebuilt", interrupted)
    assert refused(130, "model info") == "stopped"


def test_a_reader_that_stops_is_no_error(monkeypatch):
    def broken(*arguments: object) -> None:
        raise BrokenPipeError

    class Closable:
        closed = False

        def close(self) -> None:
            self.closed = True

    stderr = Closable()
    monkeypatch.setattr("eitskin.model.prebuilt.load_prebuilt", broken)
    monkeypatch.setattr(sys, "stderr", stderr)
    assert main(["model", "info"]) == 0
    assert stderr.closed
