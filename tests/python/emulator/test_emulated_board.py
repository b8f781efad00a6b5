"""The unmodified firmware image of the NUCLEO-F767ZI on the emulated board: what it drives,
measures, computes and sends."""

import zlib

import numpy as np
import pytest
from firmware_checks import CHECKS, run_session

from eitskin.device.client import Device
from eitskin.device.wire.link_table import Quality, Stream
from eitskin.errors import DeviceError
from eitskin.model.build import BuildSettings, linearise, make_model
from eitskin.model.eitm import encode_model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.skin.protocol import opposite
from eitskin.skin.skin import paper_skin
from eitskin_emulator.analog.converter import STEP_V
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_S
from emulated import EVERYTHING, board_of, clean, connect, power_up, raw_frames, twin_check


@pytest.fixture(scope="module")
def untouched(image) -> Device:
    """A board before an untouched skin without noise."""
    return connect(power_up(image, noisy=False))


def test_the_board_says_what_it_is(untouched):
    info, (model, blob) = untouched.board, load_prebuilt()
    assert (info.board, info.f_cpu_hz, info.electrodes) == ("nucleo_f767zi", 216_000_000, 16)
    assert (info.model_bytes, info.model_crc, info.bank) == (len(blob), zlib.crc32(blob), 0)
    assert info.protocol_hash == model.protocol.hash
    assert info.volts_per_code_nv == pytest.approx(STEP_V * 1e9, abs=1)
    assert (info.faults, info.tared, info.streaming) == (0, 0, 0)
    assert bytes.fromhex(info.serial.strip("\0")) != b""


def test_the_generator_runs_at_50_khz(untouched):
    generator = board_of(untouched).generator
    assert generator.words[0] == 0x2100  # in reset, until a host asks
    raw_frames(untouched, 1)
    assert generator.mclk_hz == 8_000_000
    assert abs(generator.frequency_hz - 50_000) < 0.02
    start = [0x2100, 0x4000 | 0x199A, 0x4000 | 0x66, 0xC000, 0x2000]
    assert generator.words[-5:] == start
    assert abs(untouched.board.excitation_millihz / 1000 - generator.frequency_hz) < 0.001


def test_the_image_passes_every_check(image):
    """The checks are those that must notice the mutants in test_mutations.py."""
    session = run_session(image)
    assert {check.__name__: reported for check in CHECKS if (reported := check(session))} == {}


def amplitude_errors_lsb(device: Device) -> np.ndarray:
    exact = board_of(device).skin.untouched_v[0]
    frames = raw_frames(device, 2)
    assert all(frame.quality.max() & ~Quality.RECIPROCITY == 0 for frame in frames)
    return np.concatenate([frame.voltage_v - exact for frame in frames]) / STEP_V


@pytest.mark.long("firmware/test_qemu_board.py")
def test_the_same_session_gives_the_same_bytes(image):
    runs = []
    for _ in range(2):
        board = power_up(image)
        device = connect(board)
        device.tare(4)
        device.start_scene()
        items = [repr(item) for item in device.stream(EVERYTHING, frames=2)]
        runs.append((items, board.record.instructions, board.clock.now, board.memories.ram[:]))
    assert runs[0] == runs[1]


def test_touches_and_images_are_the_host_s_to_the_bit(image):
    board = power_up(image)
    device = connect(board)
    check, seen, host = twin_check(device, load_prebuilt()[1], 6, untouched=8)
    # touches that take longer than a scan cost the next frame, and the one after it has no frame
    # before it to compare with
    assert (check.different, check.alone) == ([], 0) and check.inconclusive <= 1
    assert check.same + check.inconclusive == 6
    assert check.images == check.touches == check.same
    assert sum(result is not None for result in host) >= 4
    unsolved = 0
    for frame, result in zip(seen, host, strict=True):
        assert frame.info is not None
        if result is None:  # touches landed in its scan: it has those that drives follow
            unsolved += frame.info.unsolved
            continue
        assert not frame.info.unsolved
        reported = frame.info.macs, frame.info.iterations
        assert reported == (result.info.macs, result.info.iterations)
    assert unsolved + check.inconclusive == sum(result is None for result in host)
    truth = np.array([[-40.0, 10.0], [30.0, -25.0]])
    for frame in seen[2:]:
        assert frame.touches is not None
        found = np.array([[touch.x_mm, touch.y_mm] for touch in frame.touches])
        assert found.shape == (2, 2), frame
        away = np.linalg.norm(found[None] - truth[:, None], axis=2).min(axis=1)
        assert away.max() < 2.0
    clean(board)


def test_an_opposite_protocol(image):
    """Another protocol: the model's table is scanned, and each row has its voltage."""
    skin, protocol = paper_skin(), opposite(16, 0.5e-3)  # 1 mA would saturate this front end
    linear = linearise(skin, protocol, pixels_across=14, elements=900)
    model = make_model(skin, protocol, linear, BuildSettings(rank=40))
    board = power_up(image, noisy=False, model=encode_model(model))
    device = connect(board)
    assert device.board.protocol_hash == protocol.hash
    errors = amplitude_errors_lsb(device)
    table = [tuple(int(k) for k in row) for row in protocol.drive_measure]
    order = [one.joined for one in board.multiplexers.log if None not in one.joined]
    start = order.index(table[0])
    assert order[start : start + len(table)] == table
    print(f"opposite: worst {np.abs(errors).max():.3f} LSB")
    assert np.abs(errors).max() < 0.5
    clean(board)


def periods_us(device: Device, frames: int) -> tuple[float, float]:
    """From frame to frame, by the board's clock: of scans alone, and with solves."""
    raw = [one.time_us for one in device.stream(Stream.RAW, frames=frames)]
    solved = [one.solved.time_us for one in device.stream(Stream.TOUCHES, frames=frames)]
    return float(np.diff(raw)[2:].mean()), float(np.diff(solved)[2:].mean())


@pytest.mark.parametrize(
    ("check_every", "rows"),
    [pytest.param(1, 208, marks=pytest.mark.long("half the rows")), (0, 104)],
)
def test_frame_rates(image, check_every, rows):
    """208 and 104 measurements of 80 samples, the solve overlapped: the slower of scan and solve is
    what bounds the rate."""
    board = power_up(image)
    device = connect(board)
    device.scan(check_every=check_every)
    device.tare(4)
    board.skin.begin(board.clock.now)
    device.stats(reset=True)
    scan_us, frame_us = periods_us(device, 8)
    stages = device.stats().stages
    own_us = {name: stages[name].worst_us for name in ("solve", "touches", "demodulate", "send")}
    bound = "the solve" if frame_us > 1.02 * scan_us else "the scan"
    reported = ", ".join(f"{name} {us / 1000:.2f} ms" for name, us in own_us.items())
    rate = f"scan {scan_us / 1000:.2f} ms, frame {frame_us / 1000:.2f} ms ({1e6 / frame_us:.1f} Hz)"
    print(f"{rows} rows: {rate}; {reported}: {bound} bounds it")
    assert abs(scan_us - rows * device.board.slot_us) <= 2 * device.board.slot_us
    # they overlap: it is not their sum
    assert scan_us - 1 <= frame_us <= max(scan_us, sum(own_us.values())) * 1.1
    clean(board)


def test_another_frequency(image):
    device = connect(power_up(image, noisy=False))
    board = board_of(device)
    device.scan(excitation_hz=25_000)
    assert board.generator.frequency_hz == 0
    frame = raw_frames(device, 1)[0]
    assert abs(board.generator.frequency_hz - 25_000) < 0.02
    assert np.abs(frame.voltage_v - board.skin.untouched_v[0]).max() < 0.5 * STEP_V
    with pytest.raises(DeviceError):
        device.scan(excitation_hz=33_333)
    assert abs(board.generator.frequency_hz - 25_000) < 0.02
    clean(board)


@pytest.mark.long("test_timers.py without the 8 MHz")
def test_without_the_8_mhz_the_red_light_blinks(image):
    board = EmulatedBoard(image, power_up(image, noisy=False).skin, hse_hz=None)
    lights = set()
    for _ in range(40):
        board.run_until(board.clock.now + TICKS_PER_S // 10)
        lights.add(board.ports["B"].levels)
    assert lights >= {0, 1 << 14}
    assert board.receive() == b""
