"""Models over the wire: whole, cut anywhere, resumed, damaged, refused. The old model stays until
the new one is proven."""

import random
import zlib

import pytest
from device_helpers import (
    QUIET,
    Damaging,
    dropping,
    empty_bank,
    frames,
    same,
    sim_board,
    sim_device,
    stats_of,
)

from eitskin.device.bank import bank_bytes
from eitskin.device.client import Device
from eitskin.device.simulated import SimBoard, SimTransport
from eitskin.device.wire import link_table as cmd
from eitskin.device.wire.link_table import ReplyStatus, Stream
from eitskin.device.wire.packets import RawFrame
from eitskin.errors import DeviceError, FileError, ModelError
from small_models import prebuilt, small_blob, tiny_blob

OLD = zlib.crc32(prebuilt()[1])


def new_blob() -> bytes:
    """A model of some pieces."""
    return small_blob(rank=21)


def works(board: SimBoard, crc: int) -> bool:
    """Whether the board, opened again, has the model and scans."""
    with Device(SimTransport("again", board)) as device:
        device.tare(4)
        raws = [item for item in device.stream(Stream.RAW, frames=1) if isinstance(item, RawFrame)]
        return device.board.model_crc == crc and len(raws) == 1


def test_a_model_is_taken_up():
    tiny = new_blob()
    seen: list[tuple[int, int]] = []
    board = sim_board()
    with sim_device(board) as device:
        device.tare(QUIET)
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
            cut = False
        except DeviceError as error:
            cut = True
            assert "the upload was cut after" in str(error) or "not answered" in str(error)
            assert "\n" not in str(error)
    new = zlib.crc32(tiny)
    if cut:
        rebooted = SimBoard(frames(), board.banks)
        assert works(rebooted, OLD)
    with Device(
        SimTransport("again", board)
    ) as device:  # without a reboot: goes on where it was cut, or begins again
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
    with Device(SimTransport("again", board)) as device:
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


def test_the_scan_waits_while_a_model_comes():
    tiny = tiny_blob()
    with sim_device() as device:
        device.send_command(cmd.ModelBegin(len(tiny), zlib.crc32(tiny)), 1.0)
        for act in (
            lambda: device.tare(4),
            lambda: next(device.stream(Stream.RAW)),
            device.self_test,
        ):
            with pytest.raises(
                DeviceError, match="the board is busy with MODEL_BEGIN; wait for it"
            ):
                act()


def status(device: Device, command: cmd.Command) -> tuple[ReplyStatus, int]:
    reply = device.send_command(command, 1.0)
    return ReplyStatus(reply.status), reply.detail[0]


def test_data_out_of_order_or_too_long_are_refused():
    tiny = tiny_blob()[:100]
    with sim_device() as device:
        assert status(device, cmd.ModelBegin(len(tiny), zlib.crc32(tiny))) == (ReplyStatus.OK, 0)
        assert status(device, cmd.ModelData(4, b"1234")) == (ReplyStatus.OFFSET, 0)
        assert status(device, cmd.ModelData(0, tiny[:5])) == (ReplyStatus.LENGTH, 12)
        assert status(device, cmd.ModelData(0, tiny[:8])) == (ReplyStatus.OK, 0)
        assert status(device, cmd.ModelData(0, tiny[:8])) == (ReplyStatus.OFFSET, 8)
        assert status(device, cmd.ModelData(8, bytes(len(tiny) - 4))) == (ReplyStatus.RANGE, 4)
        assert status(device, cmd.ModelCommit()) == (ReplyStatus.OFFSET, 8)
        assert device.info().model_crc == OLD


def sent(device: Device, blob: bytes, crc: int | None = None) -> tuple[ReplyStatus, int]:
    """Send ``blob`` past the host's own checks; how the board took it."""
    reply = device.send_command(
        cmd.ModelBegin(len(blob), zlib.crc32(blob) if crc is None else crc), 1.0
    )
    done = reply.detail[0]
    while reply.ok and done < len(blob):
        reply = device.send_command(cmd.ModelData(done, blob[done : done + 4096]), 1.0)
        done += 4096
    return (
        status(device, cmd.ModelCommit())
        if reply.ok
        else (ReplyStatus(reply.status), reply.detail[0])
    )


def test_the_board_itself_refuses_what_is_no_model():
    tiny = tiny_blob()
    wrong_bit = bytearray(tiny)
    wrong_bit[len(tiny) // 2] ^= 1
    with sim_device() as device:
        assert sent(device, tiny, crc=123) == (ReplyStatus.MODEL_CRC, 0)
        assert sent(device, b"x" * 400) == (ReplyStatus.MODEL_INVALID, -4)
        assert sent(device, bytes(wrong_bit)) == (ReplyStatus.MODEL_INVALID, -6)
        assert device.info().model_crc == OLD
        device.tare(4)
        assert sent(device, tiny) == (ReplyStatus.OK, 0)


def test_a_model_whose_golden_frame_gives_other_bits_is_refused():
    from eitskin.model.eitm import decode_model, encode_model

    model = decode_model(tiny_blob(), "tiny")
    from dataclasses import replace

    image = model.golden.image.copy()
    image[image.argmax()] *= 1.5
    with sim_device() as device:
        kind, parts = sent(
            device, encode_model(replace(model, golden=replace(model.golden, image=image)))
        )
        assert kind == ReplyStatus.SELF_TEST
        assert parts > 10**8
        assert device.info().model_crc == OLD
        with pytest.raises(DeviceError, match="golden frame's image differs from the model's by"):
            device.upload_model(
                encode_model(replace(model, golden=replace(model.golden, image=image)))
            )


def test_the_host_refuses_what_cannot_go_before_it_is_sent(tmp_path):
    board = sim_board()
    with sim_device(board) as device:
        before = stats_of(board).packets_sent
        with pytest.raises(FileError, match="no such model"):
            device.upload_model(tmp_path / "none.eitm")
        (tmp_path / "bad.eitm").write_bytes(b"no model at all")
        with pytest.raises(ModelError):
            device.upload_model(tmp_path / "bad.eitm")
        with pytest.raises(ModelError):
            device.upload_model(b"")
        with pytest.raises(DeviceError, match="needs 32 electrodes and the board has 16"):
            device.upload_model(small_blob(electrodes=32))
        assert stats_of(board).packets_sent == before + 1  # but for the first of these two


def test_a_model_too_large_for_the_bank_is_refused_by_the_host_and_by_the_board():
    room = len(tiny_blob()) + 32 - 16
    board = SimBoard(frames(), [bytes([0xFF]) * room, bytes([0xFF]) * room])
    with sim_device(board) as device:
        with pytest.raises(
            DeviceError, match=f"has {len(tiny_blob())} bytes and the board takes {room - 32}"
        ):
            device.upload_model(tiny_blob())
        assert status(device, cmd.ModelBegin(room - 31, 0)) == (ReplyStatus.MODEL_SIZE, room - 32)


def test_the_scan_of_more_electrodes_than_the_board_has_is_refused_by_the_board():
    with sim_device() as device:
        reply = sent(device, small_blob(electrodes=32))
        assert reply == (ReplyStatus.MODEL_SCAN, 32)
        assert device.info().model_crc == OLD


def test_generations_wrap():
    banks = [bank_bytes(prebuilt()[1], 2**32 - 1), empty_bank()]
    board = SimBoard(frames(), banks)
    with sim_device(board) as device:
        device.upload_model(tiny_blob())
    again = SimBoard(frames(), board.banks)
    with sim_device(again) as device:
        assert device.board.model_crc == zlib.crc32(tiny_blob())
