"""Behaviour of the firmware in failures: uploads that are cut at any byte, a program that crashes
or hangs, noise on the line."""

import numpy as np
import pytest

from eitskin.device.client import Device
from eitskin.device.wire import link_table as commands
from eitskin.device.wire.link_table import FaultCode, Stream
from eitskin.device.wire.packets import Fault
from eitskin_emulator.clocktime import TICKS_PER_S, TICKS_PER_US
from eitskin_emulator.memory import RAM
from emulated import clean, connect, hang, power_up

LOAD_NOWHERE = bytes.fromhex("4ff0c0400068fee7")  # mov.w r0, #0x60000000; ldr r0, [r0]; b .


def faults_of(device: Device) -> list[Fault]:
    """Return the faults that the board reports now without being asked."""
    reported = []
    while (item := device.next_item(0.1)) is not None:
        if isinstance(item, Fault):
            reported.append(item)
    return reported


def test_a_program_that_crashes_opens_the_multiplexers_and_says_where(image):
    board = power_up(image)
    device = connect(board)
    device.send_command(commands.StreamCommand(int(Stream.RAW)), 1.0)
    joined = lambda: None not in board.multiplexers.joined  # noqa: E731
    board.run_until(board.clock.now + TICKS_PER_S, lambda: joined() and board._asleep)
    assert joined()
    at_reset, reset = [], board.reset
    hang(board, LOAD_NOWHERE)

    def noted(cause: str) -> None:
        at_reset.append(board.multiplexers.joined)
        reset(cause)

    board.reset = noted
    board.run_until(board.clock.now + TICKS_PER_S, lambda: len(board.record.resets) > 1)
    assert board.record.resets == ["power", "software"] and at_reset == [(None,) * 4]
    reported = [fault for fault in faults_of(device) if fault.code == FaultCode.CRASH]
    assert reported
    pc, _, cfsr, _, address = reported[0].words
    assert pc == RAM + len(board.memories.ram) - 64 + 4
    assert address == 0x60000000
    assert cfsr & (1 << 15 | 1 << 7)
    assert FaultCode.CRASH in device.info().fault_codes


def test_the_stack_is_guarded(image):
    """A store below the stack is a memory fault."""
    board = power_up(image)
    device = connect(board)
    board.run_until(board.clock.now + 1000 * TICKS_PER_US, lambda: board._asleep)
    hang(board, bytes.fromhex("4ff000500160fee7"))  # mov.w r0, #0x20000000; str r1, [r0]; b .
    board.run_until(board.clock.now + TICKS_PER_S, lambda: len(board.record.resets) > 1)
    reported = [fault for fault in faults_of(device) if fault.code == FaultCode.CRASH]
    assert reported
    assert reported[0].words[4] == 0x20000000


def test_noise_on_the_line_is_counted_and_nothing_else(image):
    board = power_up(image)
    device = connect(board)
    generator = np.random.default_rng(8)
    for size in (1, 30, 400, 3000):
        board.send(generator.integers(0, 256, size, dtype=np.uint8).tobytes())
        board.run_until(board.clock.now + (10 * size + 3000) * TICKS_PER_US)
        assert device.info().faults == 0
    stats = device.stats()
    assert stats.link_crc_errors + stats.link_framing_errors + stats.link_overruns > 0
    clean(board)


@pytest.mark.long("test_noise_on_the_line_is_counted_and_nothing_else")
def test_a_slow_line_drops_whole_packets_and_counts_them(image):
    """Images and raw frames of every frame are more than 1 Mbaud carries at 48 frames a second."""
    board = power_up(image)
    device = connect(board)
    device.tare(4)
    device.link.send(commands.StreamCommand.TYPE, commands.StreamCommand(7).payload(4711))
    board.run_until(board.clock.now + TICKS_PER_S)
    stats = device.stats()
    gaps = device.counters
    assert (gaps.crc_errors, gaps.framing_errors) == (0, 0)
    assert stats.link_crc_errors == 0
    assert stats.packets_dropped > 0
    assert gaps.missing <= stats.packets_dropped
    device.send_command(commands.StreamCommand(0), 1.0)
    clean(board)
