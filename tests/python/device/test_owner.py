"""The owner's settings and lock on the simulated board; a host that goes stops the current."""

from __future__ import annotations

import hashlib

import pytest

from eitskin.device.open import open_device
from eitskin.device.wire.link_table import Drive, Setting
from eitskin.errors import DeviceError
from eitskin.model.prebuilt import load_prebuilt


def test_a_locked_board_wants_its_button() -> None:
    with open_device("sim:two_touch") as device:
        device.settings(Setting.LOCKED)
        assert device.reset().settings == Setting.LOCKED
        with pytest.raises(DeviceError, match="hold the blue button"):
            device.upload_model(load_prebuilt()[1])
        device.transport.board.hold_button(True)  # type: ignore[attr-defined]
        assert device.settings(Setting(0)).settings == 0


def test_current_begins_with_a_tare_and_hashes_are_the_files() -> None:
    with open_device("sim:two_touch") as device:
        assert device.board.drive == Drive.OFF
        device.tare(4)
        assert device.info().drive == Drive.ON
        assert device.hashes().model == hashlib.sha256(load_prebuilt()[1]).digest()
