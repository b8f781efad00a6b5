"""The owner's settings and lock on the simulated board; a host that goes stops the current."""

import hashlib
from typing import Any

import pytest

from eitskin.cli.main import main
from eitskin.device.client import Device
from eitskin.device.open import open_device, open_with_files
from eitskin.device.wire.link_table import LIMIT_KEPT, Drive, Setting, Settings
from eitskin.errors import DeviceError
from eitskin.model.prebuilt import load_prebuilt
from eitskin.session.session import KEPT_ON, Session
from eitskin.session.settings import SessionSettings


def test_a_locked_board_wants_its_button():
    with open_device("sim:two_touch") as device:
        device.settings(Setting.LOCKED)
        assert device.reset().settings == Setting.LOCKED
        with pytest.raises(DeviceError, match="hold the blue button"):
            device.upload_model(load_prebuilt()[1])
        device.transport.board.hold_button(True)
        assert device.settings(Setting(0)).settings == 0


def test_current_begins_with_a_tare_and_hashes_are_the_files():
    with open_device("sim:two_touch") as device:
        assert device.board.drive == Drive.OFF
        device.tare(4)
        assert device.info().drive == Drive.ON
        assert device.hashes().model == hashlib.sha256(load_prebuilt()[1]).digest()


def test_a_limit_that_is_not_named_stays(monkeypatch):
    given = []

    def opened(options: object) -> Device:
        device = open_device("sim:two_touch")
        command = device.command

        def noted(one: Any, timeout_s: float) -> Any:
            given.append(one)
            return command(one, timeout_s)

        device.command = noted
        return device

    monkeypatch.setattr("eitskin.cli.cmd_board.open_named", opened)
    assert main(["board", "--lock"]) == 0
    assert given == [Settings(int(Setting.LOCKED), LIMIT_KEPT)]
    with open_device("sim:two_touch") as device:
        assert device.settings(Setting.SENSE, 400).current_limit_ua_rms == 400
        assert device.settings(Setting(0)).current_limit_ua_rms == 400
        assert device.settings(Setting(0), 0).current_limit_ua_rms == 0  # of a source of none


def test_whoever_follows_a_board_hears_that_current_flows_on(
    monkeypatch,
):
    def opened(*url: object, **how: object) -> Device:
        device = open_device("sim:two_touch")
        device.settings(Setting.KEEP_CURRENT)
        return device

    for opening, reported in ((open_with_files, []), (opened, [KEPT_ON])):
        said: list[str] = []
        monkeypatch.setattr("eitskin.session.session.open_with_files", opening)
        with Session("sim:two_touch", SessionSettings(frames=1), say=said.append) as session:
            session.start()
        assert said == reported
