"""The constants of both bounds, each with its source.

Sources:

- TRM: Arm DDI 0489, Cortex-M7 processor technical reference manual.
- LLVM: ``llvm/lib/Target/ARM/ARMScheduleM7.td``, the scheduling model of the Cortex-M7.
- RM0410: ST, reference manual of the STM32F76xxx. AN4667: ST, system architecture of the STM32F7.
- assumed: no manual gives it; the two bounds are set wide apart.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Bound:
    """Cycles of the processor at 216 MHz.

    Attributes:
        name: of the bound.
        dual_issue: two instructions per cycle where the units allow it, and no wait for a result
            (TRM 1.1, LLVM IssueWidth); otherwise one per cycle, and each result is waited for.
        load_latency: until an instruction can use a loaded word (LLVM LoadLatency 2, one more for
            an address).
        float_latency: of a sum, a product and the addend of a multiply-accumulate (LLVM: 3).
        registers_per_cycle: of a load or store of several (LLVM: two load units of 32 bits, not
            paired with another instruction).
        integer_divide: LLVM: 7; TRM: ends early for small quotients.
        float_divide: also the root (LLVM: 16).
        mispredicted: after a branch that went another way than last time (LLVM: 6 at most; the
            pessimistic bound adds two for the fetch).
        flash_line: a line of 32 bytes into a cache. The flash takes 7 wait states + 1 (RM0410
            3.3.2, table 7) for 256 bits in single-bank mode; 4 transfers of 64 bits follow
            (AN4667). What the bridges add is assumed.
        ram_line: the same from SRAM1, over 32 bits (AN4667): 8 transfers; the bridges are assumed.
        write_back: of a changed line that is pushed out; a buffer hides it in the optimistic bound
            (assumed).
        random_replacement: which of the 4 ways is given up (TRM 5: pseudo-random); the optimistic
            bound gives up the least recently used.
        ahb_read, apb1_read, apb2_read, core_read: of a peripheral. APB1 and APB2 run at a quarter
            and half the processor's clock, and an access takes two of their cycles (RM0410 2.1);
            the bridges are assumed.
        peripheral_write: writes are buffered (assumed).
        exception: entry, and return (TRM 1.4: 12 without wait states); the pessimistic bound adds
            17 registers of the FPU.
    """

    name: str
    dual_issue: bool
    load_latency: int
    float_latency: int
    registers_per_cycle: int
    integer_divide: int
    float_divide: int
    mispredicted: int
    flash_line: int
    ram_line: int
    write_back: int
    random_replacement: bool
    ahb_read: int
    apb1_read: int
    apb2_read: int
    core_read: int
    peripheral_write: int
    exception: int


OPTIMISTIC = Bound(
    name="optimistic",
    dual_issue=True,
    load_latency=1,
    float_latency=1,
    registers_per_cycle=2,
    integer_divide=2,
    float_divide=1,
    mispredicted=0,
    flash_line=12,
    ram_line=10,
    write_back=0,
    random_replacement=False,
    ahb_read=3,
    apb1_read=10,
    apb2_read=6,
    core_read=2,
    peripheral_write=1,
    exception=12,
)
PESSIMISTIC = Bound(
    name="pessimistic",
    dual_issue=False,
    load_latency=3,
    float_latency=3,
    registers_per_cycle=2,
    integer_divide=8,
    float_divide=16,
    mispredicted=8,
    flash_line=30,
    ram_line=24,
    write_back=10,
    random_replacement=True,
    ahb_read=10,
    apb1_read=24,
    apb2_read=14,
    core_read=6,
    peripheral_write=3,
    exception=29,
)
