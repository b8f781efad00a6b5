"""The emulated board: its parts, and the loop that lets time pass.

The loop executes slices that end where the next event is due, takes exceptions between them, and
skips to the next event when the processor sleeps. While nothing but PRIMASK, BASEPRI or FAULTMASK
holds an interrupt back, slices are single instructions, and longer and longer only where that lasts
for over ten thousand: a program that hangs with interrupts off must end too. Nothing in it depends
on the host's clock: the same image, banks, scene and input give the same bytes.
"""

from collections.abc import Callable

from eitskin.errors import DeviceError
from eitskin_emulator.board_parts import BoardParts
from eitskin_emulator.clocktime import TICKS_PER_S
from eitskin_emulator.cpu import CpuStop
from eitskin_emulator.memory import BANK_BYTES, BANKS, FLASH
from eitskin_emulator.peripherals import scb
from eitskin_emulator.peripherals.nvic import BUS_FAULT, MEMORY_FAULT, SVCALL, USAGE_FAULT
from eitskin_emulator.report import BoardReport

LONGEST_SLICE = 5_000_000
EXACTLY_MASKED = 10_000
BUTTON_PIN, SUPPLY_PIN = 13, 11


class EmulatedBoard(BoardParts):
    """:class:`BoardParts` that run; power is on when it is made."""

    strict = True  # what the monitor finds is an error
    locked_up = False
    button_low = False
    _asleep = False
    _masked = 0  # slices since an interrupt waits behind a mask

    @property
    def now_s(self) -> float:
        """The board's time since power came first."""
        return self.clock.now_s

    def report(self) -> BoardReport:
        """Return a report of everything so far."""
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

    def lose_power(self) -> None:
        """Switch the power off and on: RAM and the bytes on the wire are lost, flash is not."""
        self.line.clear()
        self.reset("power")

    def lose_clock(self, hse_hz: int | None = None) -> None:
        """The ST-LINK's 8 MHz fail, or come back as ``hse_hz``."""
        self.rcc.set_hse(hse_hz)
        self.cpu.end_slice()

    def drop_supply(self, low: bool) -> None:
        """Let the supply fall below 2.9 V, but not so far that RAM is lost, or bring it back."""
        self.pwr.low = low
        if low and self.pwr.values[0] >> 4 & 1:
            self.exti.supply_fell()
        self.cpu.end_slice()

    def hold_button(self, held: bool) -> None:
        """The owner holds the blue button (B1 lifts PC13, or where ``button_low`` pulls it low), or
        lets go of it."""
        lifted = held != self.button_low
        self.ports["C"].outside = 1 << BUTTON_PIN if lifted else 0

    def lose_analog(self, lost: bool) -> None:
        """The +-15 V go, and with them the light of the supply-good circuit (PC11), or come
        back."""
        self.front_end.supplied = not lost
        self.ports["C"].lowered = 1 << SUPPLY_PIN if lost else 0

    def halt(self, time_s: float) -> None:
        """Halt the processor as a debugger does, for the given time. Everything else continues,
        except the peripherals that the program has configured to stop (DBGMCU)."""
        until = self.clock.now + round(time_s * TICKS_PER_S)
        if self.debug.stops_watchdog:
            self.iwdg.hold(until - self.clock.now)
        while self.clock.now < until:
            self.clock.skip_to(min(self.schedule.next_at(), until))
            self.schedule.run_due(self.clock.now)

    def send(self, data: bytes) -> None:
        """Send ``data`` from the host at 1 Mbaud, from now on or after the bytes that it sent
        before."""
        self.line.send(data)

    def receive(self) -> bytes:
        """Return the bytes that the host has received completely and not taken before."""
        self.usart.bring_up_to_date()
        return self.line.receive(self.clock.now)

    def bank(self, number: int) -> bytes:
        """Return the content of a model bank."""
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

    # ---- the loop's parts ----

    def _start_again(self, cause: str) -> None:
        self.record.resets.append(cause)
        self.drive.start(self.clock.now)
        if cause == "power":
            self.memories.lose_power()
            self.debug.values = dict(self.debug.reset_values)
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
        vector = self.scb.vtor + 4 * number
        thread = not self.nvic.active
        stacked = self.exceptions.enter(number, vector, thread=thread, pc=pc)
        self.nvic.enter(number)
        self.record.interrupts[number] += 1
        if not stacked or self.mpu.denies(self.exceptions.stack_pointer()):
            self._fault(MEMORY_FAULT, scb.MSTKERR, "stacking", None)

    def _slice(self, due: int) -> None:
        cycles = -(-(due - self.clock.now) // self.clock.instruction_ticks)
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
