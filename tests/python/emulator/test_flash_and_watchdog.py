"""Programming and erasing flash, what it forbids, how long it takes; the watchdog."""

import pytest
from thumb import CLOCK, compile_program, flat_skin, out, run_program

from eitskin.errors import DeviceError
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_S, TICKS_PER_US
from eitskin_emulator.memory import BANK_BYTES
from emulated import board_of, connect, power_up

OPEN = "FLASH_KEYR = 0x45670123u; FLASH_KEYR = 0xCDEF89ABu;"
WAIT = "while (FLASH_SR & FLASH_SR_BSY) ;"
ERASE = f"FLASH_CR = 2u << 8 | 2u | 5u << 3; FLASH_CR |= 1u << 16; {WAIT}"
WRITE = f"FLASH_CR = 2u << 8 | 1u; REG32(0x08040010u) = 0x12345678u; {WAIT}"
CLOSE = "FLASH_CR = 1u << 31;"


def flashed(body: str, s: float = 3.0, bank: bytes = b"") -> EmulatedBoard:
    last = " OUT[0] = REG32(0x08040010u); OUT[1] = FLASH_SR; OUT[3] = 1; }"
    source = CLOCK + "void program(void) { cycle_counter(); " + body + last
    board = EmulatedBoard(compile_program(source), flat_skin(), (bank,))
    board.run_until(round(s * TICKS_PER_S), lambda: board._asleep)
    return board


def test_a_word_takes_16_us():
    many = (
        "FLASH_CR = 2u << 8 | 1u; for (uint32_t k = 0; k < 100; ++k) { REG32(0x08040010u + 4 * k)"
        " = k; " + WAIT + "}"
    )
    cycles = out(flashed(OPEN + many + "OUT[2] = DWT_CYCCNT;" + CLOSE), 3)[2]
    assert 100 * 256 <= cycles <= 100 * 280


def test_cells_only_go_to_zero():
    board = flashed(OPEN + WRITE + "REG32(0x08040010u) = 0xFF00FF00u;" + WAIT + CLOSE)
    assert out(board, 1) == [0x12345678 & 0xFF00FF00]
    assert board.flash.not_erased == 1


def test_what_flash_refuses():
    locked = flashed(ERASE.replace(WAIT, ""), bank=b"\0" * 64)
    assert out(locked, 1) == [0]
    assert "FLASH: CR written while it is locked" in locked.record.hazards
    barred = flashed("FLASH_KEYR = 1u;" + OPEN + ERASE, bank=b"\0" * 64)
    assert out(barred, 1) == [0]
    narrow = flashed(
        OPEN
        + WRITE.replace("REG32(0x08040010u) = 0x12345678u", "REG16(0x08040010u) = 0x5678u")
        + CLOSE
    )
    assert out(narrow, 2) == [0xFFFFFFFF, 1 << 6]
    with pytest.raises(DeviceError, match="locked up"):
        flashed(
            "REG32(0x08040010u) = 1;" * 2 + "}\nvoid hard_fault(void) { REG32(0x08040010u) = 1;"
        )


def test_time_goes_on_while_the_processor_stands_still():
    """SysTick's interrupt waits for the erase to end; a timer has gone on."""
    source = """
    void systick(void) { ++OUT[2]; OUT[5] = DWT_CYCCNT; STK_CTRL = 0; }
    """
    body = "OUT[2] = 0; RCC_APB1ENR |= 1u << 3; STK_LOAD = 99999; STK_VAL = 0; STK_CTRL = 7; "
    body += "TIM_ARR(TIM5_BASE) = ~0u; T_CR1(TIM5_BASE) = 1;"
    program = (
        "void program(void) { cycle_counter(); "
        + body
        + OPEN
        + ERASE
        + "OUT[4] = TIM_CNT(TIM5_BASE); }"
    )
    board = EmulatedBoard(compile_program(CLOCK + source + program), flat_skin())
    board.run_until(2 * TICKS_PER_S, lambda: board._asleep)
    _, _, ticks, _, counted, at = out(board, 6)
    assert ticks == 1
    assert 16_000_000 <= counted <= 16_000_400
    assert 16_000_000 <= at <= 16_000_400


def test_the_program_s_own_sectors_are_left_alone():
    board = flashed(OPEN + ERASE.replace("5u << 3", "1u << 3"))
    assert out(board, 4)[3] == 1
    assert board.record.unmodelled == {"FLASH: a sector of the program erased": 1}


WATCHDOG = """
void program(void) {
    if (OUT[0] == 0x5A5A) { OUT[1] = RCC_CSR; OUT[2] += 1; return; }
    OUT[0] = 0x5A5A; OUT[2] = 0; RCC_CSR = 1u << 24;
    IWDG_KR = 0xCCCC; IWDG_KR = 0x5555; IWDG_PR = 1; IWDG_RLR = 399;
    while (IWDG_SR) ;
    IWDG_KR = 0xAAAA;
    %s
    for (;;) ;
}
"""


def test_a_watchdog_that_is_not_fed_resets_the_board():
    """400 periods of 32 kHz / 8: 100 ms."""
    board = run_program(WATCHDOG % "", 99_000)
    assert board.record.resets == ["power"]
    board = run_program(WATCHDOG % "", 130_000)
    assert board.record.resets == ["power", "watchdog"]
    flag, csr, again = out(board, 3)
    assert (flag, csr >> 29 & 1, again) == (0x5A5A, 1, 1)


def test_its_registers_are_locked():
    board = run_program("void program(void) { IWDG_PR = 3; OUT[0] = IWDG_PR; }", 100)
    assert out(board, 1) == [0]
    assert board.record.hazards == {"IWDG: PR or RLR written while it is locked": 1}


def test_power_lost_and_back():
    source = "void program(void) { OUT[0] = RCC_CSR; OUT[1] = OUT[2]; OUT[2] = 7; }"
    board = EmulatedBoard(compile_program(source), flat_skin())
    board.run_until(100 * TICKS_PER_US)
    board.reset("pin")
    board.run_until(200 * TICKS_PER_US)
    assert out(board, 2)[1] == 7
    board.lose_power()
    board.run_until(300 * TICKS_PER_US)
    assert out(board, 2)[1] != 7
    assert board.record.resets == ["power", "pin", "power"]


def test_an_image_or_bank_that_is_too_long_is_refused():
    with pytest.raises(DeviceError, match="262145 bytes"):
        EmulatedBoard(bytes(262145), flat_skin())
    with pytest.raises(DeviceError, match="a bank has"):
        EmulatedBoard(bytes(100), flat_skin(), (bytes(BANK_BYTES + 1),))


OPTION_KEYS = "FLASH_OPTKEYR = 0x08192A3Bu; FLASH_OPTKEYR = 0x4C5D6E7Fu;"


@pytest.mark.parametrize(
    ("body", "options", "hazards"),
    [
        (OPTION_KEYS + "FLASH_OPTCR = 0xFFFFAAF0u; FLASH_OPTCR |= 2u;" + WAIT, 0xFFFFAAF1, 0),
        (OPTION_KEYS + "FLASH_OPTCR = 0xFFFFAAF0u;", 0xFFFFAAFD, 0),  # never started
        ("FLASH_OPTCR = 0xFFFFAAF2u;", 0xFFFFAAFD, 1),
        ("FLASH_OPTKEYR = 1u; FLASH_OPTCR = 0xFFFFAAF2u;", 0xFFFFAAFD, 2),
    ],
)
def test_option_bytes_want_keys_and_a_start_and_outlive_a_reset(body, options, hazards):
    board = flashed(body)
    assert sum(board.record.hazards.values()) == hazards
    board.flash.reset()
    assert board.flash.read(0x14, 4) == options


def test_the_image_sets_the_brown_out_level_once_and_nothing_else(image):
    """BOR_LEV, bits 2 and 3, is 0: level 3, the highest."""
    board = board_of(connect(power_up(image, noisy=False)))
    for _ in range(2):
        assert board.flash.read(0x14, 4) == 0xFFFFAAF1
        assert board.flash.options_programmed == 1
        board.lose_power()
        board.run_until(board.clock.now + TICKS_PER_S)
    assert not board.record.hazards


def test_option_bytes_are_left_alone_while_the_supply_is_low(image):
    board = EmulatedBoard(image, flat_skin(), ())
    board.drop_supply(True)
    board.run_until(round(0.1 * TICKS_PER_S))
    assert board.flash.options_programmed == 0


def test_a_debugger_that_halts_the_processor_does_not_meet_the_watchdog(image):
    board = board_of(connect(power_up(image, noisy=False)))
    board.halt(5.0)
    board.run_until(board.clock.now + TICKS_PER_S // 10)
    assert board.record.resets == ["power"]
    board.debug.values[8] = 0  # a program that has not asked for that
    board.halt(5.0)
    board.run_until(board.clock.now + TICKS_PER_S // 10)
    assert board.record.resets == ["power", "watchdog"]
