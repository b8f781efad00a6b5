"""The memory protection unit (ARMv7-M manual B3.5): its registers, and regions without access.

ITCM is closed, or open for reading alone, in pages of 2 KB. A forbidden region in RAM (a stack's
guard) is watched: what was stored in it is found when the slice ends, and is the fault that silicon
raises at the store itself; a load is not found. Attributes (cached or not) serve ``cached``;
execute-never and unprivileged access are not enforced.
"""

from dataclasses import dataclass

from eitskin_emulator.memory import ITCM_BYTES, ITCM_PAGE, RAM, RAM_BYTES, Memories

REGIONS = 8
MAX_WATCHED = 4096


@dataclass
class MpuRegion:
    """RBAR and RASR of a region."""

    base: int = 0
    attributes: int = 0

    @property
    def size(self) -> int:
        return 1 << ((self.attributes >> 1 & 0x1F) + 1)

    def covers(self, address: int) -> bool:
        """Return whether it is enabled and ``address`` lies in it, not in a subregion that is left
        out."""
        size = self.size
        if (
            not self.attributes & 1
            or not self.base & ~(size - 1) <= address < (self.base & ~(size - 1)) + size
        ):
            return False
        return size < 256 or not self.attributes >> 8 >> ((address & (size - 1)) * 8 // size) & 1

    @property
    def denies(self) -> bool:
        """Nobody may load or store."""
        return self.attributes >> 24 & 7 == 0

    @property
    def read_only(self) -> bool:
        """Nobody may store."""
        return self.attributes >> 24 & 7 >= 5

    @property
    def cached(self) -> bool:
        """Normal memory that the data cache may hold (TEX, C, B)."""
        tex, c, b = self.attributes >> 19 & 7, self.attributes >> 17 & 1, self.attributes >> 16 & 1
        if tex & 4:
            return tex & 3 != 0
        return bool(c) if tex == 0 else tex == 1 and bool(c and b)


class Mpu:
    """The regions; the last one that covers an address applies."""

    def __init__(self, memories: Memories) -> None:
        self._memories = memories
        self._itcm = [(False, False)] * (ITCM_BYTES // ITCM_PAGE)  # each page: denied, read only
        self.reset()

    def reset(self) -> None:
        """As after a reset."""
        self._control = self._number = 0
        self._regions = [MpuRegion() for _ in range(REGIONS)]
        self._watched: list[tuple[int, bytes]] = []
        self._follow()

    def region(self, address: int) -> MpuRegion | None:
        """The region that counts at ``address``; None: the MPU is off, or has nothing to say."""
        if not self._control & 1:
            return None
        return next((one for one in reversed(self._regions) if one.covers(address)), None)

    def denies(self, address: int) -> bool:
        """Return whether ``address`` may not be used."""
        region = self.region(address)
        return region is not None and region.denies

    def cached(self, address: int) -> bool:
        """Whether the data cache may hold ``address`` (by the default map, where no region says
        otherwise: not DTCM)."""
        region = self.region(address)
        if address < 0x20020000 and address >= 0x20000000:
            return False  # tightly coupled, whatever the attributes
        return 0 <= address < 0x40000000 if region is None else region.cached

    def trespassed(self) -> int | None:
        """An address in a guarded region that was stored to since the last call; None: none was."""
        ram = self._memories.ram
        for at, content in self._watched:
            now = ram[at : at + len(content)]
            if now != content:
                self._watch()
                return RAM + next(at + k for k in range(len(now)) if now[k] != content[k])
        return None

    def read(self, offset: int) -> int:
        """A register, from MPU_TYPE on."""
        region = self._regions[self._number]
        return {
            0x0: REGIONS << 8,
            0x4: self._control,
            0x8: self._number,
            0xC: region.base | self._number,
            0x10: region.attributes,
        }.get(offset, 0)

    def write(self, offset: int, value: int) -> None:
        """A register, from MPU_TYPE on."""
        if offset == 0x4:
            self._control = value & 7
        elif offset == 0x8:
            self._number = value % REGIONS
        elif offset == 0xC:
            if value & 0x10:
                self._number = value & 0xF
            self._regions[self._number % REGIONS].base = value & ~0x1F
        elif offset == 0x10:
            self._regions[self._number].attributes = value
        self._follow()

    def _follow(self) -> None:
        for page, before in enumerate(self._itcm):
            region = self.region(page * ITCM_PAGE)
            wanted = (region is not None and region.denies, region is not None and region.read_only)
            if wanted != before:
                self._itcm[page] = wanted
                self._memories.protect_itcm(page * ITCM_PAGE, *wanted)
        self._watch()

    def _watch(self) -> None:
        self._watched = []
        if not self._control & 1:
            return
        for region in self._regions:
            at = region.base - RAM
            if (
                region.attributes & 1
                and region.denies
                and region.size <= MAX_WATCHED
                and 0 <= at < RAM_BYTES
            ):
                self._watched.append((at, bytes(self._memories.ram[at : at + region.size])))
