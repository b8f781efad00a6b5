"""The memories of an STM32F767ZI (RM0410 2.2.2), and the engine's view of them.

Flash is one bank of 2 MB (nDBANK set), seen at 0x08000000 and, its first 256 KB, at 0x00200000 as
well. It is mapped in pieces, so that a piece can turn into registers while it is programmed. Caches
are not modelled: memory is always coherent here, and ``Record.hazards`` tells where DMA met memory
that is cached on silicon.
"""

import ctypes
import mmap
from typing import Any

from unicorn.unicorn_const import UC_PROT_ALL, UC_PROT_EXEC, UC_PROT_NONE, UC_PROT_READ

FLASH, FLASH_BYTES, FLASH_ITCM = 0x08000000, 0x200000, 0x00200000
PROGRAM_BYTES = 0x40000
BANKS, BANK_BYTES = (0x08040000, 0x080C0000), 0x80000
ITCM, ITCM_BYTES, ITCM_PAGE = 0x00000000, 0x4000, 0x800
RAM, RAM_BYTES = 0x20000000, 0x80000  # DTCM 128 KB, SRAM1 368 KB, SRAM2 16 KB without a gap
DTCM_BYTES = 0x20000
SYSTEM, SYSTEM_BYTES = 0x1FF0F000, 0x1000
UID = 0x1FF0F420  # RM0410 45.1
FLASH_KB = 0x1FF0F442  # RM0410 45.2
PIECES = ((FLASH, PROGRAM_BYTES), *((bank, BANK_BYTES) for bank in BANKS), (0x08140000, 0xC0000))


class Memories:
    """The contents: flash outlives everything, RAM outlives a reset but not a loss of power."""

    def __init__(self, serial: bytes = b"emulated-001") -> None:
        self.flash = mmap.mmap(-1, FLASH_BYTES)
        self.ram = mmap.mmap(-1, RAM_BYTES)
        self.itcm = mmap.mmap(-1, ITCM_BYTES)
        self.system = mmap.mmap(-1, SYSTEM_BYTES)
        self.flash[:] = b"\xff" * FLASH_BYTES
        self.system[UID - SYSTEM : UID - SYSTEM + 12] = serial[:12].ljust(12, b"\0")
        self.system[FLASH_KB - SYSTEM : FLASH_KB - SYSTEM + 2] = (FLASH_BYTES // 1024).to_bytes(
            2, "little"
        )
        self._engine: Any = None

    def lose_power(self) -> None:
        """Fill RAM as after a loss of power: here with a pattern that is not valid data of any
        kind."""
        self.ram[:] = b"\xa5\x5a\xc3\x3c" * (RAM_BYTES // 4)
        self.itcm[:] = b"\xa5\x5a\xc3\x3c" * (ITCM_BYTES // 4)

    def map_into(self, engine: Any) -> None:
        """Let the processor see them."""
        self._engine = engine
        for at, size in PIECES:
            self._map(at, self.flash, at - FLASH, size, UC_PROT_READ | UC_PROT_EXEC)
        self._map(FLASH_ITCM, self.flash, 0, PROGRAM_BYTES, UC_PROT_READ | UC_PROT_EXEC)
        self._map(ITCM, self.itcm, 0, ITCM_BYTES, UC_PROT_ALL)
        self._map(RAM, self.ram, 0, RAM_BYTES, UC_PROT_ALL)
        self._map(SYSTEM, self.system, 0, SYSTEM_BYTES, UC_PROT_READ)

    def protect_itcm(self, at: int, denied: bool, read_only: bool) -> None:
        """The accesses that the MPU forbids in ``ITCM_PAGE`` bytes of ITCM from ``at`` on."""
        allowed = UC_PROT_READ | UC_PROT_EXEC if read_only else UC_PROT_ALL
        self._engine.mem_protect(at, ITCM_PAGE, UC_PROT_NONE if denied else allowed)

    def open_piece(self, at: int, read: Any, write: Any) -> None:
        """Let ``read(engine, offset, size, data)`` and ``write(engine, offset, size, value, data)``
        be a piece of flash."""
        size = dict(PIECES)[at]
        self._engine.mem_unmap(at, size)
        self._engine.mmio_map(at, size, read, None, write, None)

    def close_piece(self, at: int) -> None:
        """Let the piece be memory again."""
        size = dict(PIECES)[at]
        self._engine.mem_unmap(at, size)
        self._map(at, self.flash, at - FLASH, size, UC_PROT_READ | UC_PROT_EXEC)

    def find(self, address: int, size: int) -> tuple[mmap.mmap, int] | None:
        """Return the memory that contains these bytes, and their offset in it; None: no memory
        does."""
        for start, memory, length in (
            (RAM, self.ram, RAM_BYTES),
            (FLASH, self.flash, FLASH_BYTES),
            (ITCM, self.itcm, ITCM_BYTES),
            (FLASH_ITCM, self.flash, FLASH_BYTES),
            (SYSTEM, self.system, SYSTEM_BYTES),
        ):
            if start <= address and address + size <= start + length:
                return memory, address - start
        return None

    def read(self, address: int, size: int) -> bytes | None:
        """Return bytes as DMA reads them; None: there is no memory."""
        found = self.find(address, size)
        return None if found is None else found[0][found[1] : found[1] + size]

    def write(self, address: int, data: bytes) -> bool:
        """Write as DMA does, RAM only; False: there is no memory to write."""
        found = self.find(address, len(data))
        if found is None or found[0] is not self.ram:
            return False
        self.ram[found[1] : found[1] + len(data)] = data
        return True

    def word(self, address: int) -> int:
        """The word at ``address``; 0 if no memory is."""
        return int.from_bytes(self.read(address, 4) or b"", "little")

    def _map(self, at: int, memory: mmap.mmap, offset: int, size: int, protection: int) -> None:
        pointer = ctypes.addressof(ctypes.c_char.from_buffer(memory)) + offset
        self._engine.mem_map_ptr(at, size, protection, pointer)
