"""Flashing: the exact command lines of each tool, the places of firmware and model, and refusals.
No board is used."""

import struct
from io import StringIO
from pathlib import Path

import intelhex
import pytest

from eitskin.cli.main import main
from eitskin.device.bank import bank_bytes
from eitskin.device.flash import (
    TOOLS,
    FlashPlan,
    export_flash,
    find_tool,
    plan_flash,
    run_flash,
)
from eitskin.errors import DeviceError, UsageError
from small_models import tiny_blob

IMAGE = struct.pack("<II", 0x2000_4000, 0x0800_0201) + bytes(2000)


@pytest.fixture
def tools(tmp_path, monkeypatch) -> Path:
    """A folder on the path with all three tools, which end as ``FAIL`` says."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in TOOLS:
        (folder / name).write_text("#!/bin/sh\nexit ${FAIL:-0}\n")
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")
    return folder


@pytest.fixture
def image(tmp_path) -> Path:
    path = tmp_path / "firmware image.bin"
    path.write_bytes(IMAGE)
    return path


@pytest.mark.parametrize(
    ("tool", "serial", "said"),
    [
        ("openocd", None, "openocd -f board/st_nucleo_f7.cfg -c 'program {{IMAGE}} verify"
         " 0x08000000' -c 'reset run' -c shutdown"),
        ("st-flash", "0667FF", "st-flash --serial 0667FF --reset write 'IMAGE' 0x08000000"),
        ("pyocd", None, "pyocd load --target stm32f767zi --no-wait --format bin"
         " --base-address 0x08000000 'IMAGE'"),
    ],
)  # fmt: skip
def test_command_lines(image, tools, tool, serial, said):
    plan = plan_flash(image, None, image.parent, tool=tool, serial=serial)
    assert plan.lines() == [said.replace("{{IMAGE}}", f"{{{image}}}").replace("IMAGE", str(image))]
    assert plan.bank_file is None


@pytest.mark.parametrize("tool", TOOLS)
def test_a_model_goes_into_the_first_bank_and_the_other_loses_its_record(tool, image, tools):
    plan = plan_flash(image, tiny_blob(), image.parent, tool=tool)
    assert plan.bank_file is not None
    assert plan.bank_file.read_bytes() == bank_bytes(tiny_blob(), 1)
    text = " ".join(plan.lines())
    assert [word for word in ("0x08000000", "0x08040000", "0x0813ffe0") if word in text] == [
        "0x08000000", "0x08040000", "0x0813ffe0"
    ]  # fmt: skip
    assert (plan.bank_file.parent / "eitskin-no-record.bin").read_bytes() == b"\xff" * 32


def test_the_first_tool_that_is_there_is_taken(tools):
    for first in ("openocd", "st-flash", "pyocd"):
        assert find_tool() == first
        (tools / first).unlink()
        with pytest.raises(DeviceError, match=f"{first} is not installed; install one"):
            find_tool(first)
    with pytest.raises(DeviceError, match="none of openocd, st-flash, pyocd is installed; install"):
        find_tool()
    with pytest.raises(UsageError, match="--tool dfu: use one of openocd, st-flash, pyocd"):
        find_tool("dfu")
    assert find_tool(installed=False) == "openocd"
    assert find_tool("pyocd", installed=False) == "pyocd"


def test_a_tool_that_fails_is_said(image, tools, monkeypatch):
    monkeypatch.setenv("FAIL", "3")
    said = r"flashing failed: st-flash .* ended with 3; is the board plugged in"
    with pytest.raises(DeviceError, match=said) as caught:
        run_flash(plan_flash(image, None, image.parent, tool="st-flash"))
    assert "\n" not in str(caught.value)
    with pytest.raises(DeviceError, match="cannot be run"):
        run_flash(FlashPlan("pyocd", (("/no/such/pyocd",),), image))


def words(stack: int, start: int) -> bytes:
    """The first words of an image."""
    return struct.pack("<II", stack, start) + bytes(2000)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x7fELF" + bytes(600), r"this is an \.elf; give the \.bin"),
        (b"", "no firmware image of this board"),
        (bytes(4000), "no firmware image of this board"),
        (words(0x2000_4000, 0x0800_0200), "no firmware image"),  # not Thumb
        (words(0x2000_4000, 0x0900_0001), "no firmware image"),
        (words(0x1000_0000, 0x0800_0201), "no firmware image"),
        (IMAGE + bytes(256 * 1024), "but firmware has room for 262144"),
    ],
)
def test_what_is_no_firmware_is_refused(content, message, tmp_path, tools):
    (tmp_path / "bad.bin").write_bytes(content)
    with pytest.raises(DeviceError, match=message):
        plan_flash(tmp_path / "bad.bin", None, tmp_path)


def test_a_file_for_the_drive_holds_firmware_and_model_where_a_tool_puts_them():
    bank = bank_bytes(tiny_blob(), 1)
    binary = export_flash(IMAGE, tiny_blob(), ".bin")
    assert binary[: len(IMAGE)] == IMAGE and binary[0x40000:] == bank
    assert set(binary[len(IMAGE) : 0x40000]) == {0xFF}
    assert export_flash(IMAGE, None, ".bin") == IMAGE
    read = intelhex.IntelHex(StringIO(export_flash(IMAGE, tiny_blob(), ".hex").decode("ascii")))
    assert read.tobinstr(start=0x08000000, size=len(IMAGE)) == IMAGE
    assert read.tobinstr(start=0x08040000, size=len(bank)) == bank
    assert read.tobinstr(start=0x0813FFE0, size=32) == b"\xff" * 32
    assert len(read.segments()) == 3


def test_export_writes_one_file_and_says_where_it_goes(tmp_path, image, capsys):
    path = tmp_path / "board.hex"
    assert main(["flash", "--image", str(image), "--no-model", "--export", str(path)]) == 0
    assert "NOD_F767ZI" in capsys.readouterr().out
    loaded = intelhex.IntelHex(str(path))
    assert loaded.tobinstr(start=0x08000000, size=len(IMAGE)) == IMAGE
    assert main(["flash", "--export", str(tmp_path / "board.elf"), "--no-model"]) == 2
    assert "end it in .bin or .hex" in capsys.readouterr().err
    assert main(["flash", "--export", str(path), "--dry-run"]) == 2
