"""Reset and clock control (RM0410 chapter 5): oscillators, PLL, bus clocks, MCO1, which peripherals
are clocked or reset.

HSE is the 8 MHz that the ST-LINK drives; it is ready after 4 us, a PLL after 100 us. A switch of
SYSCLK takes effect at once; with clock security on, a failure of HSE switches to HSI and raises
NMI (5.2.7). Not modelled: PLLSAI, PLLI2S, low-power modes.
Peripheral clocks come from the buses (DCKCFGR2 = 0).
"""

from collections.abc import Callable

from eitskin_emulator.clocktime import TICKS_PER_S, TICKS_PER_US, BoardClock
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record

HSI_HZ, HSE_HZ = 16_000_000, 8_000_000
CR, PLLCFGR, CFGR, CIR, CSR, DCKCFGR1 = 0x00, 0x04, 0x08, 0x0C, 0x74, 0x8C
HSE_ON, CLOCK_SECURITY, PLL_ON = 1 << 16, 1 << 19, 1 << 24
FAILED, FORGET_FAILURE = 1 << 7, 1 << 23  # CSSF and CSSC
HSE_READY_TICKS, PLL_READY_TICKS = 4 * TICKS_PER_US, 100 * TICKS_PER_US
ENABLES = {"AHB1ENR": 0x30, "AHB2ENR": 0x34, "AHB3ENR": 0x38, "APB1ENR": 0x40, "APB2ENR": 0x44}
RESET_OFFSET = 0x20  # from an enable register back to its reset register
CAUSES = {"pin": 26, "power": 27, "software": 28, "watchdog": 29}
MAX_HZ_WITHOUT_OVERDRIVE, HZ_A_WAIT_STATE = 180_000_000, 30_000_000
RESET_VALUES = {
    **{CR: 0x83, PLLCFGR: 0x24003010, CFGR: 0, 0x0C: 0},
    **{0x10: 0, 0x14: 0, 0x18: 0, 0x20: 0, 0x24: 0},
    **{0x30: 0x00100000, 0x34: 0, 0x38: 0, 0x40: 0x400, 0x44: 0},
    **{
        0x50: 0x7EF7B7FF,
        0x54: 0xF1,
        0x58: 3,
        0x60: 0xFFFFCBFF,
        0x64: 0x04F77F33,
        0x70: 0,
        CSR: 0,
        0x8C: 0,
        0x90: 0,
    },
}
PWR_RESET_VALUES = {0x00: 0xC000, 0x04: 0, 0x08: 0, 0x0C: 0}


class Rcc(Registers):
    """0x40023800. ``listeners`` are called before and after a clock changes, ``resetters`` when a
    peripheral is reset."""

    name, base = "RCC", 0x40023800

    def __init__(self, clock: BoardClock, record: Record, hse_hz: int | None = HSE_HZ) -> None:
        super().__init__(record, RESET_VALUES)
        self._clock, self._hse_hz = clock, hse_hz
        self._hse_on_at = self._pll_on_at = 0
        self.over_drive: Callable[[], bool] = lambda: False
        self.wait_states: Callable[[], int] = lambda: 0
        self.listeners: list[tuple[Callable[[], None], Callable[[], None]]] = []
        self.resetters: dict[tuple[int, int], Callable[[], None]] = {}
        self.mco_changed: Callable[[], None] = lambda: None
        self.failed: Callable[[], None] = lambda: None  # raises NMI

    def reset(self, cause: str) -> None:
        """As after a reset for ``cause``; CSR keeps earlier causes until RMVF, and power forgets
        them."""
        kept = 0 if cause == "power" else self.values[CSR] & 0xFE000000
        self.values = dict(self.reset_values)
        self.values[CSR] = kept | 1 << CAUSES[cause] | 1 << CAUSES["pin"]
        self._clock.set_cycle_ticks(TICKS_PER_S // HSI_HZ)

    # ---- who is clocked how ----

    def clocked(self, gate: tuple[str, int]) -> bool:
        """Return whether a peripheral's enable bit is set."""
        return bool(self.values[ENABLES[gate[0]]] >> gate[1] & 1)

    @property
    def sysclk_hz(self) -> int:
        """The frequency of the processor's clock source."""
        source = self.values[CFGR] & 3
        return (HSI_HZ, self._hse_hz or 0, self._pll_hz(), 0)[source]

    @property
    def hclk_hz(self) -> int:
        """The frequency of the processor and the AHB."""
        code = self.values[CFGR] >> 4 & 0xF
        return self.sysclk_hz // (1 if code < 8 else (2, 4, 8, 16, 64, 128, 256, 512)[code - 8])

    def apb_hz(self, bus: int) -> int:
        """Return the frequency of APB1 or APB2."""
        return self.hclk_hz // self._apb_divisor(bus)

    def timer_hz(self, bus: int) -> int:
        """Return the frequency of the timers on APB1 or APB2 (5.2, "Clocks": twice the bus where it
        is divided, with TIMPRE up to four times)."""
        divisor, most = self._apb_divisor(bus), 4 if self.values[DCKCFGR1] >> 24 & 1 else 2
        return self.hclk_hz if divisor <= most else self.apb_hz(bus) * most

    @property
    def mco1_hz(self) -> int:
        """The frequency that PA8 gives in its alternate function 0; 0: no clock."""
        source = self.values[CFGR] >> 21 & 3
        code = self.values[CFGR] >> 24 & 7
        hse = (self._hse_hz or 0) if self._ready(CR) >> 17 & 1 else 0
        return (HSI_HZ, 0, hse, self._pll_hz())[source] // (1 if code < 4 else code - 2)

    def _apb_divisor(self, bus: int) -> int:
        code = self.values[CFGR] >> (10 if bus == 1 else 13) & 7
        return 1 if code < 4 else (2, 4, 8, 16)[code - 4]

    def _pll_hz(self) -> int:
        word = self.values[PLLCFGR]
        source = (self._hse_hz or 0) if word >> 22 & 1 else HSI_HZ
        return source * (word >> 6 & 0x1FF) // max(word & 0x3F, 1) // (2 * (word >> 16 & 3) + 2)

    def set_hse(self, hz: int | None) -> None:
        """The ST-LINK's clock fails (None), or comes back."""
        guarded = hz is None and self.values[CR] & CLOCK_SECURITY and self._ready(CR) >> 17 & 1
        if not guarded:
            self._hse_hz = hz
            self.mco_changed()
            return
        self._switch(self.values[CFGR] & ~3, self.values[CFGR])
        self._hse_hz = None
        self.values[CR] &= ~(HSE_ON | PLL_ON)
        self.values[CIR] |= FAILED
        self.mco_changed()
        self.failed()

    # ---- registers ----

    def read(self, offset: int, size: int) -> int:
        return self._ready(offset) if offset == CR else super().read(offset, size)

    def _ready(self, offset: int) -> int:
        value, now = self.values[offset] & ~0x02020002, self._clock.now
        hse = (
            bool(value >> 16 & 1)
            and bool(self._hse_hz)
            and now >= self._hse_on_at + HSE_READY_TICKS
        )
        pll = bool(value >> 24 & 1) and now >= self._pll_on_at + PLL_READY_TICKS
        if self.values[PLLCFGR] >> 22 & 1:
            pll = pll and hse
        return value | (value & 1) << 1 | int(hse) << 17 | int(pll) << 25

    def write(self, offset: int, size: int, value: int) -> None:
        before = self.values.get(offset, 0)
        if offset == CR:
            self._hse_on_at = self._clock.now if value & ~before & 1 << 16 else self._hse_on_at
            self._pll_on_at = self._clock.now if value & ~before & 1 << 24 else self._pll_on_at
            self.values[CR] = value
            self.mco_changed()
        elif offset == PLLCFGR and self.values[CR] >> 24 & 1:
            self.hazard("PLLCFGR written while the PLL is on")
        elif offset == CFGR:
            self._switch(value, before)
        elif offset == CIR:
            self.values[CIR] &= ~FAILED if value & FORGET_FAILURE else ~0
        elif offset == CSR:
            self.values[CSR] = value & 1 | (0 if value >> 24 & 1 else before & 0xFE000000)
        else:
            super().write(offset, size, value)
            if offset + RESET_OFFSET in ENABLES.values():
                for bit in range(32):
                    if value >> bit & 1 and (offset + RESET_OFFSET, bit) in self.resetters:
                        self.resetters[offset + RESET_OFFSET, bit]()

    def _switch(self, value: int, before: int) -> None:
        wanted = value & 3
        ready = (True, bool(self._ready(CR) >> 17 & 1), bool(self._ready(CR) >> 25 & 1), False)[
            wanted
        ]
        if not ready:
            self.hazard("SYSCLK switched to a source that is not ready")
            wanted = before & 3
        for before_change, _ in self.listeners:
            before_change()
        self.values[CFGR] = value & ~0xF | wanted | wanted << 2
        self._clock.set_cycle_ticks(max(round(TICKS_PER_S / self.hclk_hz), 1))
        for _, after_change in self.listeners:
            after_change()
        self.mco_changed()
        if self.sysclk_hz > MAX_HZ_WITHOUT_OVERDRIVE and not self.over_drive():
            self.hazard("above 180 MHz without over-drive")
        if self.hclk_hz > HZ_A_WAIT_STATE * (self.wait_states() + 1) + HZ_A_WAIT_STATE // 5:
            self.hazard("too few wait states of the flash")
        for bus, most_hz in ((1, 54_000_000), (2, 108_000_000)):
            if self.apb_hz(bus) > most_hz:
                self.hazard(f"APB{bus} above {most_hz // 1_000_000} MHz")


class Pwr(Registers):
    """0x40007000 (RM0410 chapter 4): over-drive and its switch are ready 10 us after they are asked
    for."""

    name, base = "PWR", 0x40007000
    gate = ("APB1ENR", 28)

    def __init__(self, clock: BoardClock, record: Record) -> None:
        super().__init__(record, PWR_RESET_VALUES)
        self._clock = clock
        self._asked_at = {16: 0, 17: 0}
        self.low = False  # the supply is below the detector's level

    def reset(self) -> None:
        """As after a reset."""
        self.values = dict(self.reset_values)

    def ready(self, bit: int) -> bool:
        """ODRDY (16) or ODSWRDY (17)."""
        return (
            bool(self.values[0] >> bit & 1)
            and self._clock.now >= self._asked_at[bit] + 10 * TICKS_PER_US
        )

    def read(self, offset: int, size: int) -> int:
        if offset == 0x04:
            low = self.low and bool(self.values[0] >> 4 & 1)
            return int(low) << 2 | 1 << 14 | int(self.ready(16)) << 16 | int(self.ready(17)) << 17
        return super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        if offset == 0x00:
            for bit in (16, 17):
                if value >> bit & 1 and not self.values[0] >> bit & 1:
                    self._asked_at[bit] = self._clock.now
            if value >> 17 & 1 and not self.ready(16):
                self.hazard("over-drive switched on before it is ready")
        super().write(offset, size, value)
