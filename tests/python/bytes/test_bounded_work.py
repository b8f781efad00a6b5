"""Small files that would cause much work or memory are refused before it is done, with one line
that says what is too much."""

import io
import math
import zipfile
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

from eitskin.config import load_toml
from eitskin.errors import ConfigError, EitskinError, FileError, FrameError
from eitskin.fileio import read_bytes
from eitskin.frames.arrays import MAX_RATIO, read_npz
from eitskin.frames.frames import Frames, load_frames, save_frames
from eitskin.skin.drawing import joined, read_drawing
from eitskin.skin.drawing_shapes import DrawingReading, DrawnShape
from eitskin.skin.protocol import adjacent
from eitskin.teaching.presses import load_presses


def refused(path: Path, kind: type[EitskinError], *words: str) -> None:
    with pytest.raises(kind) as caught:
        if path.suffix == ".toml":
            load_toml(path, "skin")
        elif path.suffix == ".npz":
            load_frames(path)
        else:
            read_drawing(path, DrawingReading())
    text = str(caught.value)
    assert str(path) in text and "\n" not in text and all(word in text for word in words), text


@pytest.mark.parametrize(
    "key",
    [
        ".".join(["a"] * 20_000),
        " . ".join(['"a b"', "c", "'d'"] * 11),
        f"[{'.'.join(['a'] * 33)}]\nb",
    ],
)
def test_keys_of_thousands_of_parts(tmp_path, key):
    path = tmp_path / "skin.toml"
    path.write_text(f"{key} = 1\n")
    refused(path, ConfigError, "a key of over 32 parts")


def test_dots_that_are_no_keys_are_no_matter(tmp_path):
    path = tmp_path / "skin.toml"
    path.write_text(f'a = "{"." * 100}" # {"... " * 50}\nb = [{"1.5, " * 1000}]\n')
    assert len(load_toml(path, "skin")["b"]) == 1000


@pytest.mark.parametrize(("name", "megabytes"), [("skin.toml", 1), ("a.svg", 2), ("a.dxf", 2)])
def test_files_of_many_megabytes(tmp_path, name, megabytes):
    path = tmp_path / name
    path.write_bytes(b" " * (megabytes * 1_000_000 + 1))
    refused(path, FileError, f"over {megabytes} MB")


def test_a_device_without_end_is_read_up_to_the_limit():
    with pytest.raises(FileError, match=r"/dev/zero: over 0\.001 MB, more than a model may have"):
        read_bytes("/dev/zero", "model", 1000)


def packed(path: Path, **arrays: Any) -> None:
    """An .npz of a plain frame and ``arrays``."""
    save_frames(path, Frames(adjacent(8), np.ones((1, 40)), np.ones((1, 40)), ("one",)))
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            stream = io.BytesIO()
            np.save(stream, array)
            archive.writestr(f"{name}.npy", stream.getvalue())


def test_an_archive_that_unpacks_to_far_more(tmp_path):
    path = tmp_path / "frames.npz"
    packed(path, time_s=np.zeros(16_000_000))
    assert path.stat().st_size < 128e6 / MAX_RATIO
    refused(path, FileError, "would unpack to 1280", "split it")


def test_fields_that_are_not_known_are_not_unpacked(tmp_path, monkeypatch):
    path, read = tmp_path / "frames.npz", []
    packed(path, unknown=np.zeros(1000))

    class Noted(np.lib.npyio.NpzFile):
        def __getitem__(self, key: str) -> Any:
            read.append(key)
            return super().__getitem__(key)

    with path.open("rb") as stream:
        archive = Noted(stream, allow_pickle=False)
        monkeypatch.setattr("eitskin.frames.frames.np.load", lambda *a, **k: archive)
        monkeypatch.setattr("eitskin.frames.frames.np.lib.npyio.NpzFile", Noted)
        refused(path, FrameError, "unknown field 'unknown'")
    assert "voltage_v" in read and "unknown" not in read


def test_ten_thousand_arrays(tmp_path):
    path = tmp_path / "many.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(10_001):
            archive.writestr(f"{k}.npy", b"")
    with pytest.raises(FileError, match="10001 arrays, over 10000"):
        read_npz(path, "file of arrays")


def test_style_sheets_of_comments(tmp_path):
    path = tmp_path / "a.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm">'
        f"<style>{'/*' * 50_000}</style><path d='M0 0h9v9z'/></svg>"
    )
    refused(path, ConfigError, "style sheets over 10000 characters")


@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        ("<path d='M0 0%sz'/>" % ("A8 8 0 0 0 59 20" * 6000), "numbers and letters"),
        ("<path transform='%s' d='M0 0h9v9z'/>" % ("rotate(1)" * 6000), "numbers and letters"),
        ("<path d='M0 0%s'/>" % ("h1z" * 120), "numbers and letters"),
        ("<path id='a' d='M0 0%sz'/>" % ("h1" * 100) + "<use href='#a'/>" * 300, "numbers and"),
        ("<path d='M0 0%sz'/>" % ("c1e9 0 5e8 9e8 3 3" * 100), "over 30000 points"),
        ("<circle cx='1' cy='1' r='1e9'/>" * 100, "over 30000 points"),
        ("<path style='%s' d='M0 0h9v9z'/>" % ("a:b;" * 3000), "style sheets over 10000"),
    ],
)
def test_paths_that_ask_for_much_work(tmp_path, drawn, words):
    path = tmp_path / "a.svg"
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm">{drawn}</svg>'
    )
    refused(path, ConfigError, words)


def test_splines_of_a_million_points(tmp_path):
    document = ezdxf.new()
    document.header["$INSUNITS"] = 6
    for k in range(20):
        document.modelspace().add_circle((k, 0), 1e3)
    document.saveas(tmp_path / "a.dxf")
    refused(tmp_path / "a.dxf", ConfigError, "over 30000 points")


def test_presses_that_unpack_to_far_more(tmp_path):
    path = tmp_path / "presses.npz"
    np.savez_compressed(path, untouched=np.zeros(60_000_000))
    with pytest.raises(FileError, match="would unpack to 480000"):
        load_presses(path)


@pytest.mark.parametrize("drawn", [True, False])
def test_arrays_of_a_million_blocks(tmp_path, drawn):
    """A million blocks are refused even if they are empty, because each would be made."""
    document = ezdxf.new()
    document.header["$INSUNITS"] = 4
    block = document.blocks.new("B")
    if drawn:
        block.add_line((0, 0), (1, 1))
    counts = {"row_count": 1000, "column_count": 1000, "row_spacing": 1, "column_spacing": 1}
    document.modelspace().add_blockref("B", (0, 0), dxfattribs=counts)
    document.saveas(tmp_path / "a.dxf")
    refused(tmp_path / "a.dxf", ConfigError, "over 20000 entities")


def test_blocks_in_a_circle(tmp_path):
    document = ezdxf.new()
    document.header["$INSUNITS"] = 4
    document.blocks.new("B").add_blockref("B", (0, 0))
    document.modelspace().add_blockref("B", (0, 0))
    document.saveas(tmp_path / "a.dxf")
    refused(tmp_path / "a.dxf", ConfigError, "blocks within each other, over 100 deep")


def test_lines_are_joined_with_work_in_proportion(monkeypatch):
    """Ends that are looked at: a few for each line, not all others'."""
    looked = [0]

    def counted(a: Any, b: Any) -> bool:
        looked[0] += 1
        return math.dist(a, b) <= 0.01

    monkeypatch.setattr("eitskin.skin.drawing._meet", counted)
    angles = np.linspace(0, 2 * np.pi, 501)
    rim = 50 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    pieces = [DrawnShape("", frozenset(), rim[k : k + 2], False) for k in range(500)]
    closed = joined([pieces[(7 * k) % 500] for k in range(500)])
    assert len(closed) == 1 and len(closed[0].points_mm) == 500
    assert looked[0] < 10 * 500
