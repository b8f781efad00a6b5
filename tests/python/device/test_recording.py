"""Recordings: the received packets are read back, also after a kill; damage is counted; frames can
be exported for the other tools."""

import json
import random
import signal
import subprocess
import sys
import time
import zlib
from hashlib import sha256
from itertools import accumulate, count, islice
from pathlib import Path

import numpy as np
import pytest
from device_helpers import FRAMES, UNTOUCHED, Damaging, same, sim_board, sim_device

from eitskin.device.client import Device
from eitskin.device.open import open_device
from eitskin.device.recordings import new_file
from eitskin.device.recordings.recording import FileTransport, Recorder, read_head
from eitskin.device.simulated import SimTransport
from eitskin.device.wire.codec import Decoder, Packet, encode
from eitskin.device.wire.link_table import PacketType, Stream, StreamCommand
from eitskin.device.wire.packets import RawFrame, SolvedTouches
from eitskin.errors import DeviceError, FileError, FrameError
from eitskin.model.prebuilt import load_prebuilt
from eitskin.session.checks.raw_frames import frames_of
from small_models import prebuilt, tiny_blob

ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES


def record(path: Path, *, tare_first: bool = False) -> tuple[list[object], list[Packet]]:
    """Record a run with its tare; the items that the live run gave, and the packets."""
    packets: list[Packet] = []
    with sim_device() as device:
        if tare_first:
            device.tare(UNTOUCHED)
        with Recorder(path, device):
            device.record(packets.append)
            if not tare_first:
                device.send_command(StreamCommand(Stream.RAW, 0xFFFF), 1.0)
                device.tare(UNTOUCHED)
            device.start_scene()
            items = list(device.stream(ALL))
    return items, packets


def contents(item: object) -> list[object]:
    values = (value for value in vars(item).values())
    return [type(item), *(v.tobytes() if isinstance(v, np.ndarray) else v for v in values)]


def test_replay_equals_the_live_run(tmp_path):
    live, packets = record(tmp_path / "run.eits", tare_first=True)
    with open_device(f"file:{tmp_path / 'run.eits'}") as device:
        assert device.board.tared == 1
        replayed = list(device.stream(ALL))
        counters = device.counters
        assert counters.gaps == counters.crc_errors == counters.framing_errors == 0
    assert [contents(item) for item in replayed] == [contents(item) for item in live]
    assert len(live) == 3 * FRAMES
    read = Decoder().feed((tmp_path / "run.eits").read_bytes())
    assert read[0].type == PacketType.RECORDING
    assert read[1].type == PacketType.INFO
    assert read[2:] == packets


def test_the_head_says_where_it_comes_from(tmp_path):
    record(tmp_path / "run.eits")
    head = read_head(tmp_path / "run.eits")
    assert head == {
        "format": "eits", "version": 1, "eitskin": head["eitskin"], "url": "sim:test",
        "model_crc": f"{zlib.crc32(load_prebuilt()[1]):08x}",
        "sha256": {"model": sha256(load_prebuilt()[1]).hexdigest(), "firmware": None},
    }  # fmt: skip
    for noted in (None, 7, {}, {"model": "0x" + "1" * 62, "firmware": [1]}):
        head = json.dumps({"format": "eits", "version": 1, "sha256": noted}).encode()
        (tmp_path / "odd.eits").write_bytes(encode(PacketType.RECORDING, 0, head))
        found = FileTransport(tmp_path / "odd.eits").known_hashes.as_dict()
        assert found == {"model": None, "firmware": None}
    assert (tmp_path / "run.eits").read_bytes()[0] == 0


def test_kinds_and_every_nth_of_a_recording(tmp_path):
    live, _ = record(tmp_path / "run.eits", tare_first=True)
    raws = [item.frame for item in live if isinstance(item, RawFrame)]
    with open_device(f"file:{tmp_path / 'run.eits'}") as device:
        touches = list(device.stream(Stream.TOUCHES, every=3, frames=2))
    assert [type(item) for item in touches] == [SolvedTouches, SolvedTouches]
    assert [item.frame for item in touches] == [raws[0], raws[3]]


KILLED = """
import sys
sys.path[:0] = {paths!r}
from device_helpers import UNTOUCHED, sim_device
from eitskin.device.wire.link_table import Stream
from eitskin.device.recordings.recording import Recorder

with sim_device() as device:
    device.tare(UNTOUCHED)
    with Recorder(sys.argv[1], device):
        for item in device.stream(Stream(7)):  # the scene is not begun: it goes on for ever
            print(type(item).__name__, flush=True)
"""


@pytest.mark.parametrize(
    "seed",
    [
        0,
        pytest.param(1, marks=pytest.mark.long("seed 0")),
        pytest.param(2, marks=pytest.mark.long("seed 0")),
    ],
)
def test_a_killed_recorder_loses_at_most_the_last_packet(seed, tmp_path):
    path, here = tmp_path / "killed.eits", Path(__file__).resolve().parent
    script = KILLED.format(paths=[str(here), str(here.parent)])
    with subprocess.Popen(
        [sys.executable, "-c", script, path], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        reported = [child.stdout.readline().strip() for _ in range(30 + 20 * seed)]
        time.sleep(0.001 * random.Random(seed).random())
        child.kill()
        reported += child.stdout.read().split()
    assert child.returncode == -signal.SIGKILL
    with open_device(f"file:{path}") as device:
        replayed = list(device.stream(ALL))
        assert device.counters.gaps == device.counters.crc_errors == 0
        assert device.counters.framing_errors <= 1  # the packet that was being written
    assert [type(item).__name__ for item in replayed][: len(reported)] == reported
    with sim_device() as device:  # the same run again, live
        device.tare(UNTOUCHED)
        live = islice(device.stream(ALL), len(replayed))
        assert [contents(item) for item in replayed] == [contents(item) for item in live]


def test_cut_at_any_byte_the_rest_is_read_and_the_cut_is_counted(tmp_path):
    record(tmp_path / "run.eits")
    whole = (tmp_path / "run.eits").read_bytes()
    sizes = (len(encode(one.type, one.sequence, one.payload)) for one in Decoder().feed(whole))
    ends = list(accumulate(sizes))
    assert ends[-1] == len(whole) and len(ends) > 32
    cuts = random.Random(1).sample(range(ends[1], len(whole)), 60)
    for cut in [*cuts, *ends[1:8], ends[3] + 1, ends[4] - 1]:
        (tmp_path / "cut.eits").write_bytes(whole[:cut])
        with open_device(f"file:{tmp_path / 'cut.eits'}") as device:
            list(device.stream(ALL))
            # but for its last zero a packet is whole
            assert device.counters.packets == sum(end <= cut + (end == cut + 1) for end in ends)
            inside = not {cut - 1, cut, cut + 1} & set(ends)
            assert device.counters.framing_errors + device.counters.crc_errors == inside


def test_damage_inside_is_counted_and_told_as_a_gap(tmp_path):
    record(tmp_path / "run.eits", tare_first=True)
    data = bytearray((tmp_path / "run.eits").read_bytes())
    data[len(data) // 2] ^= 0x55
    (tmp_path / "hurt.eits").write_bytes(data)
    with open_device(f"file:{tmp_path / 'hurt.eits'}") as device:
        items = list(device.stream(ALL))
        assert device.counters.crc_errors + device.counters.framing_errors >= 1
        assert device.counters.gaps == 1
    assert sum(type(item).__name__ == "LinkEvent" for item in items) == 1
    assert 3 * FRAMES - 2 <= len(items) <= 3 * FRAMES


def test_gaps_of_the_live_run_are_in_the_recording(tmp_path):
    seen = 0

    def back(data: bytes) -> bytes:
        nonlocal seen
        seen += bool(data)
        return b"" if 5 < seen < 9 else data

    line = Damaging(SimTransport("gap", sim_board()), same, back)
    with Device(line) as device, Recorder(tmp_path / "run.eits", device):
        list(device.stream(Stream.RAW, frames=12))
        live = device.counters.missing
    assert live == 3
    with open_device(f"file:{tmp_path / 'run.eits'}") as device:
        list(device.stream(Stream.RAW))
        assert (device.counters.missing, device.counters.gaps) == (3, 1)


def test_frames_of_a_recording_without_an_untouched_frame(tmp_path):
    with sim_device() as device:
        device.tare(UNTOUCHED)
        with Recorder(tmp_path / "unquiet.eits", device):
            list(device.stream(Stream.RAW, frames=2))
    with pytest.raises(FrameError, match="no untouched frame"):
        frames_of(tmp_path / "unquiet.eits")


def test_a_recording_takes_no_commands(tmp_path):
    record(tmp_path / "run.eits")
    with open_device(f"file:{tmp_path / 'run.eits'}") as device:
        for act in (
            lambda: device.tare(4),
            device.stats,
            device.reset,
            lambda: device.upload_model(tiny_blob()),
        ):
            with pytest.raises(DeviceError, match=r"is a recording: .* needs a board"):
                act()


def test_another_model_than_the_recorded_boards_is_refused(tmp_path):
    record(tmp_path / "run.eits")
    with pytest.raises(DeviceError, match="--model FILE"):
        open_device(f"file:{tmp_path / 'run.eits'}", model=tiny_blob())
    with open_device(f"file:{tmp_path / 'run.eits'}", model=prebuilt()[1]) as device:
        assert device.board.has_model


def head_packet(**changes: object) -> bytes:
    head = {"format": "eits", "version": 1} | changes
    return encode(PacketType.RECORDING, 0, json.dumps(head).encode())


NONE, OTHER = "no eitskin recording", "first packet says something else"
NEWER = "recording version 2, this eitskin reads up to 1; upgrade eitskin"


@pytest.mark.parametrize(
    ("content", "kind", "message"),
    [
        (b"", FileError, NONE),
        (b"text that is none\n" * 100, FileError, NONE),
        (bytes(5000), FileError, NONE),
        (encode(PacketType.INFO, 0, b"1234"), FileError, NONE),
        (encode(PacketType.RECORDING, 0, b"{"), FileError, OTHER),
        (encode(PacketType.RECORDING, 0, b"[1]"), FileError, OTHER),
        (head_packet(format="edf"), FileError, OTHER),
        (head_packet(version="1"), FileError, OTHER),
        (head_packet(version=2), DeviceError, NEWER),
        (head_packet(), DeviceError, "holds no INFO of its board"),
        (head_packet()[:-3], FileError, "cut in its first bytes"),
    ],
)
def test_what_is_no_recording(content, kind, message, tmp_path):
    (tmp_path / "bad.eits").write_bytes(content)
    with pytest.raises(kind) as caught:
        open_device(f"file:{tmp_path / 'bad.eits'}")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_or_written(tmp_path):
    with pytest.raises(FileError, match="no such recording"):
        open_device(f"file:{tmp_path / 'none.eits'}")
    with pytest.raises(FileError, match="cannot read this recording"):
        open_device(f"file:{tmp_path}")
    (tmp_path / "there.eits").write_bytes(b"precious")
    with sim_device() as device:
        with pytest.raises(FileError, match="exists already; name another file"):
            Recorder(tmp_path / "there.eits", device)
        with pytest.raises(FileError, match="cannot write it"):
            Recorder(tmp_path / "no" / "such.eits", device)
        Recorder(tmp_path / "there.eits", device, overwrite=True).close()
    assert (tmp_path / "there.eits").read_bytes() != b"precious"


def test_a_full_disk_ends_the_recording_with_an_error():
    with sim_device() as device, pytest.raises(FileError, match="the part so far can be read"):
        Recorder("/dev/full", device, overwrite=True)


def test_a_recording_of_a_recording_is_its_equal(tmp_path):
    one, two = tmp_path / "one.eits", tmp_path / "two.eits"
    record(one)
    with open_device(f"file:{one}") as device, Recorder(two, device):
        list(device.stream(ALL))
    assert Decoder().feed(one.read_bytes())[2:] == Decoder().feed(two.read_bytes())[2:]


def test_a_second_recorder_on_the_same_file_is_refused(tmp_path):
    path = tmp_path / "run.eits"
    with sim_device() as one, sim_device() as two:
        with Recorder(path, one):
            before = path.read_bytes()
            with pytest.raises(FileError, match="another process records to it"):
                Recorder(path, two, overwrite=True)
            assert path.read_bytes() == before
        Recorder(path, two, overwrite=True).close()
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.eits"]


def test_the_old_recording_stays_until_the_new_one_has_begun(tmp_path, monkeypatch):
    path = tmp_path / "run.eits"
    path.write_bytes(b"old")
    path.chmod(0o640)

    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    with sim_device() as device:
        with monkeypatch.context() as patch:
            patch.setattr("eitskin.device.recordings.new_file.replace_by", full)
            with pytest.raises(FileError, match="cannot write it"):
                Recorder(path, device, overwrite=True)
        assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]
        Recorder(path, device, overwrite=True).close()
    assert read_head(path)["format"] == "eits" and path.stat().st_mode & 0o777 == 0o640


def test_recordings_follow_links_and_leave_devices_alone(tmp_path):
    (tmp_path / "link.eits").symlink_to(tmp_path / "run.eits")
    with sim_device() as device:
        Recorder(tmp_path / "link.eits", device, overwrite=True).close()
        Recorder(Path("/dev/null"), device).close()
    assert (tmp_path / "link.eits").is_symlink() and Path("/dev/null").is_char_device()
    assert read_head(tmp_path / "run.eits")["format"] == "eits"


def test_a_recording_is_brought_to_the_disk_now_and_then(tmp_path, monkeypatch):
    """Its clock is put forward by half a second a packet."""
    synced, clock = [], count(step=0.5)
    monkeypatch.setattr(new_file.time, "monotonic", lambda: next(clock))
    file = new_file.RecordingFile(tmp_path / "run.eits", b"", overwrite=False)
    monkeypatch.setattr(new_file.os, "fsync", synced.append)
    for _ in range(20):
        file.write(b"packet")
        file.sync_now_and_then()
        if file._syncing is not None:
            file._syncing.join()
    file.close()
    assert 6 <= len(synced) <= 11
