"""A simulated board: the scene's frames through the host core, with the firmware's commands, checks
and replies."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest
from device_helpers import FRAMES, QUIET, empty_bank, fresh_skin, scene, sim_board, sim_device

from eitskin.core.findings import ALL_FINDINGS
from eitskin.device.bank import bank_bytes
from eitskin.device.client import Device
from eitskin.device.known_model import board_options
from eitskin.device.simulated.board import SimBoard
from eitskin.device.simulated.transport import SimTransport
from eitskin.device.wire import commands as cmd
from eitskin.device.wire.packets import (
    Fault,
    FaultCode,
    Quality,
    RawFlags,
    RawFrame,
    ReplyStatus,
    SolvedImage,
    SolvedTouches,
    Stream,
)
from eitskin.errors import DeviceError, UsageError
from eitskin.scene.compiler import compile_scene
from eitskin.scene.runner import simulate_frames
from eitskin.solve.options import default_options
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt, tiny_blob

ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES


def by_kind(items: list[object], kind: type) -> list[object]:
    return [item for item in items if isinstance(item, kind)]


def test_frames_and_results_are_those_of_the_host_core_bit_for_bit() -> None:
    model, blob = prebuilt()
    with sim_device() as device:
        device.tare(QUIET)
        device.start_scene()
        items = list(device.stream(ALL))
    raws, images, touches = (
        by_kind(items, kind) for kind in (RawFrame, SolvedImage, SolvedTouches)
    )
    assert len(raws) == len(images) == len(touches) == FRAMES
    assert [type(item) for item in items[:3]] == [RawFrame, SolvedImage, SolvedTouches]
    true = simulate_frames(compile_scene(scene())).voltage_v.astype(np.float32)
    assert all(
        raw.voltage_v.tobytes() == frame.tobytes()
        for raw, frame in zip(raws, true[QUIET:], strict=True)
    )
    skin = Reconstructor(model, blob=blob, options=board_options(model))
    skin.tare(true[:QUIET])
    for raw, image, found in zip(raws, images, touches, strict=True):
        result = skin.reconstruct(raw.voltage_v)
        assert image.image.tobytes() == result.image.astype(np.float32).tobytes()
        assert found.touches == result.touches
        assert image.solved.iterations == found.solved.iterations == result.info.iterations
        assert found.solved.macs == result.info.macs
        assert raw.frame == image.frame == found.frame
    assert len(touches[-1].touches) == 1
    assert np.hypot(touches[-1].touches[0].x_mm + 40, touches[-1].touches[0].y_mm - 10) < 3


def test_two_runs_are_the_same_bytes() -> None:
    def run() -> bytes:
        board = sim_board()
        transport, seen = SimTransport("test", board), bytearray()
        plain = transport.read
        transport.read = lambda timeout_s: seen.extend(data := plain(timeout_s)) or data  # type: ignore[method-assign]
        with Device(transport) as device:
            device.tare(QUIET)
            device.start_scene()
            list(device.stream(ALL, every=2))
            device.stats()
        return bytes(seen)

    assert run() == run()


def test_the_skin_is_untouched_until_the_scene_begins() -> None:
    with sim_device() as device:
        quiet = [
            item
            for item in device.stream(Stream.RAW, frames=2 * QUIET)
            if isinstance(item, RawFrame)
        ]
        assert [q.voltage_v.tobytes() for q in quiet[:QUIET]] == [
            q.voltage_v.tobytes() for q in quiet[QUIET:]
        ]
        device.tare(QUIET)
        device.start_scene()
        touched = next(item for item in device.stream(Stream.RAW) if isinstance(item, RawFrame))
    rms, change = (
        float(np.sqrt(np.mean(quiet[0].voltage_v ** 2))),
        np.abs(touched.voltage_v - quiet[0].voltage_v),
    )
    assert change.max() > 0.02 * rms > np.abs(quiet[1].voltage_v - quiet[0].voltage_v).max()


def test_board_time_is_the_scenes_and_the_scene_ends() -> None:
    with sim_device() as device:
        assert device.board.frame_period_us == 50_000
        device.start_scene()
        raws = by_kind(list(device.stream(Stream.RAW)), RawFrame)
        assert [raw.time_us for raw in raws] == [50_000 * k for k in range(FRAMES)]
        assert [raw.frame for raw in raws] == list(range(FRAMES))
        assert device.transport.ended
        assert list(device.stream(Stream.RAW)) == []
        assert device.stats().frames_scanned == FRAMES  # commands are still answered


def test_a_faster_scan_sees_scene_frames_more_than_once() -> None:
    with sim_device() as device:
        device.scan(frame_period_us=0)
        assert device.board.frame_us == 20_800
        device.start_scene()
        raws = by_kind(list(device.stream(Stream.RAW)), RawFrame)
    assert [raw.time_us for raw in raws] == [20_800 * k for k in range(len(raws))]
    assert len({raw.voltage_v.tobytes() for raw in raws}) == FRAMES
    assert len(raws) == 23  # until 20.8 ms k is nearer to frame 10 than to 9
    assert raws[0].scan_us == 207 * 100 + 80


def test_every_nth_frame_and_so_many() -> None:
    with sim_device() as device:
        device.start_scene()
        raws = by_kind(list(device.stream(Stream.RAW, every=3, frames=2)), RawFrame)
        assert [raw.frame for raw in raws] == [0, 3]
        assert device.info().streaming == 0


def test_reciprocal_scans_copy_what_they_do_not_measure() -> None:
    model = prebuilt()[0]
    with sim_device() as device:
        device.scan(check_every=3)
        device.start_scene()
        raws = by_kind(list(device.stream(Stream.RAW, frames=4)), RawFrame)
    assert [raw.flags for raw in raws] == [
        RawFlags.CHECK,
        RawFlags.RECIPROCAL,
        RawFlags.RECIPROCAL,
        RawFlags.CHECK,
    ]
    assert [raw.scan_us for raw in raws] == [
        207 * 100 + 80,
        103 * 100 + 80,
        103 * 100 + 80,
        207 * 100 + 80,
    ]
    for raw in raws:
        first, second = raw.voltage_v[model.fold.first], raw.voltage_v[model.fold.second]
        assert np.array_equal(second, model.fold.sign.astype(np.float32) * first)
        assert set(raw.quality[model.fold.second]) == {int(Quality.COPIED)}
        assert set(raw.quality[model.fold.first]) == {0}


def test_masked_rows_are_left_out() -> None:
    with sim_device() as device:
        device.mask_row(5)
        device.tare(QUIET)
        device.start_scene()
        items = list(device.stream(ALL, frames=2))
        raw, image = by_kind(items, RawFrame)[0], by_kind(items, SolvedImage)[0]
        assert np.isnan(raw.voltage_v[5])
        assert raw.quality[5] == Quality.MASKED
        assert np.isfinite(np.delete(raw.voltage_v, 5)).all()
        assert image.solved.masked == 1
        assert np.isfinite(image.image).all()
        device.mask_row(5, bad=False)
        device.tare(4)
        assert by_kind(list(device.stream(ALL, frames=1)), SolvedImage)[0].solved.masked == 0


def test_quiet_frames_are_streamed_and_marked_where_raw_is() -> None:
    with sim_device() as device:
        device.send_command(cmd.StreamCommand(Stream.RAW, 1000), 1.0)
        device.tare(QUIET)
        kept = []
        while (item := device.next_item(0.0)) is not None and len(kept) < QUIET:
            kept.append(item)
        assert all(isinstance(item, RawFrame) and item.quiet for item in kept)
        assert len(kept) == QUIET


def test_a_board_without_a_model() -> None:
    with sim_device(sim_board(no_model=True)) as device:
        assert not device.board.has_model
        assert device.board.fault_codes == (FaultCode.NO_MODEL,)
        fault = device.next_item(0.0)
        assert isinstance(fault, Fault)
        assert (fault.code, fault.raised, fault.value) == (FaultCode.NO_MODEL, True, -4)
        for act in (
            lambda: device.tare(4),
            lambda: next(device.stream()),
            device.self_test,
            lambda: device.mask_row(1),
        ):
            with pytest.raises(
                DeviceError,
                match=r"the board has no model; upload one with  eitskin model upload MODEL\.eitm",
            ):
                act()


def test_the_newest_valid_bank_is_taken_up() -> None:
    blob, tiny = prebuilt()[1], tiny_blob()
    for banks, crc in [
        ([bank_bytes(blob, 1), bank_bytes(tiny, 2)], zlib.crc32(tiny)),
        ([bank_bytes(blob, 3), bank_bytes(tiny, 2)], zlib.crc32(blob)),
        ([bank_bytes(b"not a model" * 9, 3), bank_bytes(tiny, 2)], zlib.crc32(tiny)),
    ]:
        with sim_device(SimBoard(fresh_skin(), banks)) as device:
            assert device.board.model_crc == crc


def test_the_scan_of_another_models_protocol() -> None:
    with sim_device(SimBoard(fresh_skin(), [bank_bytes(tiny_blob(), 1), empty_bank()])) as device:
        assert device.board.n_rows == 40
        device.tare(4)
        device.start_scene()
        items = list(device.stream(ALL, frames=1))
        assert by_kind(items, RawFrame)[0].voltage_v.shape == (40,)
        assert by_kind(items, SolvedImage)[0].image.shape == (device.board.n_pixels,)


def refused(device: Device, command: cmd.Command) -> tuple[ReplyStatus, tuple[int, int]]:
    reply = device.send_command(command, 1.0)
    return ReplyStatus(reply.status), reply.detail


SCAN = cmd.Scan(50_000_000, 1_000_000, 80, 16, 1, 0, 0)
SOLVER = cmd.Solver(30, 5, 1, 0, 0.03, 0.0, 1, 0, ALL_FINDINGS, 1)
RANGE = ReplyStatus.RANGE
REFUSALS = [
    (cmd.StreamCommand(8, 1), RANGE, (4, 7)),
    (cmd.StreamCommand(1, 0), RANGE, (6, 1)),
    (cmd.StreamCommand(2, 1), ReplyStatus.NOT_TARED, (0, 0)),
    (cmd.Tare(0), RANGE, (4, 1)),
    (cmd.Tare(3), RANGE, (4, 4)),
    (cmd.Tare(1025), RANGE, (4, 1024)),
    (replace(SCAN, excitation_millihz=999), RANGE, (4, 1000)),
    (replace(SCAN, excitation_millihz=250_000_001), RANGE, (4, 250_000_000)),
    (replace(SCAN, sample_rate_hz=999), RANGE, (8, 1000)),
    (replace(SCAN, samples=3), RANGE, (12, 4)),
    (replace(SCAN, samples=1025), RANGE, (12, 1024)),
    (replace(SCAN, settle_us=50_001), RANGE, (14, 50_000)),
    (replace(SCAN, reserved=1), RANGE, (18, 0)),
    (replace(SCAN, frame_period_us=600_000_001), RANGE, (20, 600_000_000)),
    (replace(SCAN, sample_rate_hz=100_000), RANGE, (4, 49_999_999)),
    (replace(SCAN, samples=90), ReplyStatus.PERIODS, (100, 0)),
    (replace(SCAN, samples=89), ReplyStatus.PERIODS, (80, 0)),
    (replace(SCAN, frame_period_us=20_799), ReplyStatus.TOO_FAST, (20_800, 0)),
    (replace(SCAN, check_every=0, frame_period_us=10_399), ReplyStatus.TOO_FAST, (10_400, 0)),
    (replace(SOLVER, iterations=0), RANGE, (4, 1)),
    (replace(SOLVER, iterations=1001), RANGE, (4, 1000)),
    (replace(SOLVER, max_touches=17), RANGE, (8, 16)),
    (replace(SOLVER, warm_start=2), RANGE, (12, 1)),
    (replace(SOLVER, sign=3), RANGE, (16, 2)),
    (replace(SOLVER, lambda_rel=1.5), RANGE, (20, 1)),
    (replace(SOLVER, lambda_rel=float("nan")), RANGE, (20, 0)),
    (replace(SOLVER, gap_rel=-0.1), RANGE, (24, 0)),
    (replace(SOLVER, solver=4), RANGE, (28, 3)),
    (replace(SOLVER, track=2), RANGE, (40, 1)),
    (cmd.MaskRow(208, 1), RANGE, (4, 207)),
    (cmd.MaskRow(0, 2), RANGE, (6, 1)),
    (cmd.GetStats(2), RANGE, (4, 1)),
    (cmd.ModelBegin(63, 0), RANGE, (4, 64)),
    (cmd.ModelBegin(524257, 0), ReplyStatus.MODEL_SIZE, (524256, 0)),
    (cmd.ModelData(0, b"1234"), ReplyStatus.OFFSET, (-1, 0)),
    (cmd.ModelCommit(), ReplyStatus.OFFSET, (-1, 0)),
]


@pytest.mark.parametrize(("command", "status", "detail"), REFUSALS)
def test_commands_out_of_range_are_refused_and_change_nothing(
    command: cmd.Command, status: ReplyStatus, detail: tuple[int, int]
) -> None:
    with sim_device() as device:
        before = replace(device.info(), request=0)
        answer = device._ask(command, 1.0, refuse=False)
        assert (answer.status, answer.detail) == (status, detail)  # type: ignore[union-attr]
        assert replace(device.info(), request=0) == before


def test_unknown_commands_and_wrong_lengths_are_refused() -> None:
    from eitskin.device.wire.codec import Decoder, encode
    from eitskin.device.wire.packets import PacketType
    from eitskin.device.wire.payloads import parse_reply

    board = sim_board()
    board.take_output()
    for packet_type, payload, status, detail in [
        (0x99, b"\7\0\0\0", ReplyStatus.UNKNOWN_COMMAND, (0, 0)),
        (PacketType.TARE, b"\7\0\0\0", ReplyStatus.LENGTH, (8, 0)),
        (PacketType.TARE, b"\7\0\0\0" + bytes(5), ReplyStatus.LENGTH, (8, 0)),
        (PacketType.MODEL_DATA, b"\7\0\0\0" + bytes(4), ReplyStatus.LENGTH, (12, 0)),
    ]:
        board.receive(encode(packet_type, 1, payload))
        (packet,) = Decoder().feed(board.take_output())
        reply = parse_reply(packet.payload)
        assert (reply.request, reply.command, reply.status, reply.detail) == (
            7,
            packet_type,
            status,
            detail,
        )
    board.receive(encode(PacketType.RAW, 1, bytes(40)))  # an echo of its own
    assert board.take_output() == b""


def test_a_command_that_is_sent_again_is_answered_again_and_not_done_again() -> None:
    from eitskin.device.wire.codec import encode

    board = sim_board()
    board.take_output()
    tare = encode(0x82, 1, cmd.Tare(4).payload(9))
    board.receive(tare)
    board.receive(tare)  # under way
    board.receive(encode(0x82, 2, cmd.Tare(4).payload(10)))
    busy = board.take_output()
    assert busy
    for _ in range(4):
        assert board.scan_one()
    done = board.take_output()
    assert not board.wanted
    board.receive(tare)
    again = board.take_output()
    assert not board.wanted
    assert len(again) == len(done)


def test_a_reset_begins_anew() -> None:
    with sim_device() as device:
        device.tare(QUIET)
        assert device.info().tared == 1
        info = device.reset()
        assert (info.tared, info.streaming) == (0, 0)
        assert device.counters.restarts == 1
        assert device.counters.gaps == device.counters.stale == 0
        device.tare(1)


def test_options_of_the_solver_are_taken() -> None:
    options = default_options(prebuilt()[0])
    with sim_device() as device:
        device.tare(QUIET)
        device.start_scene()
        device.solver(replace(options, iterations=7, warm_start=True))
        image = by_kind(list(device.stream(Stream.IMAGE, frames=1)), SolvedImage)[0]
        assert image.solved.iterations == 7
        with pytest.raises(UsageError):
            device.solver(replace(options, iterations=0))
        with pytest.raises(
            DeviceError, match="SOLVER: iterations is out of range, its limit is 1000"
        ):
            device.solver(replace(options, iterations=2000))


def test_a_scan_forgets_the_reference() -> None:
    with sim_device() as device:
        device.tare(QUIET)
        assert device.scan(samples=100).tared == 0
        assert device.board.samples == 100
        with pytest.raises(
            DeviceError, match="no reference frame; leave the skin untouched and run  eitskin tare"
        ):
            next(device.stream(Stream.TOUCHES))


def test_bad_numbers_are_refused_before_they_are_sent() -> None:
    with sim_device() as device:
        for act in (
            lambda: device.tare(2),
            lambda: device.tare(0),
            lambda: device.stream(Stream(0)),
            lambda: device.stream(Stream.RAW, every=0),
            lambda: device.stream(Stream.RAW, frames=-1),
            lambda: device.scan(samples=-1),
            lambda: device.scan(settle_us=70_000),
            lambda: device.mask_row(-1),
        ):
            with pytest.raises(UsageError):
                act()
        assert device.info().tared == 0


def test_the_self_test_runs_the_golden_frame() -> None:
    with sim_device() as device:
        device.tare(QUIET)
        device.self_test()
        device.clear_faults()
        assert device.info().tared == 1
