"""Touches that come, move and go while a frame is scanned."""

from dataclasses import replace

import numpy as np
import pytest
from scene_helpers import moving_scene, still_scene

from eitskin.device.bank import BANK_BYTES, bank_bytes
from eitskin.device.client import Device
from eitskin.device.simulated import SimBoard, SimTransport
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import RawFrame
from eitskin.errors import ConfigError
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import Scene, load_scene
from eitskin.scene.laws import ShortCircuit
from eitskin.scene.motion import Motion
from eitskin.scene.runner import FrameMaker, run, simulate_frames
from eitskin.scene.touch_path import Keyframe, TouchTrack
from eitskin.skin.protocol import adjacent, in_order, table
from eitskin_emulator.clocktime import TICKS_PER_S
from eitskin_emulator.scene_skin import skin_of
from small_models import prebuilt

RATE_HZ = 1e4 / 208  # scans of 100 us a row, one behind the other


def press(start_s: float, rise_s: float, end_s: float) -> TouchTrack:
    """A touch that comes at ``start_s``, at once or in ``rise_s``, and is gone after ``end_s``."""
    times = [(start_s, 0.0 if rise_s else 1.0), (start_s + rise_s, 1.0), (end_s, 1.0)]
    keys = [Keyframe(t_s, 20, -30, 9, drive) for t_s, drive in times]
    return TouchTrack(tuple(keys if rise_s else keys[1:]), ShortCircuit(5.0))


def swipe(mm_per_s: float) -> TouchTrack:
    return TouchTrack((Keyframe(0, -60, 11, 9), Keyframe(120 / mm_per_s, 60, 11, 9)))


def scene_of(track: TouchTrack, **changes: object) -> Scene:
    given = {"touches": (track,), "frames": 5, "rate_hz": RATE_HZ, "elements": 1500}
    return still_scene(**{**given, **changes})


def test_each_row_of_a_sudden_press_has_its_own_instant(mesh_cache):
    """The touch is on the skin from row 60 of frame 1 to row 20 of frame 3."""
    row_s = 1e-4
    scene = scene_of(press((208 + 59.5) * row_s, 0, (3 * 208 + 20.5) * row_s))
    v = simulate_frames(compile_scene(scene, mesh_cache=mesh_cache)).voltage_v[2:]
    there = scene_of(press(-1, 0, 9))
    full = simulate_frames(compile_scene(there, mesh_cache=mesh_cache)).voltage_v
    expected = np.array([full[0], full[0], full[2], full[0], full[0]])
    expected[1, 60:], expected[3, :21] = full[2, 60:], full[2, :21]
    assert np.array_equal(v, expected)
    frames = run(compile_scene(scene))
    assert frames.touch_frame.tolist() == [1, 2]
    assert frames.row_time_s[59:61] == pytest.approx([59e-4, 6e-3])
    assert [len(frames.paths.at((208 + row) * row_s)[0]) for row in (59, 60)] == [0, 1]


def test_rows_are_measured_in_the_protocols_order(mesh_cache):
    """A touch that comes after three drives, 0, 7 and 14, is in the rows of the others; charge and
    settling go from row to row as they are measured."""
    track = press(3 * 13 * 1e-4 - 5e-5, 0, 9.0)
    by_7 = in_order(adjacent(16), "by 7")
    v = run(compile_scene(scene_of(track, protocol=by_7), mesh_cache=mesh_cache)).voltage_v
    still = np.repeat(~np.isin(np.arange(16), (0, 7, 14)), 13)
    assert np.array_equal(v[0] == v[1], still)
    effects = {"charge_injection": {}, "mux": {}}
    scenes = (
        scene_of(press(-1, 0, 9), protocol=one, effects=effects)
        for one in (by_7, table(16, by_7.drive_measure[by_7.scan_rows]))
    )
    both = [simulate_frames(compile_scene(scene)).voltage_v[0] for scene in scenes]
    assert np.array_equal(both[0][by_7.scan_rows], both[1])


@pytest.mark.parametrize(
    ("period_us", "check_every", "scan", "place"),
    [(50_000, 1, 1, 1), (20_800, 1, 2, 85), (0, 0, 4, 85)],
    ids=["as the scene", "faster", "half scans"],
)
def test_a_simulated_board_measures_each_row_at_its_slot(period_us, check_every, scan, place):
    """A touch comes 50.05 ms after the scene began: before place ``place`` of scan ``scan``."""
    model, blob = prebuilt()
    scene = scene_of(press(0.05005, 0, 9), frames=6, rate_hz=20.0, quiet_frames=4)
    board = SimBoard(BoardFrames(scene), [bank_bytes(blob, 1), bytes([255]) * BANK_BYTES])
    with Device(SimTransport("test", board)) as device:
        device.scan(check_every=check_every, frame_period_us=period_us)
        device.tare(4)
        device.start_scene()
        items = list(device.stream(Stream.RAW))
    v = np.array([item.voltage_v for item in items if isinstance(item, RawFrame)])
    fold = model.protocol.reciprocal_pairs()
    order = np.setdiff1d(np.arange(208), [] if check_every else fold.second)
    clear = np.abs(v[scan + 1] - v[0])[order] > 1e-4
    assert 20 < clear.sum() < len(order)
    changed = np.abs(v[: scan + 2] - v[0])[:, order] > 1e-4
    after = np.arange(len(order)) >= place
    assert not changed[:scan].any()
    assert np.array_equal(changed[scan], clear & after) and clear[:place].any()


def test_the_emulated_skin_follows_the_clock_row_by_row():
    protocol = adjacent(16)
    scene = scene_of(press(0.0611, 0, 9), frames=8, rate_hz=20.0)
    skin = skin_of(scene, protocol)
    skin.begin(0)
    rows = [tuple(int(k) for k in row) for row in protocol.drive_measure]
    scans = [
        [skin.amplitude_v(round((start_s + 1e-4 * k) * TICKS_PER_S), row)
         for k, row in enumerate(rows)]
        for start_s in (0.03, 0.0511, 0.08)
    ]  # fmt: skip
    assert np.array_equal(scans[0][:], BoardFrames(scene).voltage_v(protocol)[2])
    assert np.array_equal(scans[1][:100], scans[0][:100])
    assert np.array_equal(scans[1][100:], scans[2][100:]) and scans[1][100] != scans[0][100]


@pytest.mark.parametrize(
    ("track", "effects", "solver", "most"),
    [
        (press(0.03, 0.03, 1.0), {}, "update", 0.005),
        (press(0.03, 0.03, 1.0), {"phase": {}, "contact_impedance": {}}, "factorise", 0.005),
        (press(0.03, 0.03, 1.0), {"source_impedance": {}}, "update", 0.002),
        (press(0.03, 0.03, 1.0), {"temperature": {"drift_k_per_min": 9.0}}, "auto", 0.005),
        (swipe(600), {}, "update", 0.03),
    ],
    ids=["press", "complex", "loads", "sheet", "swipe"],
)
def test_rows_are_near_those_that_are_solved_at_their_instants(
    track, effects, solver, most, mesh_cache
):
    """The mean square of what interpolation is wrong by, over that of the touch's signal."""

    def simulated(scene: Scene) -> np.ndarray:
        return simulate_frames(compile_scene(scene, mesh_cache=mesh_cache)).voltage_v[2:]

    scene = scene_of(track, effects=effects, solver=solver)
    done, wrong, signal = simulated(scene), [], []
    for frame, row in [(1, 150), (2, 10), (2, 77), (2, 205), (3, 31), (4, 100)]:
        at = scene.samples_at(np.array([frame / RATE_HZ + row * 1e-4]))[0]
        place = Keyframe(-1, float(at.x_mm[0]), float(at.y_mm[0]), 9)
        still = TouchTrack((place,), ShortCircuit(float(at.contrast[0])), hold=True)
        solved, untouched = (
            simulated(replace(scene, touches=touches, solver="factorise"))[frame]
            for touches in ((still,), ())
        )
        wrong.append(done[frame, row] - solved[row])
        signal.append(solved - untouched)
    assert 0 < np.sqrt(np.mean(np.square(wrong))) < most * np.sqrt(np.mean(np.square(signal)))


@pytest.mark.parametrize("effects", [{}, {"noise": {"snr_db": 60.0}, "mains": {}}])
def test_still_skins_keep_their_bits(effects, mesh_cache):
    for scene in (still_scene(3, effects=effects), still_scene(3, touches=(), effects=effects)):
        frozen = replace(scene, frozen=True)
        for _ in range(2):  # plans are the same once the untouched skin is kept
            made = [compile_scene(one, mesh_cache=mesh_cache) for one in (scene, frozen)]
            assert np.array_equal(*(simulate_frames(one).voltage_v for one in made))
        moved, shot = (one.plan.text() for one in made)
        assert moved == shot and "scan" not in moved


def test_the_plan_tells_how_many_states_are_solved(mesh_cache):
    """A swipe of 12 mm has a state each mm; a snapshot has one a frame."""
    for frozen, states in ((False, 1 + 13), (True, 1 + 5)):
        path = (Keyframe(0, 0, 0, 9), Keyframe(0.08, 12, 0, 9))
        scene = scene_of(TouchTrack(path, hold=True), frozen=frozen)
        compiled = compile_scene(scene, mesh_cache=mesh_cache)
        assert len(compiled.states) == compiled.plan.states == states
        assert (f"the {states} states" in compiled.plan.text()) is not frozen
        assert sorted(compiled.mixes) == ([] if frozen else [2, 3, 4, 5])


def test_rows_may_be_asked_for_at_other_instants(mesh_cache):
    scene = scene_of(swipe(300), effects={"noise": {"snr_db": 60.0}})
    maker = FrameMaker(compile_scene(scene, mesh_cache=mesh_cache))
    nominal = 1 / RATE_HZ + scene.row_delays_s
    assert np.array_equal(maker.frame(3), maker.frame(3, nominal))
    half = maker.frame(3, nominal + 0.5 / RATE_HZ)
    assert not np.array_equal(half, maker.frame(3))
    assert np.array_equal(maker.frame(1), maker.frame(1, nominal))  # untouched: no touch


def test_states_are_those_at_the_keyframes_and_steps_between():
    motion = Motion([press(0.1, 0.04, 0.3), TouchTrack((Keyframe(0.2, -30, 0, 5),), hold=True)])
    mix = motion.at(np.array([0.05, 0.1, 0.12, 0.14, 0.17, 0.2, 0.25, 0.3, 0.4]))
    counts = [len(motion.states[k]) for k in mix.lower]
    assert counts == [0, 0, 1, 1, 1, 2, 2, 2, 1]
    assert np.flatnonzero(mix.part).tolist() == [2]
    assert not mix.still and motion.at(np.array([0.15, 0.19])).still


def test_truth_is_that_of_the_end_of_the_scan():
    scene = moving_scene(4)
    frames = run(compile_scene(scene), truth_pixels=16)
    assert scene.truth_delay_s == scene.scan_s == pytest.approx(0.0208)
    at = scene.samples_at(scene.times_s() + 0.0208)[0]
    assert frames.touch_frame.tolist() == [0, 1, 2]  # it has lifted during the last scan
    assert frames.touch_xy_mm[:, 0] == pytest.approx(at.x_mm[:3])
    assert [bool(mask.any()) for mask in frames.truth_mask] == [True, True, True, False]


@pytest.mark.parametrize(
    ("scan", "problem"),
    [
        ("frozen = 1", "frozen must be true or false"),
        ("row_us = 500", "row_us = 500 must be above 0 and at most 240.4"),
        ("rows = 5", "unknown key"),
    ],
)
def test_bad_scans_are_refused(scan, problem, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(f"[scene]\nframes = 2\n[scan]\n{scan}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=problem):
        load_scene(path)


def test_a_touch_may_not_leave_the_skin_during_a_scan(tmp_path):
    text = "[scene]\n[[touch]]\nradius_mm = 8\npath = [{t_s = 0, x_mm = 80, y_mm = 0}, "
    text += "{t_s = 0.01, x_mm = 95, y_mm = 0}]\n"
    path = tmp_path / "s.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"at 0\.01 s x_mm = 95"):
        load_scene(path)
    path.write_text(text + "[scan]\nfrozen = true\n", encoding="utf-8")
    assert load_scene(path).frozen
