"""The owner's settings and lock on the simulated board; a host that goes stops the current."""

import hashlib
import json
from typing import Any

import pytest

from eitskin.cli.main import main
from eitskin.device.client import Device
from eitskin.device.open import open_device, open_with_files
from eitskin.device.wire.link_table import KEPT, Drive, Setting, Settings
from eitskin.errors import DeviceError, UsageError
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
    assert given == [Settings(int(Setting.LOCKED), KEPT, "", KEPT, KEPT)]
    with open_device("sim:two_touch") as device:
        assert device.settings(Setting.SENSE, 400).current_limit_ua_rms == 400
        assert device.settings(Setting(0)).current_limit_ua_rms == 400
        assert device.settings(Setting(0), 0).current_limit_ua_rms == 0  # of a source of none


def test_a_board_keeps_its_name_with_the_settings():
    with open_device("sim:two_touch") as device:
        assert device.board.name == ""
        assert device.settings(Setting.SENSE, 400, "left-arm").name == "left-arm"
        info = device.settings(Setting.LOCKED)  # the name stays where none is given
        assert (info.name, info.current_limit_ua_rms) == ("left-arm", 400)
        assert device.reset().name == "left-arm"
        with pytest.raises(DeviceError, match="hold the blue button"):
            device.settings(Setting(0), name="right")
        device.transport.board.hold_button(True)
        assert device.settings(Setting(0), name="x" * 32).name == "x" * 32
        for name in ("a b", "-a", "a/b", "ä", "a" * 33, "a\n"):
            with pytest.raises(UsageError, match="use 1 to 32 letters"):
                device.settings(Setting(0), name=name)
        assert device.settings(Setting(0), name="").name == ""


def test_a_command_names_a_board(monkeypatch, capsys):
    boards = []

    def opened(options: object) -> Device:
        board = open_device("sim:two_touch")
        board.settings(Setting.SENSE, 400, "old")
        boards.append(board)
        return board

    monkeypatch.setattr("eitskin.cli.cmd_board.open_named", opened)
    monkeypatch.setattr("eitskin.cli.cmd_info.open_named", opened)
    for options, name in ((["--name", "left"], "left"), (["--no-name"], ""), (["--lock"], "old")):
        assert main(["board", "--json", *options]) == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["name"] == name
        assert boards[-1].board.name == name
        assert Setting(boards[-1].board.settings) & Setting.SENSE
    assert main(["info"]) == 0
    assert "\nname        old\n" in capsys.readouterr().out
    for name in ("", "a b", "a/b"):
        assert main(["board", "--name", name]) == 2, name
        assert "use 1 to 32 letters" in capsys.readouterr().err


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
