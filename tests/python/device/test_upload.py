"""Models over the wire: whole, cut anywhere, resumed, damaged, refused. The old model stays until
the new one is proven."""

import random
import zlib
from dataclasses import replace
from functools import cache

import pytest
from device_helpers import (
    UNTOUCHED,
    Damaging,
    dropping,
    frames,
    raw_frames,
    same,
    sim_board,
    sim_device,
    stats_of,
)

from eitskin.device.client import Device
from eitskin.device.open import open_device
from eitskin.device.simulated import SimBoard, SimTransport
from eitskin.device.wire import link_table as cmd
from eitskin.errors import DeviceError, FileError, ModelError
from eitskin.model.build import BuildSettings, linearise, make_model
from eitskin.model.eitm import decode_model, encode_model
from small_models import prebuilt, small, small_blob, tiny_blob

OLD = zlib.crc32(prebuilt()[1])


def new_blob() -> bytes:
    """A model of some pieces."""
    return small_blob(rank=21)


def works(board: SimBoard, crc: int) -> bool:
    """Whether the board, opened again, has the model and scans."""
    with sim_device(board) as device:
        device.tare(4)
        return device.board.model_crc == crc and len(raw_frames(device, 1)) == 1


def test_a_model_is_taken_up():
    tiny = new_blob()
    seen: list[tuple[int, int]] = []
    board = sim_board()
    with sim_device(board) as device:
        device.tare(UNTOUCHED)
        info = device.upload_model(tiny, lambda done, total: seen.append((done, total)))
        found = info.model_crc, info.model_bytes, info.bank, info.tared
        assert found == (zlib.crc32(tiny), len(tiny), 1, 0)
        assert seen[-1] == (len(tiny), len(tiny))
        assert len(seen) > 3
        assert [done for done, _ in seen] == [*range(4096, len(tiny), 4096), len(tiny)]
        back = device.upload_model(prebuilt()[1])
        assert (back.model_crc, back.bank) == (OLD, 0)
    assert [int.from_bytes(bank[-28:-24], "little") for bank in board.banks] == [3, 2]
    assert works(board, OLD)


def test_into_a_board_without_a_model():
    with sim_device(sim_board(no_model=True)) as device:
        info = device.upload_model(tiny_blob())
        assert (info.model_crc, info.bank, info.fault_codes) == (zlib.crc32(tiny_blob()), 0, ())


@pytest.mark.parametrize("seed", range(8))
def test_cut_at_any_byte_the_old_model_stays_and_the_next_upload_ends_it(seed):
    generator, tiny = random.Random(seed), new_blob()
    board, whole = sim_board(), len(tiny) + 2000
    left = generator.randrange(1, whole)

    def there(data: bytes) -> bytes:
        nonlocal left
        passed, left = data[: max(left, 0)], left - len(data)
        return passed

    with Device(Damaging(SimTransport("cut", board), same, same)) as device:
        device.transport._there = there
        try:
            device.upload_model(tiny)
        except DeviceError as error:
            assert "the upload was cut after" in str(error) or "not answered" in str(error)
            assert "\n" not in str(error)
            assert works(SimBoard(frames(), board.banks), OLD)  # a reboot
    new = zlib.crc32(tiny)
    with sim_device(board) as device:
        # without a reboot the upload continues where it was cut, or begins again
        assert device.board.model_crc in (OLD, new)
        if device.board.model_crc == OLD:
            assert device.upload_model(tiny).model_crc == new
    assert works(board, new)


@pytest.mark.parametrize("seed", range(8))
def test_over_a_lossy_line(seed):
    generator, tiny = random.Random(100 + seed), new_blob()
    board = sim_board()
    with Device(Damaging(SimTransport("lossy", board), same, same)) as device:
        transport = device.transport
        transport._there, transport._back = dropping(generator, 0.15), dropping(generator, 0.15)
        for _ in range(20):
            try:
                device.upload_model(tiny)
                break
            except DeviceError as error:
                assert "not answered" in str(error) or "cut after" in str(error)
    with sim_device(board) as device:
        assert device.board.model_crc == zlib.crc32(tiny)
        bank = board.banks[device.board.bank]
    assert bank[: len(tiny)] == tiny


def test_an_upload_goes_on_where_it_was_cut():
    tiny, board = new_blob(), sim_board()
    with sim_device(board) as device:
        assert device.send_command(cmd.ModelBegin(len(tiny), zlib.crc32(tiny)), 1.0).ok
        assert device.send_command(cmd.ModelData(0, tiny[:2048]), 1.0).ok
    with sim_device(board) as device:
        seen: list[int] = []
        device.upload_model(tiny, lambda done, total: seen.append(done))
        assert seen[0] == 2048 + 4096
        assert device.board.model_crc == zlib.crc32(tiny)


def test_a_model_whose_golden_frame_gives_other_bits_is_refused():
    model = decode_model(tiny_blob(), "tiny")
    image = model.golden.image.copy()
    image[image.argmax()] *= 1.5
    wrong = encode_model(replace(model, golden=replace(model.golden, image=image)))
    said = "golden frame's image differs from the model's by"
    with sim_device() as device, pytest.raises(DeviceError, match=said):
        device.upload_model(wrong)


def test_the_host_refuses_what_cannot_go_before_it_is_sent(tmp_path):
    board = sim_board()
    (tmp_path / "bad.eitm").write_bytes(b"no model at all")
    with sim_device(board) as device:
        before = stats_of(board).packets_sent
        device.board = replace(device.board, electrodes=16)
        for given, kind, said in (
            (tmp_path / "none.eitm", FileError, "no such model"),
            (tmp_path / "bad.eitm", ModelError, None),
            (b"", ModelError, None),
            (small_blob(electrodes=32), DeviceError, "needs 32 electrodes and the board has 16"),
        ):
            with pytest.raises(kind, match=said):
                device.upload_model(given)
        assert stats_of(board).packets_sent == before + 1  # but for the first of these two


def test_a_model_too_large_for_the_bank_is_refused_by_the_host():
    room = len(tiny_blob()) + 32 - 16
    board = SimBoard(frames(), [bytes([0xFF]) * room, bytes([0xFF]) * room])
    said = f"has {len(tiny_blob())} bytes and a bank of the board holds {room - 32}"
    with sim_device(board) as device, pytest.raises(DeviceError, match=said):
        device.upload_model(tiny_blob())


def test_32_electrodes_are_live_behind_an_instrument_that_sends_lines(tmp_path):
    model = decode_model(small_blob(electrodes=32), "the model")
    volts = ",".join(f"{one:.6g}" for one in model.golden.reference_v)
    (tmp_path / "lines.csv").write_text(f"{volts}\n" * 12)
    (tmp_path / "layout.toml").write_text("[port]\nrate_hz = 10\n")
    url = f"text:{tmp_path / 'lines.csv'}?layout={tmp_path / 'layout.toml'}"
    with open_device(url, model=small_blob(electrodes=32)) as device:
        assert (device.board.n_electrodes, device.board.n_rows) == (32, 928)
        device.tare(4)
        (frame,) = device.stream(cmd.Stream.RAW, frames=1)
    assert frame.voltage_v == pytest.approx(model.golden.reference_v, rel=1e-5)


@pytest.mark.parametrize(
    ("blob", "said"),
    [
        (
            lambda: fine_blob("i8"),
            r"4\d{3} pixels, 208 rows, rank 8\) does not fit .* pixels",
        ),
        (
            lambda: fine_blob("f32", 64),
            r"the model has \d+ bytes and a bank of the board holds 524256; .* --storage i8",
        ),
    ],
)
@pytest.mark.parametrize("kind", ["sim", "text"])
def test_a_model_that_a_simulated_board_cannot_use_is_named(kind, blob, said, tmp_path):
    """Before, the board "had no model", and advised to upload one."""
    url = "sim:two_touch"
    if kind == "text":
        (tmp_path / "lines.csv").write_text(",".join(["1"] * 208) + "\n")
        (tmp_path / "layout.toml").write_text("[port]\nrate_hz = 10\n")
        url = f"text:{tmp_path / 'lines.csv'}?layout={tmp_path / 'layout.toml'}"
    with pytest.raises(DeviceError, match=said):
        open_device(url, model=blob())


@cache
def fine_blob(storage: str, rank: int = 8) -> bytes:
    """Return a model with more pixels than the image of a packet can have."""
    s = small()
    linear = linearise(s.skin, s.protocol, pixels_across=76, elements=900)
    settings = BuildSettings(rank=rank, storage=storage)
    return encode_model(make_model(s.skin, s.protocol, linear, settings))
