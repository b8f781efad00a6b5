"""The emulated board: processor, peripherals and analog parts put together, and the loop that lets
time pass.

The loop executes slices that end where the next event is due, takes exceptions between them, and
skips to the next event when the processor sleeps. While nothing but PRIMASK, BASEPRI or FAULTMASK
holds an interrupt back, slices are single instructions, and longer and longer only where that lasts
for over ten thousand: a program that hangs with interrupts off must end too. Nothing in it depends
on the host's clock: the same image, banks, scene and input give the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from struct import unpack_from

from eitskin.emulator.analog.ad9833 import Ad9833
from eitskin.emulator.analog.adg1206 import Multiplexers
from eitskin.emulator.analog.drive_monitor import DriveMonitor
from eitskin.emulator.analog.front_end import FrontEnd
from eitskin.emulator.analog.skin import AnalogSkin
from eitskin.emulator.bus import Bus, Peripheral
from eitskin.emulator.clocktime import TICKS_PER_S, BoardClock
from eitskin.emulator.cpu import Cpu, CpuStop
from eitskin.emulator.exceptions import Exceptions
from eitskin.emulator.memory import BANK_BYTES, BANKS, FLASH, PROGRAM_BYTES, Memories
from eitskin.emulator.peripherals import scb
from eitskin.emulator.peripherals.adc import Adc
from eitskin.emulator.peripherals.dma import Dma
from eitskin.emulator.peripherals.dwt import Dwt
from eitskin.emulator.peripherals.exti import Exti
from eitskin.emulator.peripherals.flash import FlashInterface
from eitskin.emulator.peripherals.gpio import ANALOG, GpioPort
from eitskin.emulator.peripherals.iwdg import Iwdg
from eitskin.emulator.peripherals.mpu import Mpu
from eitskin.emulator.peripherals.nvic import (
    BUS_FAULT,
    MEMORY_FAULT,
    NMI,
    SVCALL,
    USAGE_FAULT,
    Nvic,
)
from eitskin.emulator.peripherals.rcc import HSE_HZ, Pwr, Rcc
from eitskin.emulator.peripherals.scb import SystemSpace
from eitskin.emulator.peripherals.spi import Spi
from eitskin.emulator.peripherals.systick import SysTick
from eitskin.emulator.peripherals.tim import MASTERS, Timer
from eitskin.emulator.peripherals.usart import Usart
from eitskin.emulator.record import Record
from eitskin.emulator.report import BoardReport
from eitskin.emulator.schedule import Schedule
from eitskin.emulator.serial_line import SerialLine
from eitskin.errors import DeviceError

# the owner's settings (firmware/app/kept.h, two sectors of 256 KB)
PAGES, PAGES_BYTES, RECORD_BYTES, MAGIC = 0x08140000, 0x80000, 32, 0x54455345
LONGEST_SLICE = 5_000_000
EXACTLY_MASKED = 10_000
FSYNC_PIN, ENABLE_PIN, MCO_PIN, ADC_PIN, SENSE_PIN, BUTTON_PIN = 2, 12, 8, 3, 0, 13
SCK_PIN, MOSI_PIN, TX_PIN, RX_PIN = 10, 12, 8, 9
MCO_FUNCTION, SPI3_FUNCTION, USART3_FUNCTION = 0, 6, 7


class EmulatedBoard:
    """A NUCLEO-F767ZI with ``image`` at 0x08000000 and what ``banks`` hold at 0x08040000 and
    0x080C0000, before ``skin``.

    Power is on when it is made. ``hse_hz`` None: no 8 MHz come from the ST-LINK. What hangs outside
    the processor (``generator``, ``multiplexers``, ``front_end``, ``line``) and ``memories``
    outlive its resets.

    Raises:
        DeviceError: the image or a bank is too long, or Unicorn is a version that cannot be used.
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
        self.strict = True  # what the monitor finds is an error
        self._build(hse_hz)
        self._wire()
        self._reset_cause: str | None = "power"
        self._asleep = self.locked_up = False
        self._masked = 0  # slices since an interrupt waits behind a mask
        self._later: list[Callable[[], None]] = []

    # ---- construction ----

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
        own = (self.rcc, self.pwr, self.spi, self.adc, self.usart, self.flash, self.iwdg, self.exti)
        peripherals: list[Peripheral] = [
            *own,
            *self.ports.values(),
            *self.timers.values(),
            *self.dmas.values(),
        ]
        for peripheral in peripherals:
            self.bus.add(peripheral)
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
        ports["A"].mode_changed = self._mco
        ports["D"].watch = self._fsync
        ports["E"].watch = lambda at, driven, levels: self.multiplexers.set_addresses(
            at, levels & 0xFFFF
        )
        ports["F"].watch = lambda at, driven, levels: self.multiplexers.set_enables(
            at, levels >> ENABLE_PIN & 0xF
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

    # ---- from outside ----

    @property
    def now_s(self) -> float:
        """The board's time since power came first."""
        return self.clock.now_s

    def report(self) -> BoardReport:
        """What has happened so far."""
        record = self.record
        return BoardReport(
            time_s=self.now_s,
            asleep_s=record.asleep_ticks / TICKS_PER_S,
            instructions=record.instructions,
            generator_hz=self.generator.frequency_hz,
            mclk_hz=self.generator.mclk_hz,
            scans=self.skin.scans,
            samples=self.front_end.samples,
            switches=self.multiplexers.changes,
            violations=tuple(self.drive.violations),
            unknown_rows={str(row): count for row, count in self.skin.unknown_rows.items()},
            interrupts=dict(record.interrupts),
            unmodelled=dict(record.unmodelled),
            clock_off=dict(record.clock_off),
            hazards=dict(record.hazards),
            faults=tuple(record.faults),
            resets=tuple(record.resets),
        )

    def reset(self, cause: str) -> None:
        """Start the processor again before it executes another instruction: "pin", "software",
        "watchdog" or "power"."""
        self._reset_cause = cause
        self.cpu.end_slice()

    def lose_power(self) -> None:
        """Power goes and comes back: RAM and what is on the wire are lost, flash is not."""
        self.line.clear()
        self.reset("power")

    def lose_clock(self, hse_hz: int | None = None) -> None:
        """The ST-LINK's 8 MHz fail, or come back as ``hse_hz``."""
        self.rcc.set_hse(hse_hz)
        self.cpu.end_slice()

    def drop_supply(self, low: bool) -> None:
        """The supply falls below 2.9 V, not so far that RAM is lost, or is back."""
        self.pwr.low = low
        if low and self.pwr.values[0] >> 4 & 1:
            self.exti.supply_fell()
        self.cpu.end_slice()

    def hold_button(self, held: bool) -> None:
        """The owner holds the blue button (B1 lifts PC13), or lets go of it."""
        self.ports["C"].outside = 1 << BUTTON_PIN if held else 0

    def send(self, data: bytes) -> None:
        """The host sends ``data``: at 1 Mbaud from now on, or when what it sent before has left."""
        self.line.send(data)

    def receive(self) -> bytes:
        """What the host has received whole and not taken before."""
        self.usart.bring_up_to_date()
        return self.line.receive(self.clock.now)

    def bank(self, number: int) -> bytes:
        """What a model bank holds."""
        at = BANKS[number] - FLASH
        return self.memories.flash[at : at + BANK_BYTES]

    def run_until(self, until: int, enough: Callable[[], bool] = lambda: False) -> None:
        """Let time pass until ``until`` (ticks), or until ``enough`` says so; it is asked between
        slices.

        Raises:
            DeviceError: the processor has locked up and no watchdog will start it again.
        """
        clock, schedule = self.clock, self.schedule
        while True:
            schedule.run_due(clock.now)
            if self._reset_cause is not None:
                self._start_again(self._reset_cause)
            now = clock.now
            if now >= until or enough():
                self._judge()
                return
            due = min(schedule.next_at(), until)
            if self.locked_up:
                clock.skip_to(due)
            elif self._asleep and not self._wakes():
                self.record.asleep_ticks += max(due - now, 0)
                clock.skip_to(due)
            elif not self._take_exception():
                self._slice(due)

    def _judge(self) -> None:
        self.drive.look(self.clock.now)
        if self.strict and (found := self.drive.violations):
            raise DeviceError(
                f"the firmware did what it must never do, first at {found[0]} ({len(found)} times);"
                " no board should run this image"
            )

    def _keeps_drive(self) -> bool:
        """Whether the latest of the owner's settings lets current flow without a host."""
        latest, keeps = -1, False
        for at in range(PAGES, PAGES + PAGES_BYTES, RECORD_BYTES):
            magic, generation, settings = unpack_from("<III", self.memories.flash, at - FLASH)
            if magic == MAGIC and generation > latest:
                latest, keeps = generation, bool(settings & 1)
        return keeps

    # ---- the loop's parts ----

    def _start_again(self, cause: str) -> None:
        self.record.resets.append(cause)
        self.drive.start(self.clock.now)
        if cause == "power":
            self.memories.lose_power()
        self._reset_cause, self._asleep, self.locked_up = None, False, False
        self._later.clear()
        self.rcc.reset(cause)
        for one in (
            self.nvic,
            self.systick,
            self.mpu,
            self.dwt,
            self.scb,
            self.pwr,
            self.spi,
            self.usart,
            self.flash,
            self.iwdg,
            self.exti,
        ):
            one.reset()
        for timer in self.timers.values():
            timer.reset()
        self.adc.reset()
        self.adc.second.reset()
        for dma in self.dmas.values():
            dma.reset()
        self.multiplexers.release(self.clock.now)
        for port in self.ports.values():
            port.reset()
        self._mco()
        vectors = self.scb.vtor
        self.exceptions.reset(self.memories.word(vectors), self.memories.word(vectors + 4))

    def _wakes(self) -> bool:
        best = self.nvic.best()
        if best is None:
            return False
        primask = self.cpu.masks.read()[0]
        if primask & 1:  # what would be taken without PRIMASK wakes (B1.5.17)
            self._asleep = not self.nvic.urgency(best) < self.nvic.running_urgency()
        else:
            self._asleep = not self.nvic.urgency(best) < self.nvic.masked_urgency()
        return not self._asleep

    def _take_exception(self) -> bool:
        """Go into the most urgent exception that may be taken now; False: none."""
        if not self.nvic.pending & self.nvic.enabled:
            return False
        best = self.nvic.best()
        if best is None or self.nvic.urgency(best) >= self.nvic.masked_urgency():
            return False
        self._enter(best)
        return True

    def _enter(self, number: int, pc: int | None = None) -> None:
        handler = self.memories.word(self.scb.vtor + 4 * number)
        stacked = self.exceptions.enter(number, handler, thread=not self.nvic.active, pc=pc)
        self.nvic.enter(number)
        self.record.interrupts[number] += 1
        if not stacked or self.mpu.denies(self.exceptions.stack_pointer()):
            self._fault(MEMORY_FAULT, scb.MSTKERR, "stacking", None)

    def _slice(self, due: int) -> None:
        cycles = -(-(due - self.clock.now) // self.clock.cycle_ticks)
        cycles = max(min(cycles, LONGEST_SLICE), 1)
        if self.nvic.pending & self.nvic.enabled and self._only_masked():
            self._masked += 1  # it must be taken right after the mask is lifted (B1.5.1)
            cycles = min(cycles, max(self._masked - EXACTLY_MASKED, 1))
        else:
            self._masked = 0
        stop = self.cpu.run(cycles, due)
        while self._later:
            self._later.pop(0)()
        trespass = self.mpu.trespassed()
        if trespass is not None:
            self._fault(MEMORY_FAULT, scb.DACCVIOL, "store to a guarded region", trespass)
        elif stop is CpuStop.SLEEP:
            self._asleep = True
        elif stop is CpuStop.RETURN:
            self._return()
        elif stop is CpuStop.CALL:
            self.nvic.pend(SVCALL)
        elif stop is not CpuStop.COUNT:
            self._stopped_by(stop)

    def _only_masked(self) -> bool:
        best = self.nvic.best()
        return best is not None and self.nvic.urgency(best) < self.nvic.running_urgency()

    def _return(self) -> None:
        if not self.nvic.active or not self.exceptions.leave():
            self._fault(USAGE_FAULT, scb.INVPC, "return from an exception", None)
            return
        self.nvic.leave()

    def _stopped_by(self, stop: CpuStop) -> None:
        address = self.cpu.fault_address
        if stop in (CpuStop.READ_FAULT, CpuStop.WRITE_FAULT):
            if self.mpu.denies(address):
                self._fault(MEMORY_FAULT, scb.DACCVIOL, stop.name, address)
            else:
                self._fault(BUS_FAULT, scb.PRECISERR, stop.name, address)
        elif stop is CpuStop.FETCH_FAULT:
            denied = self.mpu.denies(address)
            self._fault(
                MEMORY_FAULT if denied else BUS_FAULT,
                scb.IACCVIOL if denied else scb.IBUSERR,
                stop.name,
                None,
            )
        else:
            self._fault(USAGE_FAULT, scb.UNDEFINSTR, stop.name, None)

    def _fault(self, number: int, status: int, what: str, address: int | None) -> None:
        pc = self.cpu.pc
        self.record.faults.append(
            f"{what} at pc 0x{pc:08X}" + ("" if address is None else f", address 0x{address:08X}")
        )
        taken = self.scb.fault(number, status, address)
        if taken is None:
            self.locked_up = True
            if not self.iwdg.running:
                raise DeviceError(
                    f"the emulated processor has locked up ({self.record.faults[-1]}) and no"
                    " watchdog runs; the firmware image is broken: build it again"
                )
        else:
            self._enter(taken, pc)
