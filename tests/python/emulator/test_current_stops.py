"""Events that stop the current without the program: loss of the clock or of the supply, a processor
that hangs, a current that is not the source's. The monitor must notice forbidden states."""

import pytest

from eitskin.device.client import Device
from eitskin.device.wire import link_table as commands
from eitskin.device.wire.link_table import Drive, FaultCode, ReplyStatus, Setting, Stream
from eitskin_emulator.analog.ad9833 import Ad9833
from eitskin_emulator.analog.adg1206 import OFF_TICKS, Multiplexers
from eitskin_emulator.analog.drive_monitor import DriveMonitor
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_S, TICKS_PER_US
from eitskin_emulator.peripherals.adc2 import SR
from eitskin_emulator.peripherals.rcc import HSE_HZ
from eitskin_emulator.peripherals.spi import SpiFrame
from emulated import board_of, clean, connect, hang, power_up

OPEN = (None,) * 4
STREAM = commands.StreamCommand(int(Stream.RAW))
WFI_LOOP = bytes.fromhex("30bffde7")  # wfi; b .-2
DEAF_LOOP = bytes.fromhex("72b6fee7")  # cpsid i; b .


def carrying_current(image: bytes, settle_us: int = 16) -> Device:
    device = connect(power_up(image, noisy=False))
    device.scan(settle_us=settle_us)
    assert device.send_command(STREAM, 1.0).ok
    run_until_joined(board_of(device))
    return device


@pytest.fixture
def device(image) -> Device:
    """A board whose skin carries current right now."""
    return carrying_current(image)


@pytest.fixture
def slow_device(image) -> Device:
    """The same with a tenth of the bursts, which go on for as long as a program hangs."""
    return carrying_current(image, settle_us=900)


def run_until_joined(board: EmulatedBoard) -> None:
    board.run_until(board.clock.now + TICKS_PER_S, lambda: None not in board.multiplexers.joined)
    assert None not in board.multiplexers.joined and board.generator.frequency_hz > 0


def opens_after_us(board: EmulatedBoard, most_us: int) -> float:
    """Until no multiplexer joins anything for the rest of ``most_us``."""
    since = board.clock.now
    board.run_until(since + most_us * TICKS_PER_US)
    assert board.multiplexers.joined == OPEN
    opened = board.multiplexers.log[-1].at
    board.multiplexers.log.clear()
    return (opened - since) / TICKS_PER_US


def restarts_for(board: EmulatedBoard, cause: str, fault: FaultCode, within_s: float = 0.2) -> None:
    """Check that ``cause`` restarts the board, that no current flows until then and afterwards, and
    that the board reports the fault."""
    end = board.clock.now + round(within_s * TICKS_PER_S)
    board.run_until(end, lambda: len(board.record.resets) > 1)
    assert board.record.resets == ["power", cause]
    device = connect(board)
    assert device.board.fault_codes == (fault,) and device.board.drive == Drive.OFF
    assert not board.multiplexers.log


def test_without_its_clock(device):
    board = board_of(device)
    board.lose_clock()
    assert opens_after_us(board, 100) < 20
    board.run_until(board.clock.now + TICKS_PER_S // 10)
    assert board.multiplexers.joined == OPEN  # it waits for the clock
    board.lose_clock(HSE_HZ)
    restarts_for(board, "software", FaultCode.CLOCK, 10)


def test_without_its_supply(device):
    board = board_of(device)
    board.drop_supply(True)
    assert opens_after_us(board, 100) < 5
    fed = board.iwdg.feeds
    board.run_until(board.clock.now + 1000 * TICKS_PER_US)
    assert board.iwdg.feeds > fed and board.record.resets == ["power"]  # it waits for the supply
    board.drop_supply(False)
    restarts_for(board, "software", FaultCode.SUPPLY)


def test_a_program_that_hangs(slow_device):
    """The tick opens the multiplexers, later the watchdog resets."""
    board = board_of(slow_device)
    hang(board, WFI_LOOP)
    assert 800e3 < opens_after_us(board, 1_000_000) < 950e3
    for timer in board.timers.values():
        timer.write(0, 4, 0)  # 80,000 bursts would show nothing more
    restarts_for(board, "watchdog", FaultCode.WATCHDOG, 10)
    slow_device.clear_faults()
    assert not slow_device.info().faults


def test_a_processor_that_takes_no_interrupt(slow_device):
    board = board_of(slow_device)
    hang(board, DEAF_LOOP)
    assert opens_after_us(board, 520_000) < 510e3
    restarts_for(board, "watchdog", FaultCode.WATCHDOG)


def doubled_source(board: EmulatedBoard) -> None:
    board.front_end.source_a *= 2


def dead_converter(board: EmulatedBoard) -> None:
    second = board.adc.second
    read = second.read
    second.read = lambda offset, size: 0 if offset == SR else read(offset, size)


@pytest.mark.parametrize("fails", [doubled_source, dead_converter])
def test_a_current_that_is_not_the_source_s(device, fails):
    board = board_of(device)
    device.settings(Setting.SENSE)
    assert device.send_command(STREAM, 1.0).ok
    device.next_item(0.1)
    before = device.info()
    assert before.drive == Drive.ON and before.current_limit_ua_rms == 437
    assert before.current_ua_rms == pytest.approx(353.6, rel=0.02)  # 0.5 mA amplitude
    run_until_joined(board)
    fails(board)
    assert opens_after_us(board, 70_000) < 60e3
    tripped = device.info()
    assert tripped.drive == Drive.TRIPPED
    # twice the current is beyond the converter's range as well
    assert set(tripped.fault_codes) - {FaultCode.SATURATED} == {FaultCode.CURRENT}
    if fails is doubled_source:
        assert tripped.current_ua_rms == pytest.approx(2 * 353.6, rel=0.02)
    assert device.send_command(STREAM, 1.0).status == ReplyStatus.TRIPPED
    device.clear_faults()
    assert device.send_command(STREAM, 1.0).ok  # as the user asks; it will trip again
    clean(board)


# ---- the monitor ----


class Watched:
    """Generator and multiplexers that a test drives by hand, a millisecond after power came."""

    def __init__(self) -> None:
        self.generator, self.muxes = Ad9833(), Multiplexers()
        self.at, self.heard, self.may_be_silent = TICKS_PER_S // 1000, None, False
        self.monitor = DriveMonitor(
            self.generator, self.muxes, lambda: self.heard, lambda: self.may_be_silent
        )
        self.generator.set_mclk(0, HSE_HZ)
        self.generator.took = self.monitor.word
        self.muxes.switched = lambda switching: self.monitor.switched(switching.at)

    heard: int | None

    def do(self, step: str, value: int = 0) -> None:
        if step == "word":
            self.generator.fsync(self.at, 0)
            self.generator.shifted(SpiFrame(value, 16, 1, 0, self.at, self.at))
            self.generator.fsync(self.at, 1)
        elif step == "addresses":
            self.muxes.set_addresses(self.at, value)
        elif step == "enables":
            self.muxes.set_enables(self.at, value)
        elif step == "wait":
            self.at += value
        elif step == "host":
            self.heard = self.at
        elif step == "restart":
            self.monitor.start(self.at)
        elif step == "look":
            self.monitor.look(self.at)


RUNS = [("word", word) for word in (0x2100, 0x50C7, 0x4000, 0xC000, 0x2000)]
ROW = [("addresses", 0x3210), ("wait", OFF_TICKS), ("enables", 0xF)]
NEXT = [("enables", 0), ("wait", OFF_TICKS), ("addresses", 0x4321), ("enables", 0xF)]
SOUND = [("host", 0), *RUNS, *ROW, *NEXT]
ALONE = TICKS_PER_S + 1


@pytest.mark.parametrize(
    ("trace", "words"),
    [
        (SOUND, ""),
        ([*SOUND, ("wait", ALONE), ("host", 0), ("look", 0)], ""),
        ([*SOUND, ("addresses", 0x3210)], "changed its address while enabled"),
        (
            [*SOUND, ("enables", 0), ("wait", OFF_TICKS - 1), ("addresses", 0)],
            "changed its address before it was open",
        ),
        ([("host", 0), ("addresses", 0x3211), ("enables", 0xF)], "I+ and I- are both on"),
        ([("host", 0), ("addresses", 0x2210), ("enables", 0xF)], "V+ and V- are both on"),
        ([*SOUND, ("word", 0x2000)], "the generator took 0x2000 while multiplexers are enabled"),
        ([*SOUND, ("word", 0x2100)], ""),  # a reset is always right
        ([*RUNS, *ROW], "no host has asked"),
        ([*SOUND, ("wait", 10), ("restart", 0), ("look", 0)], "no host has asked"),
        ([*SOUND, ("wait", ALONE), ("look", 0)], "1 s after the host's last packet"),
        ([*SOUND, ("wait", ALONE), ("enables", 0x3)], "1 s after the host's last packet"),
        ([*SOUND, ("wait", ALONE - 1 - OFF_TICKS * 2), ("look", 0)], ""),
    ],
)
def test_the_monitor_sees_what_must_never_be(trace, words):
    watched = Watched()
    for step in trace:
        watched.do(*step)
    found = watched.monitor.violations
    assert words in found[0] if words else not found, found


def test_the_owner_s_setting_excuses_silence_alone():
    watched = Watched()
    watched.may_be_silent = True
    for step in [*SOUND, ("wait", ALONE), ("look", 0)]:
        watched.do(*step)
    assert not watched.monitor.violations
    watched.do("addresses", 0)
    assert watched.monitor.violations
