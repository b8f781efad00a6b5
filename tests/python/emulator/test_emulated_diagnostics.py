"""The firmware on the emulated board names what is wrong with a frame within that frame, by fault
and head, as the host would."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eitskin.core.diagnostics import names
from eitskin.device.bank import bank_bytes
from eitskin.device.client import Device
from eitskin.device.wire.link_table import FAULT_CLEAR_FRAMES, FaultCode
from eitskin.device.wire.packets import Fault
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.description import Scene
from eitskin.scene.library_scenes import find_scene
from eitskin.session.assemble import assembled
from eitskin.session.frame import Frame
from eitskin_emulator.analog.skin import AnalogSkin
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.scene_skin import skin_of
from emulated import EVERYTHING, board_of, connect, twin_check


def scene(effects: dict[str, Any]) -> Scene:
    return replace(find_scene("two_touch"), effects=effects, frames=16, rate_hz=20.0)


def device_before(image: bytes, skin: AnalogSkin) -> Device:
    return connect(EmulatedBoard(image, skin, (bank_bytes(load_prebuilt()[1], 1),)))


def taken(device: Device, frames: int) -> tuple[list[Frame], list[Fault]]:
    items = list(assembled(device.stream(EVERYTHING, frames=frames), EVERYTHING))
    return [item for item in items if isinstance(item, Frame)], [
        item for item in items if isinstance(item, Fault)
    ]


@pytest.mark.long("the other diagnostic of this file")
def test_an_electrode_that_comes_off_in_mid_stream(image):
    """Named by a fault and by the head in the same frame, at the latest the first that is wholly
    without it; gone after eight frames with it; every bit, and all that was found, as the host
    finds it."""
    model, blob = load_prebuilt()
    wobble = {"detached": {"electrodes": [5], "from_s": 0.01, "until_s": 0.07}}
    device = device_before(image, skin_of(scene(wobble), model.protocol))
    reported: list[Fault] = []
    device.record(lambda packet: reported.extend(_faults(packet)))
    check, seen, _ = twin_check(device, blob, 20)
    # The line drops packets, and touches after a gap are not compared. A few microseconds in the
    # main loop decide which frames lose one: 10 or 11 of 20 are complete.
    assert check.different == []
    assert check.same >= 8
    uses = (model.protocol.drive_measure == 5).any(axis=1)
    whole = [
        f.number for f in seen if f.raw is not None and np.abs(f.raw.voltage_v[uses]).max() < 1e-3
    ]
    named = [f.number for f in seen if f.info is not None and f.info.open_electrodes == (5,)]
    assert named[0] <= whole[0]
    assert set(whole) <= set(named)
    mine = [fault for fault in reported if fault.code == FaultCode.ELECTRODE_OPEN]
    assert [(fault.raised, fault.index, fault.frame) for fault in mine] == [
        (True, 5, named[0]), (False, 5, named[-1] + FAULT_CLEAR_FRAMES),
    ]  # fmt: skip
    for frame in seen:
        if frame.number in whole:
            assert frame.info is not None
            assert set(names(frame.info.diagnostics)) - {"crowded"} == {"electrode open"}
            assert frame.info.masked == uses.sum()
            assert frame.raw is not None
            assert np.isfinite(frame.raw.voltage_v).all()
    assert FaultCode.ELECTRODE_OPEN not in device.info().fault_codes


def _faults(packet: Any) -> list[Fault]:
    from eitskin.device.wire.payloads import parse

    content = parse(packet.type, packet.payload)
    return [content] if isinstance(content, Fault) else []


def test_a_reading_that_is_off_is_left_out_and_counted(image):
    """One burst of one row at half its amplitude."""
    device = device_before(image, skin_of(scene({}), load_prebuilt()[0].protocol))
    device.tare(8)
    board = board_of(device)
    sample, spoiled = board.adc.sample, []

    def spoil(times: np.ndarray, channel: int) -> np.ndarray:
        codes = sample(times, channel)
        swing = float(codes.max()) - float(codes.min())
        if len(spoiled) == 0 and swing > 500 and bursts[0] > 300:
            spoiled.append(swing)
            codes = (2048 + (codes.astype(np.float64) - 2048) / 2).astype(codes.dtype)
        bursts[0] += 1
        return codes

    bursts = [0]
    board.adc.sample = spoil
    frames, faults = taken(device, 5)
    assert spoiled
    rows = [frame.info.outliers for frame in frames if frame.info is not None]
    assert sorted(rows)[:-1] == [0, 0, 0, 0]
    assert 1 <= max(rows) <= 2
    assert [
        names(frame.info.diagnostics) for frame in frames if frame.info and frame.info.outliers
    ] == [("outlier",)]
    assert device.stats().outliers == max(rows)
    assert not faults
