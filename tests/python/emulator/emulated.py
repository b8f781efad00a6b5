"""The real firmware image on the emulated board, before scenes without noise or with."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from eitskin.core.results import Reconstruction
from eitskin.device.bank import bank_bytes
from eitskin.device.client import Device
from eitskin.device.known_model import KnownModel, board_options
from eitskin.device.transport import LinkEvent, Transport
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import RawFrame
from eitskin.model.eitm import decode_model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.library_scenes import find_scene
from eitskin.session.assemble import assembled
from eitskin.session.checks.host_check import HostCheck, HostTwin
from eitskin.session.frame import Frame, Notice
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_S
from eitskin_emulator.memory import RAM
from eitskin_emulator.scene_skin import skin_of
from eitskin_emulator.transport import EmulatedTransport

IMAGE = "firmware/eitskin_nucleo_f767zi.bin"
EVERYTHING = Stream.RAW | Stream.IMAGE | Stream.TOUCHES | Stream.EVENTS


def power_up(
    image: bytes, *, scene: str = "two_touch", noisy: bool = True, model: bytes | None = None
) -> EmulatedBoard:
    """A board that has just got power, with ``model`` (or the prebuilt one) in bank 0."""
    decoded, blob = load_prebuilt() if model is None else (decode_model(model, "the model"), model)
    described = find_scene(scene)
    if not noisy:
        described = replace(described, effects={})
    return EmulatedBoard(image, skin_of(described, decoded.protocol), (bank_bytes(blob, 1),))


def connect(board: EmulatedBoard) -> Device:
    """The host on the board's line, once it speaks."""
    transport: Transport = EmulatedTransport("test", board)
    board.run_until(
        board.clock.now + TICKS_PER_S, lambda: board.line.up_next_end() <= board.clock.now
    )
    return Device(transport)


def restarted(device: Device) -> Device:
    """The same board after it lost its power, and the host that connects again."""
    board = board_of(device)
    board.lose_power()
    return connect(board)


def hang(board: EmulatedBoard, code: bytes) -> None:
    """Let the processor execute ``code`` at the end of RAM, where the program has nothing."""
    at = board.memories.ram
    at[-64 : -64 + len(code)] = code
    board.cpu.pc = RAM + len(at) - 64
    board.cpu.masks.write((0, 0, 0))


def board_of(device: Device) -> EmulatedBoard:
    """The emulated board behind ``device``."""
    transport: Any = device.transport
    return transport.board


def raw_frames(device: Device, count: int) -> list[RawFrame]:
    """Raw frames of scans that begin from now on: two were under way."""
    frames = [
        item for item in device.stream(Stream.RAW, frames=count + 2) if isinstance(item, RawFrame)
    ]
    return frames[2:]


def twin_check(
    device: Device, blob: bytes, frames: int, untouched: int = 4
) -> tuple[HostCheck, list[Frame], list[Reconstruction | None]]:
    """Tare with raw frames, begin the scene, stream everything, and hold it against the host's core
    and its results."""
    from eitskin.device.wire import link_table as commands

    taken: list[Any] = []
    device.send_command(commands.StreamCommand(int(Stream.RAW)), 1.0)
    device.tare(untouched)
    device.send_command(commands.StreamCommand(0), 1.0)
    while (item := device.next_item(0.05)) is not None:
        taken.append(item)
    device.start_scene()
    model = decode_model(blob, "the model")
    board = device.board
    twin = HostTwin(KnownModel(model, blob), board_options(model, board), board)
    for item in taken:
        if isinstance(item, RawFrame) and item.untouched:
            twin.take(Frame(item.frame, 0, item.time_us, raw=item))
    seen, results = [], []
    for item in assembled(device.stream(EVERYTHING, frames=frames), EVERYTHING):
        if isinstance(item, Notice) and isinstance(item.cause, LinkEvent):
            twin.lost()  # the line does not carry all at full rate
        elif isinstance(item, Frame):
            seen.append(item)
            results.append(twin.take(item))
    return twin.check, seen, results


def clean(board: EmulatedBoard) -> None:
    """Nothing that the firmware did was wrong, unknown or dangerous."""
    report = board.report()
    assert report.clean, report
    assert board.generator.ignored_bits == board.generator.early_clocks == 0
    assert board.flash.not_erased == 0
    assert board.usart.bytes_lost == 0


def image_of(build: Path) -> bytes:
    """The firmware image of a build."""
    return (build / IMAGE).read_bytes()
