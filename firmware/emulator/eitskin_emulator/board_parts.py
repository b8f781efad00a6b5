"""The emulated board's parts, made and wired: processor, peripherals and what hangs on the pins."""

from collections.abc import Callable
from struct import unpack_from

from eitskin.errors import DeviceError
from eitskin_emulator.analog.ad9833 import Ad9833
from eitskin_emulator.analog.adg1206 import ELECTRODES, OF_ONE_PART, Multiplexers
from eitskin_emulator.analog.drive_monitor import DriveMonitor
from eitskin_emulator.analog.front_end import FrontEnd
from eitskin_emulator.analog.skin import AnalogSkin
from eitskin_emulator.bus import Bus, Peripheral
from eitskin_emulator.clocktime import BoardClock
from eitskin_emulator.cpu import Cpu
from eitskin_emulator.exceptions import Exceptions
from eitskin_emulator.memory import BANK_BYTES, BANKS, FLASH, PROGRAM_BYTES, Memories
from eitskin_emulator.peripherals.adc import Adc
from eitskin_emulator.peripherals.dma import Dma
from eitskin_emulator.peripherals.dwt import Dwt
from eitskin_emulator.peripherals.exti import Exti
from eitskin_emulator.peripherals.flash import FlashInterface
from eitskin_emulator.peripherals.gpio import ANALOG, GpioPort
from eitskin_emulator.peripherals.iwdg import DebugControl, Iwdg
from eitskin_emulator.peripherals.mpu import Mpu
from eitskin_emulator.peripherals.nvic import (
    NMI,
    Nvic,
)
from eitskin_emulator.peripherals.rcc import HSE_HZ, Pwr, Rcc
from eitskin_emulator.peripherals.scb import SystemSpace
from eitskin_emulator.peripherals.spi import Spi
from eitskin_emulator.peripherals.systick import SysTick
from eitskin_emulator.peripherals.tim import MASTERS, Timer
from eitskin_emulator.peripherals.usart import Usart
from eitskin_emulator.record import Record
from eitskin_emulator.schedule import Schedule
from eitskin_emulator.serial_line import SerialLine

# the owner's settings (firmware/app/safety/owner_record.h, two sectors of 256 KB)
PAGES, PAGES_BYTES, RECORD_BYTES, MAGIC = 0x08140000, 0x80000, 128, 0x32455345
MORE_FITTED_PIN, MORE_ENABLE_PIN, ENABLE_PIN = 7, 8, 12
FSYNC_PIN, MCO_PIN, ADC_PIN, SENSE_PIN = 2, 8, 3, 0
SCK_PIN, MOSI_PIN, TX_PIN, RX_PIN = 10, 12, 8, 9
MCO_FUNCTION, SPI3_FUNCTION, USART3_FUNCTION = 0, 6, 7


class BoardParts:
    """A NUCLEO-F767ZI with ``image`` at 0x08000000 and what ``banks`` hold at 0x08040000 and
    0x080C0000, before ``skin``. If the skin has more than 16 electrodes, the second four
    multiplexers are fitted.

    ``hse_hz`` None: no 8 MHz come from the ST-LINK. What hangs outside the processor
    (``generator``, ``multiplexers``, ``front_end``, ``line``) and ``memories`` outlive its resets.

    Raises:
        DeviceError: the image or a bank is too long, the skin has more than 32 electrodes, or
            Unicorn is a version that cannot be used.
    """

    def __init__(
        self,
        image: bytes,
        skin: AnalogSkin,
        banks: tuple[bytes, ...] = (),
        hse_hz: int | None = HSE_HZ,
    ) -> None:
        if not 8 <= len(image) <= PROGRAM_BYTES:
            raise DeviceError(
                f"the firmware image has {len(image)} bytes; the board's program, a .bin, has"
                f" {PROGRAM_BYTES} at most"
            )
        electrodes = skin.protocol.n_electrodes
        if electrodes > ELECTRODES:
            raise DeviceError(
                f"the skin has {electrodes} electrodes; the board's multiplexers reach {ELECTRODES}"
            )
        self.record, self.clock, self.schedule, self.memories = (
            Record(),
            BoardClock(),
            Schedule(),
            Memories(),
        )
        self.memories.flash[: len(image)] = image
        for at, bank in zip(BANKS, banks, strict=False):
            if len(bank) > BANK_BYTES:
                raise DeviceError(f"a bank has {len(bank)} bytes; the board's hold {BANK_BYTES}")
            self.memories.flash[at - FLASH : at - FLASH + len(bank)] = bank
        self.skin = skin
        self.generator = Ad9833()
        self.multiplexers = Multiplexers()
        self.front_end = FrontEnd(self.generator, self.multiplexers, skin)
        self.line = SerialLine(self.clock)
        self.drive = DriveMonitor(
            self.generator, self.multiplexers, lambda: self.line.heard_at, self._keeps_drive
        )
        self._build(hse_hz)
        self._wire()
        self._reset_cause: str | None = "power"
        self._later: list[Callable[[], None]] = []

    def reset(self, cause: str) -> None:
        """Start the processor again before it executes another instruction: "pin", "software",
        "watchdog" or "power"."""
        self._reset_cause = cause
        self.cpu.end_slice()

    def _build(self, hse_hz: int | None) -> None:
        clock, schedule, record = self.clock, self.schedule, self.record
        self.rcc = Rcc(clock, record, hse_hz)
        self.bus = Bus(record, self.rcc)
        self.cpu = Cpu(self.memories, self.bus, clock, record)
        self.exceptions = Exceptions(self.cpu, self.memories)
        self.nvic = Nvic(self.cpu.masks)
        self.systick, self.mpu, self.dwt = (
            SysTick(clock, schedule, self.nvic),
            Mpu(self.memories),
            Dwt(clock, record),
        )
        self.scb = SystemSpace(
            self.nvic, self.systick, self.mpu, self.dwt, record, lambda: self.reset("software")
        )
        self.pwr = Pwr(clock, record)
        self.ports = {letter: GpioPort(letter, clock, record) for letter in "ABCDEFGHI"}
        self.timers = {
            number: Timer(number, clock, schedule, self.nvic, self.rcc, record)
            for number in MASTERS
        }
        self.dmas = {
            number: Dma(number, self.memories, self.nvic, record, self._cached) for number in (1, 2)
        }
        self.spi = Spi("SPI3", 0x40003C00, ("APB1ENR", 15), clock, schedule, self.rcc, record)
        self.adc = Adc(clock, schedule, self.nvic, self.rcc, self.dmas[2], self.timers[2], record)
        self.exti = Exti(self.nvic, record)
        self.usart = Usart(clock, schedule, self.nvic, self.rcc, self.dmas[1], self.line, record)
        self.flash = FlashInterface(self.memories, record, self.cpu.stall, self._after_slice)
        self.iwdg = Iwdg(clock, schedule, record, lambda: self.reset("watchdog"))
        self.debug = DebugControl(record)
        own = (self.rcc, self.pwr, self.spi, self.adc, self.usart, self.flash, self.iwdg, self.exti)
        peripherals: list[Peripheral] = [
            *own,
            *self.ports.values(),
            *self.timers.values(),
            *self.dmas.values(),
        ]
        for peripheral in peripherals:
            self.bus.add(peripheral)
        self.bus.add(self.debug)
        for core in (self.scb, self.dwt):
            self.bus.add(core, kilobytes=4)

    def _wire(self) -> None:
        rcc, ports = self.rcc, self.ports
        self.schedule.earlier = self.cpu.shorten
        self.line.host_sends = self.usart.plan
        rcc.over_drive, rcc.wait_states, rcc.mco_changed = (
            lambda: self.pwr.ready(17),
            self.flash.wait_states,
            self._mco,
        )
        for number, timer in self.timers.items():
            timer.masters = {itr: self.timers[master] for itr, master in MASTERS[number].items()}
            for master in timer.masters.values():
                master.slaves.append(timer)
            rcc.listeners.append((timer.clock_changes, timer.clock_changed))
            rcc.resetters[0x40, number - 2] = timer.reset
        rcc.listeners.append((lambda: None, self.systick.clock_changed))
        rcc.resetters |= {
            (0x40, 15): self.spi.reset,
            (0x40, 18): self.usart.reset,
            (0x44, 8): self.adc.reset,
        }
        rcc.resetters |= {(0x30, 20 + number): dma.reset for number, dma in self.dmas.items()}
        if self.skin.protocol.n_electrodes > OF_ONE_PART:
            ports["F"].lowered = 1 << MORE_FITTED_PIN
        ports["A"].mode_changed = self._mco
        ports["D"].watch = self._fsync
        ports["E"].watch = lambda at, driven, levels: self.multiplexers.set_addresses(
            at, levels & 0xFFFF
        )
        ports["F"].watch = lambda at, driven, levels: self.multiplexers.set_enables(
            at, levels >> ENABLE_PIN & 0xF | (levels >> MORE_ENABLE_PIN & 0xF) << 4
        )
        self.spi.sent = self.generator.shifted
        self.generator.took = self.drive.word
        self.spi.connected = lambda: all(
            ports["C"].has_function(pin, SPI3_FUNCTION) for pin in (SCK_PIN, MOSI_PIN)
        )
        self.usart.tx_connected = lambda: ports["D"].has_function(TX_PIN, USART3_FUNCTION)
        self.usart.rx_connected = lambda: ports["D"].has_function(RX_PIN, USART3_FUNCTION)
        self.front_end.connected = lambda: ports["A"].mode(ADC_PIN) == ANALOG
        self.front_end.drive_switched = self.drive.switched
        self.front_end.before_switch = self.adc.bring_up_to_date
        self.front_end.sense_connected = lambda: ports["C"].mode(SENSE_PIN) == ANALOG
        self.adc.second.divisor, self.adc.second.sample = 4, self.front_end.sense
        rcc.failed = lambda: self.nvic.pend(NMI)
        self.adc.sample = self.front_end.sample
        for number, user in ((1, self.usart), (2, self.adc)):
            dma = self.dmas[number]
            dma.bring_up_to_date, dma.stream_changed = user.bring_up_to_date, user.plan
            dma.clocked = lambda gate=dma.gate: rcc.clocked(gate)  # type: ignore[misc]

    def _cached(self, address: int) -> bool:
        return self.scb.data_cache_on and self.mpu.cached(address)

    def _mco(self) -> None:
        hz = self.rcc.mco1_hz if self.ports["A"].has_function(MCO_PIN, MCO_FUNCTION) else 0
        self.generator.set_mclk(self.clock.now, hz)

    def _fsync(self, at: int, driven: int, levels: int) -> None:
        level = levels >> FSYNC_PIN & 1 if driven >> FSYNC_PIN & 1 else 1
        self.generator.fsync(at, level)

    def _after_slice(self, action: Callable[[], None]) -> None:
        self._later.append(action)
        self.cpu.end_slice()

    def _keeps_drive(self) -> bool:
        """Return whether the latest of the owner's settings lets current flow without a host."""
        latest, keeps = -1, False
        for at in range(PAGES, PAGES + PAGES_BYTES, RECORD_BYTES):
            magic, generation, settings = unpack_from("<III", self.memories.flash, at - FLASH)
            if magic == MAGIC and generation > latest:
                latest, keeps = generation, bool(settings & 1)
        return keeps
