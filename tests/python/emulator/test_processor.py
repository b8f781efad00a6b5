"""The emulated processor alone: slices, exceptions, priorities, sleep, faults."""

import pytest
from thumb import CLOCK, compile_program, flat_skin, out, run_program

from eitskin.errors import DeviceError
from eitskin_emulator import board as board_module
from eitskin_emulator import counter
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_US

# arithmetic with IT blocks, floating point, division and memory: whatever slicing could spoil
MIXED = """
void program(void) {
    uint32_t x = 12345, taken = 0; float f = 1.0f; volatile uint32_t memory[16];
    for (int k = 0; k < 16; ++k) memory[k] = 0;
    for (uint32_t k = 0; k < 4000; ++k) {
        x = x * 1664525u + 1013904223u;
        if (x & 0x10000) taken += 3; else taken ^= x >> 7;
        if (x & 0x300) { taken -= k; memory[k & 15] += taken; }
        f = f * 0.99f + (float)(int)(x >> 20) / (float)(int)((k & 7) + 1);
    }
    for (int k = 0; k < 16; ++k) x ^= memory[k];
    union { float f; uint32_t u; } bits = {f};
    OUT[0] = x; OUT[1] = taken; OUT[2] = bits.u; OUT[3] = 77;
}
"""


def test_where_slices_end_changes_neither_results_nor_time_nor_counts(
    monkeypatch,
):
    image = compile_program(MIXED)
    found = set()
    for longest in (5_000_000, 1000, 97, 13, 5, 3):
        monkeypatch.setattr(board_module, "LONGEST_SLICE", longest)
        board = EmulatedBoard(image, flat_skin())
        board.run_until(20_000 * TICKS_PER_US, lambda board=board: board._asleep)
        found.add((tuple(out(board, 4)), board.record.instructions, board.clock.now))
    assert len(found) == 1
    assert next(iter(found))[0][3] == 77


def test_an_instruction_takes_a_cycle():
    """CYCCNT read twice around 100 NOPs: 100, and what the read itself takes, which is found
    without them."""
    nops = '__asm volatile(".rept %d\\n nop\\n .endr");'
    timed = "uint32_t a = DWT_CYCCNT; %s uint32_t b = DWT_CYCCNT; OUT[0] = b - a;"
    source = CLOCK + "void program(void) { %s cycle_counter(); " + timed + " }"
    for clock in ("", "clock_216();"):
        with_them, without = (
            out(run_program(source % (clock, nops % n), 1000), 1)[0] for n in (100, 0)
        )
        assert with_them - without == 100
        assert 1 <= without <= 3


def test_an_unknown_build_of_unicorn_is_refused(monkeypatch):
    counter.offsets.cache_clear()
    monkeypatch.setattr(counter, "_words", lambda engine: [0] * 512)
    with pytest.raises(DeviceError, match=r"pip install 'unicorn==2\.1\.4'"):
        counter.offsets()
    monkeypatch.undo()
    counter.offsets.cache_clear()
    assert len(set(counter.offsets())) == 2


TWO_TIMERS = """
static volatile uint32_t order[8], n;
static void note(uint32_t what) { if (n < 8) order[n++] = what; }
void irq_28(void) {
    note(2); T_SR(TIM2_BASE) = 0; __asm volatile(".rept 400\\n nop\\n .endr"); note(20);
}
void irq_29(void) { note(3); T_SR(TIM3_BASE) = 0; note(30); }
void program(void) {
    n = 0;
    RCC_APB1ENR |= 3; (void)RCC_APB1ENR;
    NVIC_IPR(28) = %s; NVIC_IPR(29) = %s;
    NVIC_ISER(0) = 3u << 28;
    T_DIER(TIM2_BASE) = 1; T_DIER(TIM3_BASE) = 1;
    TIM_ARR(TIM2_BASE) = 499; TIM_ARR(TIM3_BASE) = 599;
    T_CR1(TIM2_BASE) = 9; T_CR1(TIM3_BASE) = 9;          /* one pulse each, 31 and 37 us */
    while (n < 4) ;
    for (int k = 0; k < 4; ++k) OUT[k] = order[k];
}
"""


@pytest.mark.parametrize(
    ("urgency_2", "urgency_3", "order"),
    [
        ("0x20", "0x10", [2, 3, 30, 20]),
        ("0x10", "0x10", [2, 20, 3, 30]),
        ("0x10", "0x20", [2, 20, 3, 30]),
    ],
)
def test_the_more_urgent_interrupt_preempts(urgency_2, urgency_3, order):
    board = run_program(TWO_TIMERS % (urgency_2, urgency_3), 200, (28, 29))
    assert out(board, 4) == order
    assert board.record.interrupts == {44: 1, 45: 1}


FRAMES = """
__attribute__((naked)) void svcall(void) {
    __asm volatile("ldr r2, =0x20010000\\n str sp, [r2]\\n str lr, [r2, #4]\\n mrs r3, ipsr\\n"
                   "str r3, [r2, #8]\\n bx lr\\n");
}
void program(void) {
    uint32_t before, after; float f = 2.5f;
    %s
    __asm volatile("mov %%0, sp\\n movs r0, #11\\n movs r1, #12\\n svc #0\\n mov %%1, sp\\n"
                   : "=r"(before), "=r"(after) :: "r0", "r1", "memory");
    OUT[3] = before; OUT[4] = after; OUT[5] = *(volatile uint32_t *)OUT[0];
    OUT[6] = ((volatile uint32_t *)OUT[0])[1];
    %s
}
"""


def test_a_frame_has_8_words_or_26_after_floating_point():
    board = run_program(FRAMES % ("", ""), 100)
    sp, lr, ipsr, before, after, r0, r1 = out(board, 7)
    assert (before - sp, lr, ipsr, after) == (32 + (before & 4), 0xFFFFFFF9, 11, before)
    assert (r0, r1) == (11, 12)
    touched = '__asm volatile("vadd.f32 %0, %0, %0\\n" : "+t"(f));'
    kept = "union { float f; uint32_t u; } bits = {f}; OUT[7] = bits.u;"
    board = run_program(FRAMES % (touched, kept), 100)
    sp, lr, _, before, after, _, _, bits = out(board, 8)
    assert (before - sp, lr, after) == (104 + (before & 4), 0xFFFFFFE9, before)
    assert bits == 0x40A00000


# A handler that spoils all that it may, and a program that needs all of it: flags (GE and the FPU's
# too), registers, 64-bit sums
SPOILING = """
__attribute__((naked)) void systick(void) {
    __asm volatile("vmov.f32 s0, #1.0\\n .irp n, 1,2,3,4,5,6,7,8,9,10,11,12,13,14,15\\n"
                   "vmov.f32 s\\\\n, s0\\n .endr\\n"
                   "vcmp.f32 s0, #0.0\\n"
                   "ldr r0, =0x20010004\\n ldr r1, [r0]\\n add r1, #1\\n str r1, [r0]\\n"
                   "mvn r2, #0\\n uadd8 r3, r2, r2\\n"
                   "mov r12, #77\\n movs r1, #%d\\n lsls r1, #31\\n bx lr\\n");
}
void program(void) {
    uint64_t sum = 1; uint32_t c = 0, g = 0x01020304; float f[8];
    OUT[1] = OUT[2] = 0;
    for (int k = 0; k < 8; ++k) f[k] = (float)k;
    STK_LOAD = %d; STK_VAL = 0; STK_CTRL = %d;
    for (uint32_t n = 0; n < 4000; ++n) {
        uint32_t r;
        sum = sum * 6364136223846793005ull + 1442695040888963407ull + c; sum -= (uint64_t)n << 20;
        __asm volatile("uadd8 %%0, %%1, %%2\\n nop\\n nop\\n nop\\n sel %%0, %%1, %%2\\n"
                       : "=&r"(r) : "r"((uint32_t)sum), "r"(g));
        g = r ^ (uint32_t)(sum >> 32);
        for (int k = 0; k < 8; ++k) {
            f[k] = __builtin_fmaf(f[k], 0.875f, (float)(int)(g >> (k + 8)) * 1e-6f);
            if (f[k] > 7.0f) f[k] -= 3.25f;
            if (f[k] < (float)k) c += k; else c ^= n;
        }
        int32_t s = (int32_t)(sum >> 40);
        if (s > 0 && sum & 8) c = c * 3 + 1; else if (s < -5) c ^= 0x5555;
    }
    STK_CTRL = 0;
    for (int k = 0; k < 8; ++k) {
        union { float f; uint32_t u; } bits = {f[k]};
        OUT[6 + k] = bits.u;
    }
    OUT[3] = c; OUT[4] = (uint32_t)sum; OUT[5] = g; OUT[2] = 1;
}
"""


@pytest.mark.long("test_the_more_urgent_interrupt_preempts")
def test_an_interrupt_at_any_place_changes_nothing():
    undisturbed = out(run_program(SPOILING % (0, 100, 0), 400_000), 14)
    assert undisturbed[1:3] == [0, 1]
    for period, carry in ((60, 1), (97, 0), (100, 1), (211, 0)):
        found = out(run_program(SPOILING % (carry, period, 7), 2_000_000), 14)
        assert found[1] > 2000
        assert found[2:] == undisturbed[2:]


MASKS = """
void systick(void) { if (OUT[0] == 0) OUT[0] = DWT_CYCCNT; }
void program(void) {
    OUT[0] = 0; cycle_counter();
    STK_LOAD = 999; STK_VAL = 0; STK_CTRL = 7; SCB_SHPR3 = 0x80000000u;
    %s
    while (DWT_CYCCNT < 5000) ;
    OUT[1] = DWT_CYCCNT;
    %s
    __asm volatile("isb");
    while (OUT[0] == 0) ;
}
"""


@pytest.mark.parametrize(
    ("on", "off", "held"),
    [
        ('__asm volatile("cpsid i");', '__asm volatile("cpsie i");', True),
        ('__asm volatile("msr basepri, %0" :: "r"(0x80));',
         '__asm volatile("msr basepri, %0" :: "r"(0));', True),
        ('__asm volatile("msr basepri, %0" :: "r"(0x90));', "", False),
        ('__asm volatile("cpsid f");', '__asm volatile("cpsie f");', True),
    ],
)  # fmt: skip
def test_masks_hold_interrupts_back(on, off, held):
    taken, unmasked = out(run_program(CLOCK + MASKS % (on, off), 2000), 2)
    if held:
        assert unmasked < taken < unmasked + 40
    else:
        assert 1000 <= taken < 1030


def test_a_sleeper_skips_to_what_wakes_it_even_behind_primask():
    source = """
    void systick(void) { ++OUT[1]; }
    void program(void) {
        OUT[1] = 0; cycle_counter();
        STK_LOAD = 1600000 - 1; STK_VAL = 0; STK_CTRL = 7;
        __asm volatile("cpsid i\\n dsb\\n wfi\\n");
        OUT[0] = DWT_CYCCNT; OUT[2] = OUT[1];
        __asm volatile("cpsie i\\n isb\\n");
        OUT[3] = OUT[1];
    }"""
    board = run_program(CLOCK + source, 150_000)
    woken, handled, handled_before, handled_after = (out(board, 4)[k] for k in (0, 1, 2, 3))
    assert 1_600_000 <= woken < 1_600_050
    assert (handled_before, handled_after, handled) == (0, 1, 1)
    assert board.record.instructions < 2000


def test_a_flag_that_a_handler_forgets_brings_it_back():
    source = """
    void irq_28(void) { if (++OUT[0] == 5) T_SR(TIM2_BASE) = 0; }
    void program(void) {
        OUT[0] = 0;
        RCC_APB1ENR |= 1; (void)RCC_APB1ENR;
        NVIC_ISER(0) = 1u << 28; T_DIER(TIM2_BASE) = 1; TIM_ARR(TIM2_BASE) = 99;
        T_CR1(TIM2_BASE) = 9;
    }"""
    board = run_program(source, 200, (28,))
    assert out(board, 1) == [5]


FAULT = """
static void tell(uint32_t which, uint32_t *frame) {
    OUT[0] = which; OUT[1] = frame[6]; OUT[2] = SCB_CFSR; OUT[3] = SCB_HFSR;
    OUT[4] = SCB_BFAR; OUT[5] = SCB_MMFAR; for (;;) ;
}
#define TELL(name, number) \\
    __attribute__((naked)) void name(void) { \\
        __asm volatile("mov r1, sp\\n movs r0, #" #number "\\n b tell_all\\n"); }
__attribute__((used)) void tell_all(uint32_t which, uint32_t *frame) { tell(which, frame); }
TELL(hard_fault, 3) TELL(memory_fault, 4) TELL(bus_fault, 5) TELL(usage_fault, 6)
__attribute__((noinline)) uint32_t load(uint32_t at) { return *(volatile uint32_t *)at; }
void program(void) {
    OUT[9] = (uint32_t)load;
    %s
    OUT[8] = 1;
}
"""
DENY = "SCB_SHCSR |= 7u << 16; MPU_RBAR = %s; MPU_RASR = %du << 1 | 1; MPU_CTRL = 5;"


@pytest.mark.parametrize(
    ("body", "taken", "cfsr", "hfsr"),
    [
        ("load(0x60000000);", 3, 1 << 15 | 1 << 9, 1 << 30),
        ("SCB_SHCSR |= 7u << 16; load(0x60000000);", 5, 1 << 15 | 1 << 9, 0),
        ("SCB_SHCSR |= 7u << 16; REG32(0x08000100u) = 1;", 5, 1 << 15 | 1 << 9, 0),
        ('SCB_SHCSR |= 7u << 16; __asm volatile("udf #0");', 6, 1 << 16, 0),
        ("SCB_SHCSR |= 7u << 16; ((void (*)(void))0x60000001u)();", 5, 1 << 8, 0),
        (DENY % ("0", 13) + "load(0x10);", 4, 1 << 7 | 1 << 1, 0),
        (DENY % ("0x20000000u", 7) + "REG32(0x20000010u) = 1;", 4, 1 << 7 | 1 << 1, 0),
    ],
    ids=["hard", "load", "flash", "undefined", "fetch", "null pointer", "guard"],
)
def test_faults_reach_their_handlers(body, taken, cfsr, hfsr):
    board = run_program(FAULT % body, 200)
    found = out(board, 10)
    assert (found[0], found[2], found[3]) == (taken, cfsr, hfsr)
    assert found[8] != 1 or "0x20000010" in body  # a guard's fault comes when the slice ends
    assert 0x08000000 <= found[1] < 0x08001000 or "60000001" in body
    if taken == 5 and cfsr >> 15 & 1:
        assert found[4] == (0x60000000 if "load" in body else 0x08000100)
    if taken == 4:
        assert found[5] == (0x10 if "load" in body else 0x20000010)
    assert len(board.record.faults) == 1


def test_a_fault_in_the_hard_fault_handler_locks_up():
    source = FAULT.replace(
        "TELL(hard_fault, 3)",
        "uint32_t load(uint32_t at); void hard_fault(void) { load(0x60000000); }",
    )
    with pytest.raises(DeviceError, match="locked up"):
        run_program(source % "load(0x60000000);", 200)
    fed = (
        "RCC_CSR = 1; IWDG_KR = 0xCCCC; IWDG_KR = 0x5555; IWDG_PR = 0; IWDG_RLR = 63;"
        " load(0x60000000);"
    )
    board = run_program(source % fed, 20_000)
    assert board.record.resets.count("watchdog") >= 1


def test_a_program_asks_for_a_reset_and_ram_stays():
    source = """
    void program(void) {
        if (OUT[0] != 0x1234) {
            OUT[0] = 0x1234; OUT[1] = RCC_CSR; SCB_AIRCR = 0x05FA0004u; for (;;) ;
        }
        OUT[2] = RCC_CSR; RCC_CSR |= 1u << 24; OUT[3] = RCC_CSR;
    }"""
    board = run_program(source, 100)
    assert board.record.resets == ["power", "software"]
    _, first, second, cleared = out(board, 4)
    assert (first >> 26 & 0xF, second >> 26 & 0xF, cleared >> 26 & 0xF) == (0b0011, 0b0111, 0)


def test_what_is_not_modelled_or_not_clocked_is_told():
    source = """
    void program(void) {
        OUT[0] = REG32(0x40013000u);          /* SPI1, which is not modelled */
        GPIO_MODER(GPIOB_BASE) = 1; OUT[1] = GPIO_MODER(GPIOB_BASE);
        RCC_AHB1ENR |= 2; GPIO_MODER(GPIOB_BASE) = 1; OUT[2] = GPIO_MODER(GPIOB_BASE);
    }"""
    board = run_program(source, 100)
    assert out(board, 3) == [0, 0, 1]
    assert board.record.unmodelled == {"read 0x40013000": 1}
    assert board.record.clock_off == {"write GPIOB": 1, "read GPIOB": 1}


def test_a_bug_in_a_peripheral_is_not_swallowed(monkeypatch):
    def broken(self: object, offset: int, size: int) -> int:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("eitskin_emulator.peripherals.rcc.Rcc.read", broken)
    with pytest.raises(ZeroDivisionError, match="a bug"):
        run_program("void program(void) { OUT[0] = RCC_CR; }", 100)
