"""Single functions of the built NUCLEO-F767ZI image, called in Unicorn on registers that are plain
memory.

What a test wants of the hardware it writes into the registers itself; a DMA controller's flag
registers are the exception: a write to LIFCR clears LISR, as on the processor. Whole runs on
emulated peripherals are tests/python/emulator's matter.
"""

import re
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_HOOK_MEM_WRITE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
from unicorn.arm_const import (
    UC_ARM_REG_LR,
    UC_ARM_REG_PC,
    UC_ARM_REG_R0,
    UC_ARM_REG_R1,
    UC_ARM_REG_R2,
    UC_ARM_REG_R3,
    UC_ARM_REG_SP,
    UC_CPU_ARM_CORTEX_M7,
)

ITCM, ITCM_BYTES = 0x00000000, 0x4000
MEMORY = (
    (ITCM, ITCM_BYTES),
    (0x08000000, 0x200000),
    (0x20000000, 0x80000),
    (0x40000000, 0x30000),
    (0xE0000000, 0x100000),
)
RETURN, CALLBACK, SCRATCH = 0x20070000, 0x20070100, 0x20071000
BX_LR = b"\x70\x47"
DMA1, DMA2 = 0x40026000, 0x40026400
ARGUMENTS = (UC_ARM_REG_R0, UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3)
MAX_INSTRUCTIONS = 2_000_000


class BareImage:
    """The image with cleared statics; ``on_callback`` is called with r0, r1 when the program calls
    the address ``CALLBACK``."""

    def __init__(self, elf: Path) -> None:
        listed = subprocess.run(
            ["arm-none-eabi-nm", elf], capture_output=True, text=True, check=True
        ).stdout
        self.symbols = {
            name: int(value, 16)
            for value, name in re.findall(r"^([0-9a-f]{8}) \w (\S+)$", listed, re.M)
        }
        self.on_callback: Callable[[int, int], None] = lambda r0, r1: None
        self._uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self._uc.ctl_set_cpu_model(UC_CPU_ARM_CORTEX_M7)
        for start, size in MEMORY:
            self._uc.mem_map(start, size)
        image = elf.with_suffix(".bin").read_bytes()
        self._uc.mem_write(0x08000000, image)
        start, end = self.symbols["itcm_start"], self.symbols["itcm_end"]
        load = self.symbols["itcm_load"] - 0x08000000  # what the start-up code copies
        self._uc.mem_write(start, image[load : load + end - start])
        self._uc.mem_write(CALLBACK, BX_LR)
        self._uc.hook_add(UC_HOOK_CODE, self._called, begin=CALLBACK, end=CALLBACK)
        for dma in (DMA1, DMA2):
            self._uc.hook_add(UC_HOOK_MEM_WRITE, self._clear_flags, begin=dma + 8, end=dma + 8)

    def _called(self, uc: Any, *_: Any) -> None:
        self.on_callback(uc.reg_read(UC_ARM_REG_R0), uc.reg_read(UC_ARM_REG_R1))

    def _clear_flags(
        self, uc: Any, _access: int, address: int, _size: int, value: int, *_: Any
    ) -> None:
        self.write(address - 8, self.read(address - 8) & ~value)

    def read(self, address: int) -> int:
        return int(struct.unpack("<I", self._uc.mem_read(address, 4))[0])

    def write(self, address: int, value: int) -> None:
        self._uc.mem_write(address, struct.pack("<I", value % 2**32))

    def read_bytes(self, address: int, size: int) -> bytes:
        return bytes(self._uc.mem_read(address, size))

    def write_bytes(self, address: int, data: bytes) -> None:
        self._uc.mem_write(address, data)

    def operation(self, table: str, number: int) -> int:
        """The address of a function in a constant table of them."""
        return self.read(self.symbols[table] + 4 * number)

    def run_into_a_loop(self, function: str, *arguments: int) -> None:
        """Call a function that never returns, for as long as it does something."""
        for register, value in zip(ARGUMENTS, arguments, strict=False):
            self._uc.reg_write(register, value)
        self._uc.reg_write(UC_ARM_REG_SP, self.symbols["stack_top"])
        self._uc.emu_start(self.symbols[function] | 1, RETURN, count=2000)

    def call(self, function: int | str, *arguments: int) -> int:
        """Call a function by address or name; what it returns, as a signed number."""
        address = self.symbols[function] if isinstance(function, str) else function
        for register, value in zip(ARGUMENTS, arguments, strict=False):
            self._uc.reg_write(register, value)
        self._uc.reg_write(UC_ARM_REG_SP, self.symbols["stack_top"])
        self._uc.reg_write(UC_ARM_REG_LR, RETURN | 1)
        self._uc.emu_start(address | 1, RETURN, count=MAX_INSTRUCTIONS)
        assert self._uc.reg_read(UC_ARM_REG_PC) == RETURN, f"{function} does not return"
        value = int(self._uc.reg_read(UC_ARM_REG_R0))
        return value - 2**32 if value >= 2**31 else value
