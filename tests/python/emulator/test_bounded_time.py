"""The two bounds of the processor's time: what they add, that they change nothing else, and that
the firmware switches in time by either."""

import numpy as np
import pytest
from thumb import CLOCK, compile_program, flat_skin, out

from eitskin.device.wire.link_table import Stream
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_US
from eitskin_emulator.timing.bounded_time import BoundedTime
from eitskin_emulator.timing.bounds import OPTIMISTIC, PESSIMISTIC
from eitskin_emulator.timing.cache import Cache
from eitskin_emulator.timing.issue import Decoder, paired_half_cycles, waiting_half_cycles
from eitskin_emulator.timing.switching import watch_switching
from emulated import board_of, connect, power_up

ADD_R0_R1 = b"\x08\x44"  # add r0, r1
LDR_R0_R1 = b"\x08\x68"  # ldr r0, [r1]
VLDM = b"\x90\xec\x08\x0a"  # vldmia r0, {s0-s7}
UDIV = b"\xb0\xfb\xf1\xf0"  # udiv r0, r0, r1

# IT blocks that load and store, a table in flash, a divide and a loop: what a bound could spoil
PROGRAM = (
    CLOCK
    + """
static const uint32_t table[8] = {3, 1, 4, 1, 5, 9, 2, 6};
static volatile uint32_t memory[64];
void program(void) {
    clock_216();
    OUT[3] = 1;
    uint32_t x = 12345, taken = 0;
    for (uint32_t k = 0; k < 3000; ++k) {
        x = x * 1664525u + 1013904223u;
        if (x & 0x10000) taken += memory[x >> 26]; else memory[x >> 26] = taken ^ table[k & 7];
        if (x & 0x300) { taken -= x / (k + 1); memory[k & 63] += taken; }
    }
    OUT[0] = x; OUT[1] = taken; OUT[2] = memory[7]; OUT[3] = 77;
}
"""
)


def half_cycles(code: bytes) -> tuple[int, int]:
    steps, *_ = Decoder().steps(code, 0x08000000)
    waiting, _ = waiting_half_cycles(steps, PESSIMISTIC, {})
    return paired_half_cycles(steps, OPTIMISTIC), waiting


def test_instructions_cost_what_the_tables_of_the_units_say():
    assert half_cycles(ADD_R0_R1 * 4) == (4, 8)
    assert half_cycles(LDR_R0_R1 * 2) == (2, 4)
    # the sum waits for the loaded word
    assert half_cycles(LDR_R0_R1 + ADD_R0_R1)[1] == 2 * (PESSIMISTIC.load_latency + 1)
    assert half_cycles(VLDM) == (8, 10)  # eight registers, two per cycle
    assert half_cycles(UDIV) == (2 * OPTIMISTIC.integer_divide, 2 * PESSIMISTIC.integer_divide)


def test_no_bound_is_faster_than_two_instructions_per_cycle():
    for code in (ADD_R0_R1, LDR_R0_R1, VLDM, UDIV):
        low, high = half_cycles(code * 6)
        assert 6 <= low <= high


def test_a_cache_holds_four_lines_of_a_set():
    cache = Cache(random_replacement=False)
    lines = [128 * k + 5 for k in range(5)]
    assert [cache.use(line)[0] for line in lines[:4]] == [False] * 4
    assert all(cache.use(line)[0] for line in lines[:4])
    cache.use(lines[1], store=True)
    assert cache.use(lines[4]) == (False, False)  # the least recently used one goes
    assert not cache.use(lines[0])[0] and cache.use(lines[1])[0]
    for line in (lines[3], lines[4], lines[0]):
        cache.use(line)
    assert cache.use(lines[2]) == (False, True)  # the changed one has to be written


def run_until(board, state):
    for _ in range(20_000):
        board.run_until(board.clock.now + TICKS_PER_US)
        if out(board, 4)[3] == state:
            return
    raise AssertionError("the program does not end")


def run_program(bound=None):
    board = EmulatedBoard(compile_program(PROGRAM), flat_skin())
    run_until(board, 1)
    timed = None if bound is None else BoundedTime(board, bound)
    began = board.clock.now
    run_until(board, 77)
    return out(board, 3), board.clock.now - began, board.record.instructions, timed


def test_a_bound_changes_the_time_and_nothing_else():
    plain, as_before, instructions, _ = run_program()
    times = []
    for bound in (OPTIMISTIC, PESSIMISTIC):
        found, ticks, executed, timed = run_program(bound)
        assert found == plain and executed == pytest.approx(instructions, rel=0.01)
        assert timed.spent.issue > 0 and timed.spent.code_misses > 0
        times.append(ticks)
    assert times[0] < as_before < times[1] < 5 * times[0]


def test_a_board_that_still_starts_cannot_be_bounded():
    board = EmulatedBoard(compile_program(PROGRAM), flat_skin())
    with pytest.raises(Exception, match="216 MHz"):
        BoundedTime(board, OPTIMISTIC)


@pytest.mark.long("tests/c and test_timers.py: switching by instructions, without the bound")
def test_the_pessimistic_bound_switches_in_time_with_a_margin(image):
    """Half a microsecond of the 4.5 that a slot of 100 us leaves after its last sample, but for one
    slot in a thousand, which is measured again: since touches are tracked in every stream, one of
    2,334 was late. The image before its code was in ITCM was late 475 times in five frames."""
    device = connect(power_up(image, noisy=False))
    board = board_of(device)
    device.tare(4)
    device.start_scene()
    device.stats(reset=True)
    timed = BoundedTime(board, PESSIMISTIC)
    with watch_switching(board) as switching:
        for _ in device.stream(Stream.TOUCHES, frames=1):
            pass
    timed.detach()
    late_us = np.array(switching.after_us)
    assert len(late_us) > 200 and device.stats().slots_repeated <= 1 + len(late_us) // 1000
    print(f"\nswitched {late_us.mean():.2f} us after the last sample, {late_us.max():.2f} at most")
    assert np.quantile(late_us, 0.999) < switching.allowed_us - 0.5
