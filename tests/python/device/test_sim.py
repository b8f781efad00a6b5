"""A simulated board: the scene's frames through the host core, with the firmware's commands, checks
and replies."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest

import numpy as np
import pytest
from device_helpers import FRAMES, UNTOUCHED, frames, of, raw_frames, scene, sim_board, sim_device

from eitskin.core.drawing import TouchDrawing
from eitskin.device.known_model import board_options, scanned_protocol
from eitskin.device.simulated import FINGER_MM
from eitskin.device.wire import link_table as cmd
from eitskin.device.wire.link_table import FaultCode, Quality, ReplyStatus, Stream
from eitskin.device.wire.packets import Fault, RawFrame, SolvedImage, SolvedTouches
from eitskin.errors import DeviceError, ProtocolError, UsageError
from eitskin.model.options import default_options
from eitskin.scene.board_frames import BoardFrames, SceneRows
from eitskin.scene.description import load_scene
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_path import Keyframe, TouchTrack
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES


def test_frames_and_results_are_those_of_the_host_core_bit_for_bit():
    """The touches of every second frame are followed from frame to frame."""
    model, blob = prebuilt()
    with sim_device() as device:
        device.send_command(cmd.StreamCommand(Stream.RAW), 1.0)
        device.tare(UNTOUCHED)
        untouched = [device.next_item(0.0) for _ in range(UNTOUCHED)]
        device.start_scene()
        board, items = device.board, list(device.stream(ALL, every=2))
    raws, images, touches = (of(kind, items) for kind in (RawFrame, SolvedImage, SolvedTouches))
    assert len(raws) == len(images) == len(touches) == FRAMES // 2
    assert [type(item) for item in items[:3]] == [RawFrame, SolvedImage, SolvedTouches]
    skin = Reconstructor(model, blob=blob, options=board_options(model, board))
    drawing = TouchDrawing(blob)
    skin.tare(np.array([raw.voltage_v for raw in untouched]))
    for raw, image, found in zip(raws, images, touches, strict=True):
        result = skin.follow(raw.voltage_v)
        assert image.image.tobytes() == result.solver_image.astype(np.float32).tobytes()
        assert found.touches == result.touches
        assert found.solved.shown == result.image_is == "touches" and result.touch_image is not None
        assert drawing.image(found.touches).tobytes() == result.touch_image.tobytes()
        assert image.solved.iterations == found.solved.iterations == result.info.iterations
        assert found.solved.macs == result.info.macs
        assert raw.frame == image.frame == found.frame
    (touch,) = touches[-1].touches
    assert np.hypot(touch.x_mm + 40, touch.y_mm - 10) < 3


def test_frames_are_the_scenes_but_for_a_converter_of_16_bits():
    with sim_device() as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        raws = raw_frames(device)
        step_v = 1e-9 * device.info().volts_per_code_nv
    true = frames().voltage_v(prebuilt()[0].protocol)
    assert 2.0 < 65536 * step_v / np.abs(true).max() < 2.2
    measured = np.array([raw.voltage_v for raw in raws])
    gain = np.sum(measured * true[UNTOUCHED:]) / np.sum(true[UNTOUCHED:] ** 2)
    assert gain == pytest.approx(1, abs=1e-4)
    error = measured / gain - true[UNTOUCHED:]
    assert np.abs(error).max() < step_v
    assert np.sqrt(np.mean(error**2)) < 0.2 * step_v < 2e-5 * np.sqrt(np.mean(true**2))


def test_boards_in_one_process_do_not_meet():
    """Two runs in turns give what each gives alone, and alone the same again."""

    def run(count: int) -> Iterator[bytes]:
        with sim_device() as device:
            device.tare(count)
            device.start_scene()
            for raw in device.stream(Stream.RAW, frames=count):
                assert isinstance(raw, RawFrame)
                yield raw.voltage_v.tobytes()

    alone = list(run(4)), list(run(8))
    together = list(zip_longest(run(4), run(8)))
    assert ([one for one, _ in together[:4]], [two for _, two in together]) == alone


def test_the_skin_is_untouched_until_the_scene_begins():
    with sim_device() as device:
        untouched = np.array([raw.voltage_v for raw in raw_frames(device, 2 * UNTOUCHED)])
        assert np.abs(untouched[UNTOUCHED:] - untouched[:UNTOUCHED]).max() < 3e-5
        device.tare(UNTOUCHED)
        device.start_scene()
        touched = raw_frames(device)[0].voltage_v
    rms = float(np.sqrt(np.mean(untouched[0] ** 2)))
    assert (
        np.abs(touched - untouched[0]).max()
        > 0.02 * rms
        > np.abs(untouched[1] - untouched[0]).max()
    )


def test_board_time_is_the_scenes_and_the_scene_ends():
    with sim_device() as device:
        assert device.board.frame_period_us == 50_000
        device.start_scene()
        raws = raw_frames(device)
        assert [raw.time_us for raw in raws] == [20 + 50_000 * k for k in range(FRAMES)]
        assert [raw.frame for raw in raws] == list(range(FRAMES))
        assert device.transport.ended
        assert list(device.stream(Stream.RAW)) == []
        assert device.stats().frames_scanned == FRAMES  # commands are still answered


def test_a_finger_that_presses_is_a_touch_of_the_scene_until_it_lifts():
    """Frames of a pressed skin are those of a scene that has this touch, too."""
    touch = TouchTrack((Keyframe(-1e9, 30.0, -20.0, FINGER_MM),), hold=True)
    pressed_scene = replace(scene(), touches=(*scene().touches, touch))
    with sim_device() as device:
        expected, alone = (
            BoardFrames(one).voltage_v(scanned_protocol(device.board, None, "sim"))[UNTOUCHED:]
            for one in (pressed_scene, scene())
        )
        device.start_scene()
        stream = device.stream(Stream.RAW)
        volts = [next(stream).voltage_v]
        device.transport.press([(30.0, -20.0), (500.0, 0.0), (np.nan, 0.0)])
        volts += [next(stream).voltage_v for _ in range(3)]
        device.transport.press([])
        volts += [next(stream).voltage_v for _ in range(2)]
        stream.close()
    near_v = 3e-5
    assert np.abs(expected - alone).max() > 100 * near_v
    for frame, is_pressed in enumerate([False, True, True, True, False, False]):
        wanted = (expected if is_pressed else alone)[frame]
        assert np.abs(volts[frame] - wanted).max() < near_v, frame


def test_a_moving_scene_is_pressed_as_it_is_in_the_middle_of_a_scan():
    path = TouchTrack((Keyframe(0.0, -40.0, 10.0, 9.0), Keyframe(0.45, 0.0, 10.0, 9.0)))
    moving = SceneRows(replace(scene(), touches=(path,), elements=1500))
    finger = TrueTouch(30.0, -20.0, FINGER_MM, 9.0)
    frame = UNTOUCHED + 4
    middle_s = 4 / moving.scene.rate_hz + moving.scene.scan_s / 2
    x_mm = -40.0 + 40.0 * middle_s / 0.45
    still = TouchTrack((Keyframe(-1e9, x_mm, 10.0, 9.0),), hold=True)
    same = SceneRows(replace(scene(), touches=(still,), elements=1500))
    change_v = np.abs(same.pressed(frame, (finger,)) - same.part(range(frame, frame + 1))[0]).max()
    apart_v = np.abs(moving.pressed(frame, (finger,)) - same.pressed(frame, (finger,))).max()
    assert apart_v < 0.1 * change_v


def test_a_faster_scan_sees_scene_frames_more_than_once():
    with sim_device() as device:
        device.scan(frame_period_us=0)
        assert device.board.frame_us == 20_800
        device.start_scene()
        raws = raw_frames(device)
    assert [raw.time_us for raw in raws] == [20 + 20_800 * k for k in range(len(raws))]
    true = frames().voltage_v(prebuilt()[0].protocol)[UNTOUCHED:]
    shown = [int(np.abs(true - raw.voltage_v).max(axis=1).argmin()) for raw in raws]
    assert shown == [int(k * 20_800 / 50_000 + 0.5) for k in range(len(raws))]
    assert len(raws) == 23  # until 20.8 ms k is nearer to frame 10 than to 9
    assert raws[0].scan_us == 207 * 100 + 80


def test_masked_rows_are_left_out():
    with sim_device() as device:
        device.mask_row(5)
        device.tare(UNTOUCHED)
        device.start_scene()
        items = list(device.stream(ALL, frames=4))  # the first ones are not solved: a touch lands
        raw, image = of(RawFrame, items)[-1], of(SolvedImage, items)[-1]
        assert np.isnan(raw.voltage_v[5])
        assert raw.quality[5] == Quality.MASKED
        assert np.isfinite(np.delete(raw.voltage_v, 5)).all()
        assert image.solved.masked == 1
        assert np.isfinite(image.image).all()
        device.mask_row(5, masked=False)
        device.tare(4, anyway=True)
        assert of(SolvedImage, device.stream(ALL, frames=1))[-1].solved.masked == 0


def test_a_board_without_a_model():
    said = r"the board has no model; upload one with  eitskin model upload MODEL\.eitm"
    with sim_device(sim_board(no_model=True)) as device:
        assert not device.board.has_model
        assert device.board.fault_codes == (FaultCode.NO_MODEL,)
        fault = device.next_item(0.0)
        assert isinstance(fault, Fault)
        assert (fault.code, fault.raised, fault.value) == (FaultCode.NO_MODEL, True, -4)
        for act in (lambda: next(device.stream()), device.self_test, lambda: device.mask_row(1)):
            with pytest.raises(DeviceError, match=said):
                act()


@pytest.mark.parametrize(
    ("command", "status", "detail"),
    [
        (cmd.StreamCommand(2, 1), ReplyStatus.NOT_TARED, (0, 0)),
        (cmd.Tare(1025), ReplyStatus.RANGE, (4, 1024)),
        (cmd.Scan(50_000_000, 1_000_000, 90, 16, 1, 0, 0), ReplyStatus.PERIODS, (100, 0)),
        (cmd.ModelBegin(524257, 0), ReplyStatus.MODEL_SIZE, (524256, 0)),
    ],
)
def test_commands_out_of_range_are_refused_and_change_nothing(command, status, detail):
    """One of each kind: all limits are the firmware's, of tests/firmware/test_commands.c."""
    with sim_device() as device:
        before = replace(device.info(), request=0)
        answer = device.send_command(command, 1.0)
        assert (answer.status, answer.detail) == (status, detail)
        assert replace(device.info(), request=0) == before


def test_a_reset_begins_anew():
    with sim_device() as device:
        device.tare(UNTOUCHED)
        assert device.info().tared == 1
        info = device.reset()
        assert (info.tared, info.streaming) == (0, 0)
        counters = device.counters
        assert (counters.restarts, counters.gaps, counters.stale) == (1, 0, 0)
        device.tare(1)


def test_options_of_the_solver_are_taken():
    options = default_options(prebuilt()[0])
    with sim_device() as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        device.solver(replace(options, iterations=7, warm_start=True))
        image = of(SolvedImage, device.stream(Stream.IMAGE, frames=1))[0]
        assert image.solved.iterations == 7
        with pytest.raises(UsageError):
            device.solver(replace(options, iterations=0))
        with pytest.raises(
            DeviceError, match="SOLVER: iterations is out of range, its limit is 1000"
        ):
            device.solver(replace(options, iterations=2000))


def test_a_scan_forgets_the_reference():
    with sim_device() as device:
        device.tare(UNTOUCHED)
        assert device.scan(samples=100).tared == 0
        assert device.board.samples == 100
        with pytest.raises(
            DeviceError, match="no reference frame; leave the skin untouched and run  eitskin tare"
        ):
            next(device.stream(Stream.TOUCHES))


def test_bad_numbers_are_refused_before_they_are_sent():
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


def test_the_self_test_runs_the_golden_frame():
    with sim_device() as device:
        device.tare(UNTOUCHED)
        device.self_test()
        device.clear_faults()
        assert device.info().tared == 1


def test_a_scene_of_another_skin_names_the_model_that_is_missing(tmp_path):
    (tmp_path / "eight.toml").write_text("[skin]\ndiameter_mm = 100\n[electrodes]\ncount = 8\n")
    (tmp_path / "scene.toml").write_text('[scene]\nskin = "eight.toml"\nelements = 800\n')
    build = f"eitskin model build {tmp_path}/eight.toml -o eight.eitm"
    with pytest.raises(
        ProtocolError, match="8 electrodes, but the board's model is for 16"
    ) as caught:
        BoardFrames(load_scene(tmp_path / "scene.toml")).rows(prebuilt()[0].protocol)
    assert build in str(caught.value) and "\n" not in str(caught.value)
