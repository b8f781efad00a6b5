"""The Cortex-M7: Unicorn executes its instructions in slices of a given number; there is no hook
per instruction.

A slice ends early where something must be done outside: WFI, an exception's return, SVC, a fault,
or a peripheral that brought an event forward. Where slices end does not change what the program
computes; a test runs one program in many slicings. Left out: the process stack pointer,
unprivileged mode, double precision (Unicorn refuses it), the check of CPACR (the FPU is always on),
unaligned traps of LDRD and LDM.
"""

import ctypes
from collections.abc import Callable, Sequence
from enum import Enum, auto
from typing import Any

from unicorn import arm_const as arm
from unicorn import unicorn_const as uc
from unicorn.unicorn_py3.unicorn import uclib

from eitskin_emulator.bus import Bus
from eitskin_emulator.clocktime import BoardClock
from eitskin_emulator.counter import Counter, cortex_m7, unicorn
from eitskin_emulator.memory import Memories
from eitskin_emulator.record import Record

PERIPHERALS = ((0x40000000, 0x80000), (0x50000000, 0x80000), (0xE0000000, 0x100000))
NOWHERE = 0xDEADBEE0  # no memory is there: a slice never ends by reaching it
SVC, BREAKPOINT, EXCEPTION_RETURN, FETCH_ABORT = (
    2,
    7,
    8,
    3,
)  # numbers by which Unicorn reports them


class CpuStop(Enum):
    """Why a slice ended."""

    COUNT = auto()
    SLEEP = auto()
    RETURN = auto()
    CALL = auto()
    READ_FAULT = auto()
    WRITE_FAULT = auto()
    FETCH_FAULT = auto()
    INSTRUCTION_FAULT = auto()
    BREAKPOINT = auto()


FAULT_OF = {
    uc.UC_ERR_READ_UNMAPPED: CpuStop.READ_FAULT,
    uc.UC_ERR_READ_PROT: CpuStop.READ_FAULT,
    uc.UC_ERR_WRITE_UNMAPPED: CpuStop.WRITE_FAULT,
    uc.UC_ERR_WRITE_PROT: CpuStop.WRITE_FAULT,
    uc.UC_ERR_FETCH_UNMAPPED: CpuStop.FETCH_FAULT,
    uc.UC_ERR_FETCH_PROT: CpuStop.FETCH_FAULT,
    uc.UC_ERR_INSN_INVALID: CpuStop.INSTRUCTION_FAULT,
    uc.UC_ERR_EXCEPTION: CpuStop.INSTRUCTION_FAULT,
}

# stops after which the last instruction that was begun has been executed
WHOLE = (CpuStop.SLEEP, CpuStop.RETURN, CpuStop.CALL)
LOAD = ctypes.CFUNCTYPE(
    ctypes.c_uint64, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_void_p
)
STORE = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_uint64, ctypes.c_void_p
)


class RegisterSet:
    """Some registers of an engine, read and written at once, as unsigned integers of up to 64
    bits."""

    def __init__(self, engine: Any, names: Sequence[int]) -> None:
        self._engine = engine  # keeps it alive
        self._handle, n = engine._uch, len(names)
        self._n = n
        self._names = (ctypes.c_int * n)(*names)
        self._values = (ctypes.c_uint64 * n)()
        start = ctypes.addressof(self._values)
        self._pointers = (ctypes.c_void_p * n)(*(start + 8 * k for k in range(n)))

    def read(self) -> list[int]:
        """Their values, in order."""
        for k in range(self._n):
            self._values[k] = 0
        uclib.uc_reg_read_batch(self._handle, self._names, self._pointers, self._n)
        return list(self._values)

    def write(self, values: Sequence[int]) -> None:
        """Set them, in order."""
        for k, value in enumerate(values):
            self._values[k] = value
        uclib.uc_reg_write_batch(self._handle, self._names, self._pointers, self._n)


class Cpu:
    """The processor on its memories and bus."""

    def __init__(self, memories: Memories, bus: Bus, clock: BoardClock, record: Record) -> None:
        self.bus, self.clock, self.record = bus, clock, record
        self.engine = engine = cortex_m7()
        memories.map_into(engine)
        self._kept = self._map_peripherals()
        engine.hook_add(uc.UC_HOOK_INTR, self._told)
        engine.hook_add(uc.UC_HOOK_MEM_INVALID, self._missed)
        self.counter = Counter(engine)
        self._running = False
        self._failure: BaseException | None = None
        self._told_of = 0
        self.fault_address = 0
        self.horizon = 0
        self.slices = 0
        # what an access to a peripheral costs besides its instruction (address, whether it stores)
        self.bus_waits: Callable[[int, bool], None] | None = None
        self.pc_register = RegisterSet(engine, (arm.UC_ARM_REG_PC,))
        self.masks = RegisterSet(
            engine, (arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_BASEPRI, arm.UC_ARM_REG_FAULTMASK)
        )

    @property
    def pc(self) -> int:
        """The address where execution continues."""
        return self.pc_register.read()[0]

    @pc.setter
    def pc(self, value: int) -> None:
        self.pc_register.write((value | 1,))

    def run(self, instructions: int, horizon: int) -> CpuStop:
        """Execute at most the given number of instructions, which should last until ``horizon``
        (ticks). Returns the reason for the stop."""
        self._told_of, self.horizon = 0, horizon
        self.slices += 1
        stop, begun = CpuStop.COUNT, self.counter.begun
        begun.value = 0
        self._running = True
        self.clock.slice_begins(begun)
        try:
            self.engine.emu_start(self.pc | 1, NOWHERE, 0, instructions)
        except unicorn.UcError as error:
            if error.errno not in FAULT_OF:
                raise
            stop = FAULT_OF[error.errno]
        finally:
            self._running = False
            if stop is CpuStop.COUNT:
                stop = self._why(begun.value)
            executed = begun.value - (stop not in WHOLE)
            self.record.instructions += executed
            self.clock.slice_ends(executed)
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure
        return stop

    def shorten(self, at: int) -> None:
        """End the running slice when time reaches ``at``, or after this instruction if that is
        past."""
        if self._running and at < self.horizon:
            self.horizon = at
            left = -(-(at - self.clock.now) // self.clock.instruction_ticks)
            self.counter.stop_after(self.counter.begun.value + max(left, 0))

    def stall(self, ticks: int) -> None:
        """Stand still for so long."""
        self.clock.skip(ticks)
        if self._running:
            left = -(-(self.horizon - self.clock.now) // self.clock.instruction_ticks)
            self.counter.stop_after(self.counter.begun.value + max(left, 0))

    def end_slice(self) -> None:
        """End the running slice after this instruction."""
        if self._running:
            self.horizon = 0
            self.counter.stop_after(0)

    def _why(self, started: int) -> CpuStop:
        if self._told_of == EXCEPTION_RETURN:
            return CpuStop.RETURN
        if self._told_of == SVC:
            return CpuStop.CALL
        if self._told_of == BREAKPOINT:
            return CpuStop.BREAKPOINT
        if self._told_of == FETCH_ABORT:
            self.fault_address = self.pc
            return CpuStop.FETCH_FAULT
        if self._told_of:
            return CpuStop.INSTRUCTION_FAULT
        return CpuStop.COUNT if started > self.counter.limit else CpuStop.SLEEP

    def _told(self, engine: Any, number: int, data: object) -> None:
        self._told_of = number
        engine.emu_stop()

    def _missed(
        self, engine: Any, kind: int, address: int, size: int, value: int, data: object
    ) -> bool:
        self.fault_address = address
        return False

    def _map_peripherals(self) -> list[Any]:
        """Straight into the library: Unicorn's Python layer takes longer for an access than all
        that follows."""
        kept: list[Any] = []
        for base, size in PERIPHERALS:

            def load(
                engine: object, offset: int, width: int, data: object, base: int = base
            ) -> int:
                try:
                    if self.bus_waits is not None:
                        self.bus_waits(base + offset, False)
                    return self.bus.read(base + offset, width)
                except BaseException as failure:  # raised again when the slice has ended
                    self._failed(failure)
                    return 0

            def store(
                engine: object, offset: int, width: int, value: int, data: object, base: int = base
            ) -> None:
                try:
                    if self.bus_waits is not None:
                        self.bus_waits(base + offset, True)
                    self.bus.write(base + offset, width, value)
                except BaseException as failure:
                    self._failed(failure)

            functions = LOAD(load), STORE(store)
            kept.append(functions)
            pointers = [ctypes.cast(function, ctypes.c_void_p) for function in functions]
            size_t = ctypes.c_size_t(size)
            error = uclib.uc_mmio_map(
                self.engine._uch,
                ctypes.c_uint64(base),
                size_t,
                pointers[0],
                None,
                pointers[1],
                None,
            )
            if error != uc.UC_ERR_OK:
                raise unicorn.UcError(error)
        return kept

    def _failed(self, failure: BaseException) -> None:
        self._failure = self._failure or failure
        self.end_slice()
