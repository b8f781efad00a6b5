"""Clocks, timers and their triggers, the converter and its DMA: what they do when."""

from typing import Any

import numpy as np
import pytest
from thumb import CLOCK, compile_program, flat_skin, out, run_program

from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_US

TIMERS_ON = "RCC_APB1ENR |= 0xB; (void)RCC_APB1ENR;"


def test_clocks_and_their_hazards():
    board = run_program(CLOCK + "void program(void) { clock_216(); OUT[0] = RCC_CFGR; }", 1000)
    rcc = board.rcc
    found = rcc.sysclk_hz, rcc.hclk_hz, rcc.apb_hz(1), rcc.apb_hz(2), rcc.timer_hz(1)
    assert found == (216e6, 216e6, 54e6, 108e6, 108e6)
    assert rcc.mco1_hz == 8_000_000
    assert board.clock.cycle_ticks == 2
    assert not board.record.hazards
    for text, left_out in {
        "too few wait states": "FLASH_ACR = 7u;",
        "without over-drive": "PWR_CR1 |= PWR_CR1_ODSWEN;",
        "APB1 above 54": "",
    }.items():
        source = CLOCK.replace(left_out, "") if left_out else CLOCK.replace("5u << 10", "4u << 10")
        source = (
            source.replace("!(PWR_CSR1 & PWR_CSR1_ODSWRDY) || ", "") if "over" in text else source
        )
        board = run_program(source + "void program(void) { clock_216(); }", 1000)
        assert any(text in hazard for hazard in board.record.hazards), board.record.hazards


def test_without_the_8_mhz_the_clock_is_never_ready():
    waits = "while (!(RCC_CR & RCC_CR_HSERDY)) ; OUT[0] = 1;"
    source = "void program(void) { RCC_CR |= RCC_CR_HSEBYP; RCC_CR |= RCC_CR_HSEON; " + waits + " }"
    board = EmulatedBoard(compile_program(source), flat_skin(), hse_hz=None)
    board.run_until(10_000 * TICKS_PER_US)
    assert out(board, 1) != [1]
    assert run_program(source, 100).memories.ram[0x10000] == 1


def test_a_switch_to_a_clock_that_is_not_ready_is_refused():
    board = run_program("void program(void) { RCC_CFGR = 2; OUT[0] = RCC_CFGR; }", 100)
    assert out(board, 1) == [0]
    assert "RCC: SYSCLK switched to a source that is not ready" in board.record.hazards


def test_a_counter_counts_as_its_prescaler_says():
    """TIM5 at 1 MHz against CYCCNT at 216 MHz; the prescaler works from the first update on."""
    source = f"""
    void program(void) {{
        clock_216(); cycle_counter(); {TIMERS_ON}
        TIM_ARR(TIM5_BASE) = 0xFFFFFFFFu; TIM_PSC(TIM5_BASE) = 107;
        T_CR1(TIM5_BASE) = 1; uint32_t t0 = TIM_CNT(TIM5_BASE);
        __asm volatile(".rept 108\\n nop\\n .endr"); OUT[0] = TIM_CNT(TIM5_BASE) - t0;
        TIM_EGR(TIM5_BASE) = 1; uint32_t c0 = DWT_CYCCNT;
        while (TIM_CNT(TIM5_BASE) < 1000) ; OUT[1] = DWT_CYCCNT - c0;
        TIM_CNT(TIM5_BASE) = 0xFFFFFFF0u; while (TIM_CNT(TIM5_BASE) > 1000) ;
        OUT[2] = DWT_CYCCNT - c0 - OUT[1];
    }}"""
    unprescaled, cycles, wrap = out(run_program(CLOCK + source, 3000), 3)
    assert 54 <= unprescaled <= 60
    assert 216_000 <= cycles <= 216_010
    assert 15 * 216 <= wrap <= 16 * 216 + 20


CHAIN = f"""
    clock_216(); cycle_counter(); {TIMERS_ON}
    RCC_APB2ENR |= 1u << 8; RCC_AHB1ENR |= 1u | 1u << 22; (void)RCC_APB2ENR;
    GPIO_MODER(GPIOA_BASE) |= 3u << 6;
    ADC_CCR = 1u << 16; ADC_SQR3(ADC1_BASE) = 3; ADC_CR2(ADC1_BASE) = 1;
    TIM_PSC(TIM5_BASE) = 107; TIM_ARR(TIM5_BASE) = 0xFFFFFFFFu; TIM_EGR(TIM5_BASE) = 1;
    TIM_CR2(TIM5_BASE) = 3u << 4; T_CR1(TIM5_BASE) = 1;
    TIM_PSC(TIM3_BASE) = 107; TIM_EGR(TIM3_BASE) = 1; TIM_ARR(TIM3_BASE) = 99;
    TIM_CNT(TIM3_BASE) = 99;
    TIM_CCR1(TIM3_BASE) = 80; TIM_CCMR1(TIM3_BASE) = 6u << 4; TIM_CR2(TIM3_BASE) = 4u << 4;
    TIM_SMCR(TIM2_BASE) = 5u | 2u << 4; TIM_CR2(TIM2_BASE) = 2u << 4;
    TIM_ARR(TIM2_BASE) = 107; TIM_CNT(TIM2_BASE) = 54;
    T_CR1(TIM2_BASE) = 1;
    DMA_PAR(DMA2_BASE, 0) = 0x4001204Cu; DMA_M0AR(DMA2_BASE, 0) = 0x20011000u;
    DMA_M1AR(DMA2_BASE, 0) = 0x20012000u;
    DMA_NDTR(DMA2_BASE, 0) = 80;
    DMA_CR(DMA2_BASE, 0) =
        DMA_CR_DBM | 1u << 13 | 1u << 11 | DMA_CR_MINC | DMA_CR_CIRC | DMA_CR_TCIE;
    DMA_CR(DMA2_BASE, 0) |= 1;
    ADC_CR2(ADC1_BASE) = 1u | 1u << 8 | 1u << 9 | 1u << 28 | 11u << 24;
    NVIC_ISER(1) = 1u << 24;
    TIM_SMCR(TIM3_BASE) = 6u | 2u << 4;
    uint32_t at = TIM_CNT(TIM5_BASE) + 40; TIM_CCR1(TIM5_BASE) = at - 1; OUT[0] = at; OUT[1] = 0;
"""
BURSTS = """
void irq_56(void) {
    uint32_t n = OUT[1]++;
    OUT[2 + 2 * n] = TIM_CNT(TIM5_BASE); OUT[3 + 2 * n] = DMA_CR(DMA2_BASE, 0) >> 19 & 1;
    DMA_LIFCR(DMA2_BASE) = 0x3D;
    if (n == 5) { T_CR1(TIM3_BASE) = 0; T_CR1(TIM2_BASE) = 0; }
}
void program(void) { %s }
"""


def watched(
    source: str, us: float, irqs: tuple[int, ...] = (56,)
) -> tuple[EmulatedBoard, list[np.ndarray]]:
    """A board after ``source``, and the instants (ticks) at which the converter sampled, call by
    call."""
    board = EmulatedBoard(compile_program(CLOCK + source, irqs), flat_skin())
    times: list[np.ndarray] = []

    def sample(at: Any, channel: int) -> Any:
        assert channel == 3
        times.append(at)
        return (
            np.arange(board.adc.conversions, board.adc.conversions + len(at), dtype=np.uint16)
            % 4096
        )

    board.adc.sample = sample
    board.run_until(round(us * TICKS_PER_US))
    return board, times


def test_sample_instants_follow_the_microsecond_clock():
    """Sample k of a slot is taken k + 1/2 us after TIM5 reached the slot's start, and the sampling
    time later."""
    source = BURSTS % (CHAIN + "while (TIM_CNT(TIM5_BASE) < at) ; OUT[20] = DWT_CYCCNT;")
    board, times = watched(source, 1500)
    began = out(board, 21)[20] * 2  # ticks, from the counter's start
    first = int(times[0][0]) - 3 * 16
    counter_zero = board.dwt._began
    assert (
        abs(first - (counter_zero + began) - TICKS_PER_US // 2) < 40
    )  # the program's loop sees it up to 10 instructions late


@pytest.mark.parametrize(
    ("change", "conversions", "interrupts"),
    [
        (("RCC_APB2ENR |= 1u << 8;", ""), 0, 0),
        (("1u << 28 | 11u << 24", "1u << 28 | 2u << 24"), 0, 0),
        (("TIM_CR2(TIM2_BASE) = 2u << 4;", ""), 0, 0),
        (("NVIC_ISER(1) = 1u << 24;", ""), None, 0),
        (("TIM_SMCR(TIM3_BASE) = 6u | 2u << 4;", "TIM_SMCR(TIM3_BASE) = 6u | 1u << 4;"), 0, 0),
    ],
    ids=["clock off", "another trigger", "no TRGO", "interrupt off", "another master"],
)
def test_a_missing_link_of_the_chain(change, conversions, interrupts):
    assert change[0] in CHAIN
    board, _ = watched(BURSTS % CHAIN.replace(*change), 800)
    if conversions is not None:
        assert board.adc.conversions == conversions
    assert board.record.interrupts[72] == interrupts


def test_a_dma_flag_stays_until_it_is_cleared():
    source = BURSTS.replace(
        "DMA_LIFCR(DMA2_BASE) = 0x3D;",
        "if (n == 9) { DMA_LIFCR(DMA2_BASE) = 0x3D; T_CR1(TIM3_BASE) = 0; }",
    )
    board, _ = watched(
        source.replace("if (n == 5) { T_CR1(TIM3_BASE) = 0; T_CR1(TIM2_BASE) = 0; }", "") % CHAIN,
        800,
    )
    _, count, *reported = out(board, 22)
    assert count == 10
    assert reported[2 * 9] - reported[0] < 20  # all at once, not one a slot


def test_an_overrun_stops_the_requests():
    handler = (
        "void irq_18(void) { ++OUT[30]; OUT[31] = ADC_SR(ADC1_BASE); ADC_SR(ADC1_BASE) = 0;"
        " ADC_CR2(ADC1_BASE) = 1; }"
    )
    enabled = "ADC_CR2(ADC1_BASE) = 1; REG32(0x40012004) = 1u << 26; NVIC_ISER(0) = 1u << 18;"
    chain = CHAIN.replace("DMA_CR(DMA2_BASE, 0) |= 1;", "").replace(
        "ADC_CR2(ADC1_BASE) = 1;", enabled
    )
    source = handler + BURSTS % ("OUT[30] = 0;" + chain)
    board, times = watched(source, 800, (56, 18))
    overruns, status = out(board, 32)[30:]
    assert (overruns, status & 1 << 5) == (1, 1 << 5)
    assert sum(map(len, times)) == 2  # the second result found the first one unread


def test_a_converter_that_is_triggered_too_fast_skips():
    board, times = watched(
        BURSTS % CHAIN.replace("107; TIM_CNT(TIM2_BASE) = 54", "26; TIM_CNT(TIM2_BASE) = 13"), 400
    )
    at = np.concatenate(times)
    assert (
        np.diff(at)[:20] == 3 * 27 * 4
    ).all()  # every third trigger: 15 cycles of 27 MHz are 2.2 periods
    assert board.adc.ignored_triggers > 50


def test_dma_into_no_memory_is_an_error():
    source = BURSTS % CHAIN.replace("0x20011000u", "0x60001000u").replace(
        "| DMA_CR_TCIE", "| DMA_CR_TEIE"
    )
    source = source.replace(
        "OUT[3 + 2 * n] = DMA_CR(DMA2_BASE, 0) >> 19 & 1", "OUT[3 + 2 * n] = DMA_LISR(DMA2_BASE)"
    )
    board, _ = watched(source, 800)
    assert out(board, 4)[3] & 1 << 3
    assert board.record.interrupts[72] == 1


def test_dma_on_cached_memory_is_told():
    cached = "SCB_CCR |= 1u << 16;" + CHAIN
    assert not watched(BURSTS % cached, 300)[0].record.hazards
    hazards = watched(BURSTS % cached.replace("0x20011000u", "0x20031000u"), 300)[0].record.hazards
    assert hazards == {"DMA2: stream 0 on cached memory": 1}


def test_a_pin_that_is_not_analog_reads_nothing():
    source = CLOCK + BURSTS % CHAIN.replace("GPIO_MODER(GPIOA_BASE) |= 3u << 6;", "")
    board = EmulatedBoard(compile_program(source, (56,)), flat_skin())
    board.run_until(300 * TICKS_PER_US)
    assert set(board.memories.ram[0x11000 : 0x11000 + 160]) == {0}
    board = EmulatedBoard(compile_program(CLOCK + BURSTS % CHAIN, (56,)), flat_skin())
    board.run_until(300 * TICKS_PER_US)
    assert set(np.frombuffer(board.memories.ram[0x11000 : 0x11000 + 160], dtype="<u2")) == {2048}
