"""Cycles that the processor takes to issue a block of instructions, everything being in the caches.

The units are those of LLVM's model of the Cortex-M7 (``bounds``). The optimistic bound counts how
often each unit is needed; the pessimistic one issues one instruction after the other, and lets each
wait for its operands.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import capstone
from capstone import arm as cs

from eitskin_emulator.timing.bounds import Bound

CALL_RETURN = ("b", "bl", "blx", "bx", "cbz", "cbnz", "tbb", "tbh")
MULTIPLE = ("ldm", "stm", "push", "pop", "vldm", "vstm", "vpush", "vpop", "ldrd", "strd")
DIVIDE, FLOAT_DIVIDE = ("sdiv", "udiv"), ("vdiv", "vsqrt")
ALONE = ("mrs", "msr", "dmb", "dsb", "isb", "wfi", "cpsid", "cpsie")
MOVES = ("vmov", "vmrs", "vmsr", "vldr", "vstr")


@dataclass(frozen=True)
class Step:
    """An instruction, as far as time is concerned."""

    reads: tuple[int, ...]
    writes: tuple[int, ...]
    registers: int = 1  # moved by a load or store of several
    loads: bool = False
    stores: bool = False
    single: bool = False  # is never issued beside another one
    floats: bool = False
    branches: bool = False
    divides: bool = False
    float_divides: bool = False
    if_then: bool = False


class Decoder:
    """Thumb code in words of :class:`Step`."""

    def __init__(self) -> None:
        self._engine = capstone.Cs(
            capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS
        )
        self._engine.detail = True

    def steps(self, code: bytes, address: int) -> tuple[list[Step], bool, bool]:
        """The instructions of a block, whether its last one is a conditional branch, and whether it
        goes to an address in a register."""
        steps, conditional, indirect = [], False, False
        for one in self._engine.disasm(code, address):
            steps.append(_step(one))
            name = one.mnemonic.split(".")[0]
            conditional = name in ("cbz", "cbnz") or (
                steps[-1].branches and one.cc not in (cs.ARM_CC_AL, cs.ARM_CC_INVALID)
            )
            indirect = steps[-1].branches and not any(
                operand.type == cs.ARM_OP_IMM for operand in one.operands
            )
        return steps, conditional, indirect


def _step(one: capstone.CsInsn) -> Step:
    name = one.mnemonic.split(".")[0]
    reads, writes = one.regs_access()
    stem = name.removesuffix("ia").removesuffix("db")
    multiple = stem.startswith(MULTIPLE)
    loads = stem.startswith(("ldr", "ldm", "pop", "vldr", "vldm", "vpop", "tb"))
    stores = stem.startswith(("str", "stm", "push", "vstr", "vstm", "vpush"))
    registers = 1
    if multiple:
        listed = [operand for operand in one.operands if operand.type == cs.ARM_OP_REG]
        based = not stem.startswith(("push", "pop", "vpush", "vpop"))  # the address stands first
        registers = 2 if stem in ("ldrd", "strd") else max(len(listed) - based, 1)
    jumps = cs.ARM_REG_PC in writes or (name.startswith(CALL_RETURN) and name != "bic")
    return Step(
        tuple(reads), tuple(writes), registers, loads, stores,
        single=multiple or stem in (*DIVIDE, *ALONE),
        floats=name.startswith("v") and not name.startswith(MOVES) and not multiple,
        branches=jumps and _is_branch(one, name, writes),
        divides=stem in DIVIDE,
        float_divides=stem in FLOAT_DIVIDE,
        if_then=name.startswith("it"),
    )  # fmt: skip


def _is_branch(one: capstone.CsInsn, name: str, writes: Iterable[int]) -> bool:
    groups = (cs.ARM_GRP_JUMP, cs.ARM_GRP_CALL, cs.ARM_GRP_BRANCH_RELATIVE)
    return (
        any(one.group(group) for group in groups) or cs.ARM_REG_PC in writes or name in CALL_RETURN
    )


def paired_half_cycles(steps: list[Step], bound: Bound) -> int:
    """Half cycles at two instructions per cycle: as many as the busiest unit needs."""
    slots = loads = stores = floats = branches = 0
    for one in steps:
        if one.registers > 1:
            slots += 2 * -(-one.registers // bound.registers_per_cycle)
        elif one.divides:
            slots += 2 * bound.integer_divide
        else:
            slots += 2 if one.single else 1
            loads += one.loads
            stores += 2 * one.stores
        floats += 2 * (bound.float_divide if one.float_divides else one.floats)
        branches += 2 * one.branches
    return max(slots, loads, stores, floats, branches)


def waiting_half_cycles(
    steps: list[Step], bound: Bound, late: dict[int, int]
) -> tuple[int, dict[int, int]]:
    """Return the half cycles at one instruction per cycle, if each waits for its operands, and the
    operands that are still late at the end. ``late`` are the operands that come only some cycles
    after the block's start."""
    ready, now = dict(late), 0
    for one in steps:
        now = max([now, *(ready[k] for k in one.reads if k in ready)])
        latency = 1
        busy = 1
        if one.registers > 1:
            busy = 1 + -(-one.registers // bound.registers_per_cycle)
            latency = busy + bound.load_latency - 1
        elif one.loads:
            latency = bound.load_latency
        elif one.divides:
            busy = latency = bound.integer_divide
        elif one.float_divides:
            latency = bound.float_divide
        elif one.floats:
            latency = bound.float_latency
        for register in one.writes:
            ready[register] = now + latency
        now += busy
    return 2 * now, {register: at - now for register, at in ready.items() if at > now}
