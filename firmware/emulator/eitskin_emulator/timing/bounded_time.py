"""Lets an emulated board's time pass by a bound of the Cortex-M7's time instead of an instruction
per cycle.

Each block of instructions adds what its issue, the caches and mispredicted branches cost by the
bound. Nothing of the program changes but the time at which things happen: the firmware's own
statistics, its late switches and its missed deadlines are then those of the bound. It costs about
ten times the emulation's usual time, so attach it when the board is in the state that is looked at.

Left out: DMA and the processor waiting for each other, prefetches, and what the store buffer
hides. In the pessimistic bound a store that misses waits for its line.
"""

import ctypes
from dataclasses import dataclass
from typing import Any

from unicorn import arm_const as arm
from unicorn import unicorn_const as uc
from unicorn.unicorn_py3.unicorn import uclib

from eitskin.errors import DeviceError
from eitskin_emulator.board import EmulatedBoard
from eitskin_emulator.cpu import RegisterSet
from eitskin_emulator.memory import DTCM_BYTES, FLASH, FLASH_BYTES, ITCM_BYTES, RAM, RAM_BYTES
from eitskin_emulator.timing.bounds import Bound
from eitskin_emulator.timing.cache import LINE_BITS, Cache
from eitskin_emulator.timing.issue import (
    Decoder,
    Step,
    paired_half_cycles,
    waiting_half_cycles,
)

ON_BLOCK = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint32, ctypes.c_void_p
)
ON_ACCESS = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_int, ctypes.c_uint64, ctypes.c_int, ctypes.c_int64,
    ctypes.c_void_p,
)  # fmt: skip
SRAM = RAM + DTCM_BYTES
IF_THEN = 0x0600FC00  # of xPSR
APB1, APB2, AHB = (0x40000000, 0x40010000, 0x40020000)


@dataclass
class TimeSpent:
    """Half cycles since the bound was attached, by their use."""

    issue: int = 0
    code_lines: int = 0
    data_lines: int = 0
    branches: int = 0
    peripherals: int = 0
    exceptions: int = 0
    code_misses: int = 0
    data_misses: int = 0


class _KnownBlock:
    """A block by its address: its steps, its lines of code, and its cost after other blocks."""

    def __init__(
        self, start: int, end: int, steps: list[Step], ends: tuple[bool, bool], cached: bool
    ) -> None:
        self.start, self.end, self.steps = start, end, steps
        self.conditional, self.indirect = ends
        self.lines = tuple(range(start >> LINE_BITS, (end - 1 >> LINE_BITS) + 1)) if cached else ()
        self.if_then = any(one.if_then for one in steps)
        self.costs: dict[int, tuple[int, dict[int, int]]] = {}
        self.late: dict[int, int] = {}
        self.went: int | None = None  # where its last branch led


class BoundedTime:
    """``bound`` of the time of ``board``, from when it is made until it is ``detach``-ed."""

    def __init__(self, board: EmulatedBoard, bound: Bound) -> None:
        clock = board.clock
        if clock.cycle_ticks != 2:
            raise DeviceError("the processor must run at 216 MHz when its time is bounded")
        self._board, self._bound, self._clock = board, bound, clock
        self.spent = TimeSpent()
        self._code, self._data = Cache(bound.random_replacement), Cache(bound.random_replacement)
        self._decoder = Decoder()
        self._blocks: dict[int, _KnownBlock] = {}
        self._last: _KnownBlock | None = None
        self._interrupted: list[_KnownBlock | None] = []
        self._slices = -1
        self._xpsr = RegisterSet(board.cpu.engine, (arm.UC_ARM_REG_XPSR,))
        self._if_then = False  # in the block that runs
        self._last_line = -1
        self._hooks: list[Any] = []
        self._kept: list[Any] = []
        clock.instruction_ticks = 1
        board.cpu.bus_waits = self._peripheral
        board.exceptions.entry_waits = self._exception
        self._attach()

    def detach(self) -> None:
        """From now on an instruction takes a cycle again."""
        for handle in self._hooks:
            uclib.uc_hook_del(self._board.cpu.engine._uch, handle)
        self._hooks.clear()
        self._clock.instruction_ticks = self._clock.cycle_ticks
        self._board.cpu.bus_waits = None
        self._board.exceptions.entry_waits = None

    # ---- the engine's calls ----

    def _attach(self) -> None:
        self._hook(uc.UC_HOOK_BLOCK, ON_BLOCK(self._on_block), 1, 0)
        access = ON_ACCESS(self._on_access)
        kinds = uc.UC_HOOK_MEM_READ | uc.UC_HOOK_MEM_WRITE
        self._hook(kinds, access, FLASH, FLASH + FLASH_BYTES - 1)
        self._hook(kinds, access, SRAM, RAM + RAM_BYTES - 1)
        self._board.cpu.engine.ctl_flush_tb()

    def _hook(self, kind: int, function: Any, first: int, last: int) -> None:
        handle = ctypes.c_size_t()
        error = uclib.uc_hook_add(
            self._board.cpu.engine._uch, ctypes.byref(handle), ctypes.c_int(kind),
            ctypes.cast(function, ctypes.c_void_p), None,
            ctypes.c_uint64(first), ctypes.c_uint64(last),
        )  # fmt: skip
        if error != uc.UC_ERR_OK:
            raise DeviceError(f"unicorn cannot watch the processor (error {error})")
        self._hooks.append(handle)
        self._kept.append(function)

    def _on_block(self, engine: object, address: int, size: int, data: object) -> None:
        last, slices = self._last, self._board.cpu.slices
        resumed = slices != self._slices
        self._slices = slices
        if resumed and last is not None and last.start <= address < last.end:
            self._if_then = True
            return  # the rest of a block that the end of a slice or an interrupt cut in two
        block = self._blocks.get(address)
        if block is None:
            block = self._blocks[address] = self._decode(address, size)
        self._if_then = resumed or block.if_then
        spent, bound = self.spent, self._bound
        waits = 0
        if last is not None:
            waits = 2 * self._mispredicted(last, address)
            spent.branches += waits
        for line in block.lines:
            if not self._code.use(line)[0]:
                waits += 2 * bound.flash_line
                spent.code_lines += 2 * bound.flash_line
                spent.code_misses += 1
        cost = self._issue(last, block)
        spent.issue += cost
        self._last = block
        self._wait(waits + cost - len(block.steps))

    def _on_access(
        self, engine: object, kind: int, address: int, size: int, value: int, data: object
    ) -> None:
        if self._if_then:
            self._leave_if_then()
        line = address >> LINE_BITS
        store = kind == uc.UC_MEM_WRITE
        if line == self._last_line and not store:
            return
        self._last_line = line
        there, pushed = self._data.use(line, store)
        if there:
            return
        bound, flash = self._bound, address < RAM
        if store and not bound.random_replacement:
            cycles = 0  # the store buffer hides it
        else:
            cycles = bound.flash_line if flash else bound.ram_line
        cycles += bound.write_back if pushed else 0
        self.spent.data_lines += 2 * cycles
        self.spent.data_misses += 1
        self._wait(2 * cycles)

    def _leave_if_then(self) -> None:
        """Unicorn, which looks up the program counter for this call, sets the state of an IT block
        as well; the rest of the block would begin with it again."""
        value = self._xpsr.read()[0]
        if value & IF_THEN:
            self._xpsr.write((value & ~IF_THEN,))

    def _peripheral(self, address: int, store: bool) -> None:
        bound = self._bound
        if store:
            cycles = bound.peripheral_write
        elif address >= 0xE0000000:
            cycles = bound.core_read
        elif address >= AHB:
            cycles = bound.ahb_read
        else:
            cycles = bound.apb2_read if address >= APB2 else bound.apb1_read
        self.spent.peripherals += 2 * cycles
        self._wait(2 * cycles)

    def _exception(self, vector: int) -> int:
        """Cycles of an entry or (``vector`` 0) a return."""
        cycles = self._bound.exception
        if vector:
            self._interrupted.append(self._last)
            self._last = None
        else:
            self._last = self._interrupted.pop() if self._interrupted else None
        if vector >= ITCM_BYTES and not self._code.use(vector >> LINE_BITS)[0]:
            cycles += self._bound.flash_line
        self.spent.exceptions += 2 * cycles
        return cycles

    # ---- what they cost ----

    def _wait(self, half_cycles: int) -> None:
        if half_cycles > 0:
            self._board.cpu.stall(half_cycles)

    def _decode(self, address: int, size: int) -> _KnownBlock:
        code = self._board.memories.read(address, size) or b""
        steps, *ends = self._decoder.steps(code, address)
        cached = address >= ITCM_BYTES
        return _KnownBlock(address, address + size, steps, (ends[0], ends[1]), cached)

    def _issue(self, last: _KnownBlock | None, block: _KnownBlock) -> int:
        key = 0 if last is None else last.start
        known = block.costs.get(key)
        if known is None:
            known = self._cost(last, block)
            block.costs[key] = known
        block.late = known[1]
        return known[0]

    def _cost(self, last: _KnownBlock | None, block: _KnownBlock) -> tuple[int, dict[int, int]]:
        if self._bound.dual_issue:
            return paired_half_cycles(block.steps, self._bound), {}
        return waiting_half_cycles(block.steps, self._bound, {} if last is None else last.late)

    def _mispredicted(self, last: _KnownBlock, address: int) -> int:
        if not last.conditional and not last.indirect:
            last.went = address
            return 0
        before, last.went = last.went, address
        if before is None:  # a loop is taken to go on
            guessed = address < last.start or not last.conditional
        else:
            guessed = before == address
        return 0 if guessed else self._bound.mispredicted
