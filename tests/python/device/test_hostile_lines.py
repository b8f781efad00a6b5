"""Packets, lines and numbers that are not what they seem, and disks without room."""

import csv
import json
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from device_helpers import frames

from eitskin.cli.main import main
from eitskin.device.open import open_device
from eitskin.device.recordings import new_file
from eitskin.device.recordings.new_file import RecordingFile, WaitingFile
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import SolvedImage, SolvedTouches
from eitskin.device.wire.payloads import MalformedPacket, parse_image, parse_touches
from eitskin.errors import FileError, UsageError, printable
from eitskin.session.session import Session
from eitskin.skin.protocol import adjacent


def payloads() -> Iterator[tuple[type, bytes]]:
    """A frame's touches and image as a board sends them."""
    kinds = {SolvedTouches: "TOUCHES", SolvedImage: "IMAGE"}
    came: dict[str, bytes] = {}
    with open_device("sim:two_touch") as board:
        board.tare(16)
        board.start_scene()
        board.record(lambda packet: came.__setitem__(str(packet.type), packet.payload))
        list(board.stream(Stream.TOUCHES | Stream.IMAGE, frames=3))
    from eitskin.device.wire.link_table import PacketType

    for kind, name in kinds.items():
        yield kind, came[str(int(PacketType[name]))]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_no_float_of_a_packet_may_be_other_than_a_number(value):
    """Every word that holds a float, one after the other; words that are whole numbers are left."""
    for kind, good in payloads():
        parse = parse_touches if kind is SolvedTouches else parse_image
        plain, refused = parse(good), 0
        for at in range(0, len(good) - 3, 4):
            bad = good[:at] + struct.pack("<f", value) + good[at + 4 :]
            try:
                found = parse(bad)
            except MalformedPacket:
                refused += 1
                continue
            text = json.dumps(found.solved.as_dict(), allow_nan=False)
            assert text and np.isfinite(getattr(found, "image", np.zeros(1))).all()
        assert refused > len(getattr(plain, "image", plain.solved.as_dict())) / 3


# ---- lines ----

LAYOUT = '[lines]\ndelimiter = "comma"\n{more}\n[protocol]\nelectrodes = 16\nkind = "adjacent"\n'


def lines(count: int = 8) -> list[str]:
    rows = frames().rows(adjacent(16))
    volts = rows.around(0)[1][0]
    return [",".join(f"{v:.7g}" for v in np.ravel(volts)) for _ in range(count)]


@pytest.mark.parametrize("more", ["", 'columns = "0:208"', "cells = 208"])
@pytest.mark.parametrize("first", ["1.5", "-0.25,0.5,0.125", "7,8\n9"])
def test_a_first_line_that_is_cut_is_skipped(tmp_path, more, first):
    (tmp_path / "layout.toml").write_text(LAYOUT.format(more=more))
    (tmp_path / "lines.csv").write_text("\n".join([first, *lines()]) + "\n")
    with open_device(f"text:{tmp_path}/lines.csv?layout={tmp_path}/layout.toml") as device:
        assert len([one for one in device.stream(Stream.RAW) if hasattr(one, "voltage_v")]) == 8
        assert device.counters.lines_skipped == 1 + first.count("\n")


# ---- numbers as people write them ----


@pytest.mark.parametrize("speed", ["1e-12", "1e-300", "0.0009", "1_0", "-1", "nan", "inf", "１"])
def test_speeds_that_cannot_be(speed):
    with pytest.raises(UsageError, match=r"speed must be 0\.001 to 1000, or 0 or max"):
        Session(f"sim:swipe?speed={speed}")


@pytest.mark.parametrize("speed", [1e-12, -1.0, float("nan"), 1e9])
def test_speeds_of_programs_that_cannot_be(speed):
    with pytest.raises(UsageError, match="speed must be"):
        Session("sim:swipe", speed=speed)


@pytest.mark.parametrize(
    "option", [["--frames", "1_0"], ["--excitation-hz", "5_0"], ["--every", "２"]]
)
def test_options_take_plain_numbers(option, capsys):
    assert main(["stream", "--device", "sim:swipe", *option]) == 2
    assert "invalid" in capsys.readouterr().err


def test_names_are_printed_without_what_a_terminal_obeys():
    assert printable("a\x1b[31m\nb\u202ec") == "a\\x1b[31m\\nb\\u202ec"


# ---- a disk that is full for a while ----


class Disk:
    """Takes ``room`` bytes in all; the last ones of a write that does not fit are missing."""

    def __init__(self, monkeypatch) -> None:
        self.room = 1 << 40
        disk, real_open = self, Path.open

        class Limited:
            def __init__(self, file) -> None:
                self._file = file

            def write(self, data: bytes) -> int:
                fits = min(len(data), disk.room)
                disk.room -= fits
                if fits == 0 and data:
                    raise OSError(28, "No space left on device")
                return int(self._file.write(data[:fits]))

            def __getattr__(self, name: str):
                return getattr(self._file, name)

        def limited(path, mode="r", *more, **named):
            file = real_open(path, mode, *more, **named)
            return Limited(file) if mode == "xb" else file

        monkeypatch.setattr(Path, "open", limited)


def test_a_torn_write_is_taken_back(monkeypatch, tmp_path):
    disk = Disk(monkeypatch)
    file = RecordingFile(tmp_path / "a", b"begin\n", overwrite=False)
    disk.room = 3
    with pytest.raises(FileError, match="No space left"):
        file.write(b"second\n")
    disk.room = 100
    file.write(b"third\n")
    file.close()
    assert (tmp_path / "a").read_bytes() == b"begin\nthird\n"


def test_what_finds_no_room_waits_and_is_written_in_order(monkeypatch, tmp_path):
    disk = Disk(monkeypatch)
    file = WaitingFile(RecordingFile(tmp_path / "a", b"", overwrite=False))
    expected, said = b"", 0
    for k in range(100):
        disk.room = 5 if 20 <= k < 50 else 1000
        line = f"line {k}\n".encode()
        expected += line
        file.write(line)
        try:
            file.check()
        except FileError:
            said += 1
        assert file.tell() == len(expected)
    file.close()
    assert (tmp_path / "a").read_bytes() == expected and said == 1


def test_a_disk_that_stays_full_ends_the_file_at_a_whole_line(monkeypatch, tmp_path):
    monkeypatch.setattr(new_file, "MAX_WAITING", 100)
    disk = Disk(monkeypatch)
    file = WaitingFile(RecordingFile(tmp_path / "a", b"", overwrite=False))
    texts = []
    for k in range(40):
        disk.room = 1000 if k < 5 else 3
        file.write(f"line {k}\n".encode())
        try:
            file.check()
        except FileError as error:
            texts.append(str(error))
    disk.room = 1000
    file.write(b"late\n")
    with pytest.raises(FileError, match="the file ends there"):
        file.check()
    file.close()
    assert (tmp_path / "a").read_text() == "".join(f"line {k}\n" for k in range(5))
    assert "No space left" in texts[0] and "full for too long" in texts[-1]


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_sinks_lose_nothing_to_a_disk_that_is_full_for_a_while(kind, monkeypatch, tmp_path):
    disk, path = Disk(monkeypatch), tmp_path / f"touches.{kind}"
    command = ["stream", "--device", "sim:swipe", "--mode", "touches,image", "--json"]
    write = WaitingFile.write
    calls = iter(range(10**9))

    def filling(self: WaitingFile, data: bytes) -> int:
        disk.room = 50 if 3 < next(calls) < 8 else 1 << 30
        return write(self, data)

    monkeypatch.setattr(WaitingFile, "write", filling)
    assert main([*command, "--to", f"{kind}:{path}"]) == 0
    if kind == "csv":
        with path.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
        numbers = [int(row["frame"]) for row in rows]
        assert sorted(set(numbers)) == list(range(numbers[0], numbers[0] + len(set(numbers))))
        assert len(set(numbers)) >= 39 and all(len(row) == len(rows[0]) for row in rows)
        return
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        topics = [channel.topic for _, channel, _ in make_reader(stream).iter_messages()]
    assert topics.count("/touches") >= 39
