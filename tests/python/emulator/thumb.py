"""Small programs for the emulated processor, compiled in the test against the board's own register
header."""

import shutil
import struct
import subprocess
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from eitskin.skin.protocol import adjacent
from eitskin_emulator.analog.skin import AnalogSkin
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.clocktime import TICKS_PER_US
from eitskin_emulator.memory import RAM

ROOT = Path(__file__).resolve().parents[3]
BOARD = ROOT / "firmware" / "boards" / "nucleo_f767zi"
OUT = 0x20010000  # where programs leave what they found
FLAGS = [
    "-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard", "-O1", "-ffreestanding",
]  # fmt: skip
LINK = """
SECTIONS {
    . = 0x08000000;
    .vectors : { KEEP(*(.vectors)) }
    .text : { *(.text*) *(.rodata*) }
    . = 0x20000000;
    .bss (NOLOAD) : { *(.bss*) *(.data*) *(COMMON) }
}
"""
# Every exception that has no handler of its own stops in `unexpected`, which leaves its number at
# OUT - 4.
HEAD = """
#include "stm32f767.h"
#define OUT ((volatile uint32_t *)0x20010000)
#define T_CR1(tim) REG32((tim) + 0x00u)
#define T_DIER(tim) REG32((tim) + 0x0Cu)
#define T_SR(tim) REG32((tim) + 0x10u)
#define U_ISR(usart) REG32((usart) + 0x1Cu)
#define U_RDR(usart) REG32((usart) + 0x24u)
"""
START = """
#define WEAK __attribute__((weak, alias("unexpected")))
void program(void);
void unexpected(void) { OUT[-1] = SCB_ICSR & 0x1FF; for (;;) ; }
void hard_fault(void) WEAK; void memory_fault(void) WEAK;
void bus_fault(void) WEAK; void usage_fault(void) WEAK;
void svcall(void) WEAK; void pendsv(void) WEAK; void systick(void) WEAK;
%s
static void start(void) {
    SCB_VTOR = 0x08000000u;
    SCB_CPACR |= 0xFu << 20;
    program();
    for (;;) __asm volatile("wfi");
}
__attribute__((section(".vectors"), used)) static void (*const vectors[16 + 110])(void) = {
    (void (*)(void))0x20008000, start,
    [2] = unexpected, hard_fault, memory_fault, bus_fault, usage_fault,
    [11] = svcall, [14] = pendsv, systick, %s
};
"""


@lru_cache(maxsize=64)
def compile_program(source: str, irqs: tuple[int, ...] = ()) -> bytes:
    """The image of C ``source``, which defines ``void program(void)`` and, for each of ``irqs``,
    ``void irq_N(void)``."""
    assert shutil.which("arm-none-eabi-gcc"), "missing arm-none-eabi-gcc: scripts/test installs it"
    declared = " ".join(f"void irq_{n}(void);" for n in irqs)
    entries = ", ".join(f"[{16 + n}] = irq_{n}" for n in irqs)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "start.c").write_text(HEAD + START % (declared, entries))
        (folder / "program.c").write_text(HEAD + source)
        (folder / "link.ld").write_text(LINK)
        flags = [*FLAGS, "-nostdlib", "-fno-builtin", f"-I{BOARD}"]
        files = ["-T", "link.ld", "start.c", "program.c", "-o", "a.elf", "-lgcc"]
        command = ["arm-none-eabi-gcc", *flags, *files]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        subprocess.run(
            ["arm-none-eabi-objcopy", "-O", "binary", "a.elf", "a.bin"], cwd=folder, check=True
        )
        return (folder / "a.bin").read_bytes()


def flat_skin() -> AnalogSkin:
    """A skin on which every row has another voltage: row k (k + 1) mV."""
    protocol = adjacent(16)
    rows = 1e-3 * (1 + np.arange(protocol.n_rows))
    return AnalogSkin(protocol, rows[None], 2 * rows[None], 10.0)


def run_program(source: str, us: float, irqs: tuple[int, ...] = ()) -> EmulatedBoard:
    """A board that has run ``source`` for ``us`` microseconds."""
    board = EmulatedBoard(compile_program(source, irqs), flat_skin())
    board.run_until(round(us * TICKS_PER_US))
    return board


def out(board: EmulatedBoard, count: int) -> list[int]:
    """The first words at OUT."""
    return list(struct.unpack(f"<{count}I", board.memories.ram[OUT - RAM : OUT - RAM + 4 * count]))


# 216 MHz as the firmware sets it up, in as few words
CLOCK = """
static void clock_216(void) {
    RCC_APB1ENR |= RCC_APB1ENR_PWREN; (void)RCC_APB1ENR;
    RCC_CR |= RCC_CR_HSEBYP; RCC_CR |= RCC_CR_HSEON;
    while (!(RCC_CR & RCC_CR_HSERDY)) ;
    RCC_PLLCFGR = 4u | 216u << 6 | 1u << 22 | 9u << 24 | 2u << 28;
    RCC_CR |= RCC_CR_PLLON;
    PWR_CR1 |= PWR_CR1_ODEN;
    while (!(PWR_CSR1 & PWR_CSR1_ODRDY)) ;
    PWR_CR1 |= PWR_CR1_ODSWEN;
    while (!(PWR_CSR1 & PWR_CSR1_ODSWRDY) || !(RCC_CR & RCC_CR_PLLRDY)) ;
    FLASH_ACR = 7u;
    RCC_CFGR = 5u << 10 | 4u << 13 | 2u << 21;
    RCC_CFGR = 5u << 10 | 4u << 13 | 2u << 21 | 2u;
    while ((RCC_CFGR & 0xC) != 8) ;
}
static void cycle_counter(void) {
    DCB_DEMCR |= 1u << 24; DWT_LAR = 0xC5ACCE55u; DWT_CYCCNT = 0; DWT_CTRL |= 1;
}
"""
