"""Entry into exceptions and return from them (ARMv7-M manual B1.5): frames of 8 words, or of 26
with the FPU's registers.

The large frame is used where the FPU was used (CONTROL.FPCA), and is written at once where silicon
may put it off. Entry takes 12 cycles and return 10. Only the main stack pointer is known.
"""

import struct
from collections.abc import Callable

from unicorn import arm_const as arm

from eitskin_emulator.cpu import Cpu, RegisterSet
from eitskin_emulator.memory import RAM, RAM_BYTES, Memories

ENTRY_CYCLES, RETURN_CYCLES = 12, 10
SMALL, LARGE = struct.Struct("<8I"), struct.Struct("<8I8Q2I")
FPCA = 4
# FPCA and SFPA: Unicorn's core counts as secure; without SFPA its next FPU instruction would begin
# again
FP_CONTEXT = 0xC
TO_THREAD = 8  # bits of EXC_RETURN
SMALL_FRAME = 0x10
ALIGNED = 1 << 9  # of the stacked xPSR: a word was left out to align the frame

_FRAME = (
    *(
        arm.UC_ARM_REG_R0,
        arm.UC_ARM_REG_R1,
        arm.UC_ARM_REG_R2,
        arm.UC_ARM_REG_R3,
        arm.UC_ARM_REG_R12,
    ),
    *(arm.UC_ARM_REG_LR, arm.UC_ARM_REG_PC, arm.UC_ARM_REG_XPSR),
    *(arm.UC_ARM_REG_D0, arm.UC_ARM_REG_D1, arm.UC_ARM_REG_D2, arm.UC_ARM_REG_D3),
    *(
        arm.UC_ARM_REG_D4,
        arm.UC_ARM_REG_D5,
        arm.UC_ARM_REG_D6,
        arm.UC_ARM_REG_D7,
        arm.UC_ARM_REG_FPSCR,
    ),
    *(arm.UC_ARM_REG_SP, arm.UC_ARM_REG_CONTROL),
)
_INTO = (arm.UC_ARM_REG_SP, arm.UC_ARM_REG_CONTROL, arm.UC_ARM_REG_LR, arm.UC_ARM_REG_XPSR)
# Unicorn leaves the GE flags as they are when xPSR is written; APSR_nzcvqg sets them
_BACK = (
    *_FRAME[:6],
    arm.UC_ARM_REG_XPSR,
    arm.UC_ARM_REG_APSR_NZCVQG,
    arm.UC_ARM_REG_SP,
    arm.UC_ARM_REG_CONTROL,
)
APSR_BITS = 0xF80F0000
_FPU = _FRAME[8:17]


class Exceptions:
    """Moves the processor into handlers and back."""

    def __init__(self, cpu: Cpu, memories: Memories) -> None:
        self._cpu, self._memories = cpu, memories
        self._frame = RegisterSet(cpu.engine, _FRAME)
        self._into = RegisterSet(cpu.engine, _INTO)
        self._back = RegisterSet(cpu.engine, _BACK)
        self._fpu = RegisterSet(cpu.engine, _FPU)
        # cycles of an entry through a vector, or of a return (0), where a bound counts them
        self.entry_waits: Callable[[int], int] | None = None

    def enter(self, number: int, vector: int, thread: bool, pc: int | None = None) -> bool:
        """Go into exception ``number``, whose handler's address is at ``vector``; ``thread``: from
        no other. ``pc``: where to
        return, if not where it stands. False: the frame has no room in memory, and nothing has
        changed but the program counter and the stack pointer.
        """
        values = self._frame.read()
        sp, control = values[17], values[18]
        if pc is not None:
            values[6] = pc
        values[6] &= ~1
        skipped = sp & 4
        if skipped:
            values[7] |= ALIGNED
        else:
            values[7] &= ~ALIGNED
        large = bool(control & FPCA)
        frame = LARGE.pack(*values[:17], 0) if large else SMALL.pack(*values[:8])
        sp = (sp - skipped - len(frame)) & 0xFFFFFFFF
        stacked = sp >= RAM and sp + len(frame) <= RAM + RAM_BYTES
        if stacked:
            self._memories.ram[sp - RAM : sp - RAM + len(frame)] = frame
        exc_return = 0xFFFFFFE1 | (0 if large else SMALL_FRAME) | (TO_THREAD if thread else 0)
        self._into.write(
            (sp, control & ~FPCA & 3, exc_return, values[7] & 0xF80F0000 | 1 << 24 | number)
        )
        self._cpu.pc = self._memories.word(vector)
        self._cpu.clock.skip(self._cycles(ENTRY_CYCLES, vector) * self._cpu.clock.cycle_ticks)
        return stacked

    def leave(self) -> bool:
        """Return from an exception by the EXC_RETURN in the program counter. False: it or the frame
        is invalid."""
        exc_return = self._cpu.pc | 1
        values = self._frame.read()
        sp, control = values[17], values[18]
        large = not exc_return & SMALL_FRAME
        shape = LARGE if large else SMALL
        found = self._memories.read(sp, shape.size)
        if exc_return & 0xFFFFFFE0 != 0xFFFFFFE0 or exc_return & 0xF not in (1, 9) or found is None:
            return False
        frame = shape.unpack(found)
        sp = (sp + shape.size + (4 if frame[7] & ALIGNED else 0)) & 0xFFFFFFFF
        if large:
            self._fpu.write(frame[8:17])
        back = (control & 3) | (FP_CONTEXT if large else 0)
        self._back.write((*frame[:6], frame[7] & ~ALIGNED, frame[7] & APSR_BITS, sp, back))
        self._cpu.pc = frame[6]
        self._cpu.clock.skip(self._cycles(RETURN_CYCLES, 0) * self._cpu.clock.cycle_ticks)
        return True

    def _cycles(self, usual: int, vector: int) -> int:
        return usual if self.entry_waits is None else self.entry_waits(vector)

    def stack_pointer(self) -> int:
        """The stack pointer."""
        return self._frame.read()[17]

    def reset(self, stack_pointer: int, entry: int) -> None:
        """Start as after a reset."""
        self._back.write((0, 0, 0, 0, 0, 0xFFFFFFFF, 1 << 24, 0, stack_pointer & ~3, 0))
        self._fpu.write((0,) * 9)
        self._cpu.masks.write((0, 0, 0))
        self._cpu.pc = entry
