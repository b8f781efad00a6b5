"""USART3 with DMA on the line to the host, SPI3 to the generator: bytes, words, their times, and
what goes wrong."""

import pytest
from thumb import CLOCK, compile_program, flat_skin, out, run_program

from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_US
from eitskin_emulator.serial_line import resampled

SERIAL = """
    clock_216();
    RCC_APB1ENR |= 1u << 18; RCC_AHB1ENR |= 1u << 3 | 1u << 21; (void)RCC_AHB1ENR;
    GPIO_AFRH(GPIOD_BASE) = 7u | 7u << 4; GPIO_MODER(GPIOD_BASE) = 2u << 16 | 2u << 18;
    USART_BRR(USART3_BASE) = 54; USART_CR3(USART3_BASE) = 3u << 6;
"""
SEND = """
void irq_14(void) {
    OUT[1] = DMA_LISR(DMA1_BASE); OUT[2] = U_ISR(USART3_BASE);
    DMA_LIFCR(DMA1_BASE) = 0x3Du << 22; ++OUT[0];
}
void program(void) {
    OUT[0] = 0;
    %s
    for (uint32_t k = 0; k < 100; ++k) ((volatile uint8_t *)0x20011000u)[k] = (uint8_t)(k * 7 + 1);
    USART_CR1(USART3_BASE) = 13;
    DMA_PAR(DMA1_BASE, 3) = USART3_BASE + 0x28; DMA_M0AR(DMA1_BASE, 3) = 0x20011000u;
    DMA_NDTR(DMA1_BASE, 3) = 100;
    NVIC_ISER(0) = 1u << 14;
    DMA_CR(DMA1_BASE, 3) = 4u << 25 | DMA_CR_MINC | 1u << 6 | DMA_CR_TCIE | 1;
}
"""
SENT = bytes((k * 7 + 1) % 256 for k in range(100))


def sending(setup: str = SERIAL, us: float = 2000) -> EmulatedBoard:
    return run_program(CLOCK + SEND % setup, us, (14,))


@pytest.mark.parametrize(
    "change",
    [
        ("1u << 18", "0"),
        ("2u << 16 |", ""),
        ("7u |", "0 |"),
        ("= 3u << 6", "= 1u << 6"),
        ("| 1u << 21", ""),
    ],
    ids=["clock off", "pin mode", "pin function", "no DMAT", "DMA off"],
)
def test_nothing_is_sent_when_something_is_missing(change):
    assert change[0] in SERIAL
    board = sending(SERIAL.replace(*change))
    assert board.receive() == b""


def test_a_wrong_baud_rate_is_garbage():
    for divisor in (27, 50, 58, 108, 468):
        assert sending(SERIAL.replace("= 54", f"= {divisor}"), 9000).receive() not in (b"", SENT)
    for divisor in (53, 55):
        assert sending(SERIAL.replace("= 54", f"= {divisor}")).receive() == SENT


def test_sampling_at_another_rate():
    assert resampled(b"\x55\xaa\x00\xff", 100, 100) == b"\x55\xaa\x00\xff"
    assert resampled(b"\x00", 200, 100) == b"\x00\x00" or resampled(b"\x00", 200, 100)[0] == 0
    assert resampled(b"\xf0" * 4, 100, 200) != b"\xf0" * 4


RECEIVE = """
void irq_12(void) { DMA_LIFCR(DMA1_BASE) = 0x3Du << 6; ++OUT[0]; }
void irq_39(void) {
    uint32_t s = U_ISR(USART3_BASE); USART_ICR(USART3_BASE) = 0x1F;
    OUT[2 + OUT[1] %% 8] = s & 0x1F; OUT[10 + OUT[1]++ %% 8] = DMA_NDTR(DMA1_BASE, 1);
}
void program(void) {
    OUT[0] = OUT[1] = 0;
    %s
    DMA_PAR(DMA1_BASE, 1) = USART3_BASE + 0x24; DMA_M0AR(DMA1_BASE, 1) = 0x20011000u;
    DMA_NDTR(DMA1_BASE, 1) = 64;
    DMA_CR(DMA1_BASE, 1) = 4u << 25 | DMA_CR_MINC | DMA_CR_CIRC | DMA_CR_TCIE | 1;
    NVIC_ISER(0) = 1u << 12; NVIC_ISER(1) = 1u << 7;
    USART_CR1(USART3_BASE) = 13 | 1u << 4;
}
"""


def receiving(chunks: list[bytes], setup: str = SERIAL, gap_us: int = 500) -> EmulatedBoard:
    board = EmulatedBoard(compile_program(CLOCK + RECEIVE % setup, (12, 39)), flat_skin())
    board.run_until(500 * TICKS_PER_US)
    for chunk in chunks:
        board.send(chunk)
        board.run_until(board.clock.now + (10 * len(chunk) + gap_us) * TICKS_PER_US)
    return board


def test_idle_comes_a_byte_time_after_the_last_byte():
    board = EmulatedBoard(compile_program(CLOCK + RECEIVE % SERIAL, (12, 39)), flat_skin())
    board.run_until(500 * TICKS_PER_US)
    began = board.clock.now
    board.send(bytes(20))
    board.run_until(began + 2000 * TICKS_PER_US, lambda: board.record.interrupts[16 + 39] > 0)
    assert 210 * TICKS_PER_US <= board.clock.now - began <= 211 * TICKS_PER_US


def test_a_receiver_at_another_rate_hears_garbage_and_framing_errors():
    data = bytes(range(1, 60))
    board = receiving([data], SERIAL.replace("= 54", "= 468").replace("3u << 6", "3u << 6 | 1"))
    assert data[:16] not in board.memories.ram[0x11000 : 0x11000 + 64]
    assert any(status & 1 << 1 for status in out(board, 10)[2:])


def test_single_bytes_overrun():
    source = (
        """
    void irq_39(void) {
        OUT[0] |= U_ISR(USART3_BASE) & 1u << 3; OUT[1] = U_RDR(USART3_BASE);
        USART_ICR(USART3_BASE) = 1u << 3;
        for (uint32_t k = 0; k < %d; ++k) __asm volatile("nop"); ++OUT[2]; }
    void program(void) { OUT[0] = OUT[2] = 0; """
        + SERIAL
        + """
        NVIC_ISER(1) = 1u << 7; USART_CR1(USART3_BASE) = 13 | 1u << 5; }"""
    )
    for wait, overrun in ((10, 0), (3000, 1 << 3)):
        board = EmulatedBoard(
            compile_program(CLOCK + source.replace("3u << 6;", "0;") % wait, (39,)), flat_skin()
        )
        board.run_until(500 * TICKS_PER_US)
        board.send(bytes(range(10)))
        board.run_until(board.clock.now + 3000 * TICKS_PER_US)
        found, last, taken = out(board, 3)
        assert found == overrun
        assert (taken == 10 and last == 9) or overrun


# ---- SPI3 and the generator ----

SPI = """
    clock_216();
    RCC_APB1ENR |= 1u << 15; RCC_AHB1ENR |= 1u | 1u << 2 | 1u << 3; (void)RCC_AHB1ENR;
    GPIO_MODER(GPIOA_BASE) = 0xA8020000u;
    GPIO_BSRR(GPIOD_BASE) = 1u << 2; GPIO_MODER(GPIOD_BASE) = 1u << 4;
    GPIO_AFRH(GPIOC_BASE) = 6u << 8 | 6u << 16; GPIO_MODER(GPIOC_BASE) = 2u << 20 | 2u << 24;
    SPI_CR2(SPI3_BASE) = 15u << 8;
    SPI_CR1(SPI3_BASE) = @ | 3u << 3 | 1u << 2 | 3u << 8 | 1u << 6;
"""
WORDS = (0x2100, 0x50C7, 0x4000, 0xC000, 0x2000)  # AN-1070: 400 Hz at 25 MHz
SHIFT = """
static void word(uint16_t value) {
    GPIO_BSRR(GPIOD_BASE) = 1u << 18;
    SPI_DR(SPI3_BASE) = value;
    while (SPI_SR(SPI3_BASE) & (3u << 11)) ;
    while (SPI_SR(SPI3_BASE) & (1u << 7)) ;
    GPIO_BSRR(GPIOD_BASE) = 1u << 2;
}
void program(void) {
    %s word(0x2100); word(0x50C7); word(0x4000); word(0xC000); word(0x2000); OUT[0] = 1;
}
"""
CPOL, CPHA = "2", "1"


def shifted(setup: str = SPI, mode: str = CPOL, shift: str = SHIFT) -> EmulatedBoard:
    return run_program(CLOCK + shift % setup.replace("@", mode), 1000)


@pytest.mark.parametrize("mode", ["0", "3"], ids=["mode 0", "mode 3"])
def test_wrong_modes_garble_every_word(mode):
    words = shifted(mode=mode).generator.words
    assert len(words) == 5
    assert all(got != sent for got, sent in zip(words[1:3], WORDS[1:3], strict=True))


def test_mode_1_clocks_too_early():
    generator = shifted(mode="1").generator
    assert generator.words == list(WORDS)
    assert generator.early_clocks == 5


@pytest.mark.parametrize(
    ("setup", "shift", "words"),
    [
        (SPI.replace("RCC_APB1ENR |= 1u << 15;", ""), SHIFT, 0),
        (SPI.replace("2u << 20 |", "0 |"), SHIFT, 0),
        (SPI.replace("6u << 16", "5u << 16"), SHIFT, 0),
        (SPI, SHIFT.replace("GPIO_BSRR(GPIOD_BASE) = 1u << 18;", ""), 0),
        (SPI, SHIFT.replace("while (SPI_SR(SPI3_BASE) & (1u << 7)) ;", ""), 0),
        (SPI.replace("GPIO_MODER(GPIOD_BASE) = 1u << 4;", ""), SHIFT, 0),
        (SPI.replace("15u << 8", "7u << 8"), SHIFT, 5),
        (SPI.replace("@ |", "@ | 1u << 7 |"), SHIFT, 5),
    ],
    ids=[
        "clock off", "pin mode", "pin function", "no FSYNC", "FSYNC too soon", "FSYNC no output",
        "8 bits", "LSB first",
    ],
)  # fmt: skip
def test_what_does_not_reach_the_generator(setup, shift, words):
    assert (setup, shift) != (SPI, SHIFT)
    board = shifted(setup, shift=shift)
    assert len(board.generator.words) == words
    if words and "7u << 8" in setup:
        assert board.generator.words == [
            word << 8 & 0xFF00 | word >> 8 for word in WORDS
        ]  # two frames a word, low byte first
    elif words:
        assert board.generator.words == [int(f"{word:016b}"[::-1], 2) for word in WORDS]


def test_a_word_takes_its_time():
    """16 bits at 54 MHz / 16: 4.74 us from the write to BSY's end."""
    source = SHIFT.replace(
        "SPI_DR(SPI3_BASE) = value;", "uint32_t t = DWT_CYCCNT; SPI_DR(SPI3_BASE) = value;"
    ).replace(
        "GPIO_BSRR(GPIOD_BASE) = 1u << 2;\n}",
        "OUT[1] = DWT_CYCCNT - t;\n    GPIO_BSRR(GPIOD_BASE) = 1u << 2;\n}",
    )
    cycles = out(shifted(SPI + "cycle_counter();", shift=source), 2)[1]
    assert 1024 <= cycles <= 1040
