"""Read the number of instructions that a run of Unicorn has executed so far, and set where it will
stop, from inside a callback.

Unicorn's interface gives neither; its engine counts anyway when a run is limited (``count=``). The
two words are found by watching them count a known program, so that no version's layout is written
down here; a build in which they are not to be found is refused. Without them time within a slice
would be a guess, or a Python call an instruction.
"""

import ctypes
import importlib
from functools import lru_cache
from typing import Any

from unicorn import arm_const as arm
from unicorn.unicorn_const import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB

from eitskin.errors import DeviceError

_LOOKED_AT = 4096  # bytes at the start of the engine's state; it is over 14,000 long
_AT = 0x10000
_NOP = b"\x00\xbf"
unicorn: Any = importlib.import_module("unicorn")  # its types are half of them
TRIALS = ((37, 1003), (211, 2007), (1500, 50021))


def cortex_m7() -> Any:
    """A Unicorn engine that executes Cortex-M7 code."""
    engine = unicorn.Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
    engine.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M7)
    return engine


def address_of(engine: Any) -> int:
    """Return the address of an engine's state."""
    return int(engine._uch.value)


class Counter:
    """The two words of one engine. ``begun``: instructions that this run has begun, the one that
    calls back included."""

    def __init__(self, engine: Any) -> None:
        counted, limit = offsets()
        self.begun = ctypes.c_uint64.from_address(address_of(engine) + counted)
        self._limit = ctypes.c_uint64.from_address(address_of(engine) + limit)

    @property
    def limit(self) -> int:
        """Instructions after which this run stops."""
        return int(self._limit.value)

    def stop_after(self, instructions: int) -> None:
        """Let this run stop after the given number of instructions, but not before the end of the
        instruction that calls back."""
        self._limit.value = max(min(self._limit.value, instructions), self.begun.value)


@lru_cache(maxsize=1)
def offsets() -> tuple[int, int]:
    """Return the offsets of the count and of the limit in an engine's state.

    Raises:
        DeviceError: this build of Unicorn keeps them otherwise.
    """
    engine = cortex_m7()
    engine.mem_map(_AT, 0x10000)
    engine.mem_write(_AT, _NOP * 2000)
    counts: set[int] | None = None
    limits: set[int] | None = None
    for executed, limit in TRIALS:
        engine.emu_start(_AT | 1, _AT + 2 * executed, count=limit)
        words = _words(engine)
        at_count = {k for k, word in enumerate(words) if word == executed}
        at_limit = {k for k, word in enumerate(words) if word == limit}
        counts = at_count if counts is None else counts & at_count
        limits = at_limit if limits is None else limits & at_limit
    if counts is None or limits is None or len(counts) != 1 or len(limits) != 1:
        raise DeviceError(
            f"unicorn {unicorn.__version__} does not count instructions where eitskin looks for it;"
            " install the version that is tested:  pip install 'unicorn==2.1.4'"
        )
    return 8 * counts.pop(), 8 * limits.pop()


def _words(engine: Any) -> list[int]:
    return list((ctypes.c_uint64 * (_LOOKED_AT // 8)).from_address(address_of(engine)))
