"""General-purpose timers that count up (RM0410 chapter 26), their counters as functions of time,
and the triggers between them.

Modelled: prescaler (loaded by updates), auto-reload (taken over at once, ARPE or not), one-pulse
    mode, update and compare 1
interrupts, TRGO from reset, enable, update, compare pulse and OC1REF (forced, PWM 1 and 2), slave
modes reset, gated and trigger by an internal trigger. A trigger arrives without the few clocks that
synchronisation takes on silicon.
"""

from collections.abc import Callable

import numpy as np

from eitskin.arrays import IntArray
from eitskin_emulator.clocktime import BoardClock, period_ticks
from eitskin_emulator.peripherals.nvic import Nvic
from eitskin_emulator.peripherals.rcc import Rcc
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record
from eitskin_emulator.schedule import NEVER, Event, Schedule

CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR = (4 * k for k in range(12))
CCR1 = 0x34
CEN, UDIS, URS, OPM = 1, 2, 4, 8
UIF, CC1IF, TIF = 1, 2, 1 << 6
ON_RESET, ON_ENABLE, ON_UPDATE, ON_COMPARE, ON_OC1REF = range(5)
SLAVE_RESET, SLAVE_GATED, SLAVE_TRIGGER = 4, 5, 6
FORCED_LOW, FORCED_HIGH, PWM1, PWM2 = 4, 5, 6, 7
# masters of TIMx by ITR number (RM0410 table 176); only those among TIM2 to TIM5
MASTERS = {2: {2: 3, 3: 4}, 3: {1: 2, 2: 5, 3: 4}, 4: {1: 2, 2: 3}, 5: {0: 2, 1: 3, 2: 4}}
IRQ = {2: 28, 3: 29, 4: 30, 5: 50}
RESET_VALUES = {
    **{
        CR1: 0,
        CR2: 0,
        SMCR: 0,
        DIER: 0,
        SR: 0,
        EGR: 0,
        CCMR1: 0,
        CCMR2: 0,
        CCER: 0,
        CNT: 0,
        PSC: 0,
        ARR: 0,
    },
    **{CCR1: 0, 0x38: 0, 0x3C: 0, 0x40: 0, 0x48: 0, 0x4C: 0, 0x50: 0},
}


class Timer(Registers):
    """TIM2 to TIM5. ``before_change`` is called with the time before the counter departs from its
    straight course."""

    def __init__(
        self,
        number: int,
        clock: BoardClock,
        schedule: Schedule,
        nvic: Nvic,
        rcc: Rcc,
        record: Record,
    ) -> None:
        super().__init__(record, RESET_VALUES)
        self.number, self.name = number, f"TIM{number}"
        self.base, self.gate = 0x40000000 + 0x400 * (number - 2), ("APB1ENR", number - 2)
        self._clock, self._schedule, self._nvic, self._rcc = clock, schedule, nvic, rcc
        self.top = 0xFFFFFFFF if number in (2, 5) else 0xFFFF
        self._event = Event(self._happens)
        self.before_change: Callable[[int], None] = lambda at: None
        self.after_change: Callable[[], None] = lambda: None
        self.slaves: list[Timer] = []
        self.masters: dict[int, Timer] = {}
        self._set_up()

    def reset(self) -> None:
        """As after a reset."""
        self.before_change(self._clock.now)
        self._schedule.set(self._event, None)
        self._set_up()
        self._nvic.set_line(IRQ[self.number], False)
        self.after_change()

    def _set_up(self) -> None:
        self.values = dict(self.reset_values)
        self.values[ARR] = self.top
        self._prescaler, self._step = 0, period_ticks(self._rcc.timer_hz(1))
        self._count = self._part = (
            0  # at the time _at: the counter, and ticks into its present value
        )
        self._at = self._clock.now
        self._gate_open = True
        self._level = False  # of TRGO, where it is a level

    # ---- the counter ----

    @property
    def counting(self) -> bool:
        """Return whether it runs."""
        return bool(self.values[CR1] & CEN) and self._gate_open

    def _now_counted(self, at: int) -> tuple[int, int, int]:
        """Counter, ticks into its value, and overflows since ``_at``, at the time ``at``."""
        if not self.counting:
            return self._count, self._part, 0
        steps, part = divmod(at - self._at + self._part, self._step)
        limit = self.values[ARR] + 1
        if self._count >= limit:  # it has passed ARR: goes on to the top first
            limit, start = self.top + 1, self._count
            if start + steps < limit:
                return start + steps, part, 0
            steps -= limit - start
            return steps % (self.values[ARR] + 1), part, steps // (self.values[ARR] + 1)
        wraps, count = divmod(self._count + steps, limit)
        return count, part, wraps

    def _fold(self, at: int) -> None:
        self.before_change(at)
        before = self._count
        self._count, self._part, wraps = self._now_counted(at)
        compare = self.values[CCR1]
        if wraps:
            self.values[SR] |= UIF
        if (
            wraps > 1
            or (before < compare <= self._count)
            or (wraps and (compare > before or compare <= self._count))
        ):
            self.values[SR] |= CC1IF
        self._at = at

    def _reaches(self, value: int) -> int:
        """When the counter next takes ``value``, from the folded state; NEVER if it does not."""
        limit = self.values[ARR] + 1
        if not self.counting or value >= limit:
            return NEVER
        away = (
            value - self._count if self._count >= limit else (value - self._count) % limit or limit
        )
        if away <= 0:
            away += self.top + 1
        return self._at - self._part + away * self._step

    def update_times(self, after: int, until: int) -> IntArray:
        """Times of updates (.,), later than ``after`` and not later than ``until``, on the present
        course."""
        first = self._reaches(0)
        if first > until:
            return np.zeros(0, dtype=np.int64)
        period = (self.values[ARR] + 1) * self._step
        if first <= after:
            first += ((after - first) // period + 1) * period
        return np.arange(first, until + 1, period, dtype=np.int64)

    def update_after(self, after: int, number: int) -> int:
        """When the ``number``-th update after ``after`` (1: the next) takes place if nothing
        changes; NEVER if none does."""
        first = self._reaches(0)
        if first == NEVER:
            return NEVER
        period = (self.values[ARR] + 1) * self._step
        if first <= after:
            first += ((after - first) // period + 1) * period
        return first + (number - 1) * period

    # ---- triggers ----

    @property
    def _master_mode(self) -> int:
        return self.values[CR2] >> 4 & 7

    @property
    def drives_converter(self) -> bool:
        """TRGO are its updates."""
        return self._master_mode == ON_UPDATE

    @property
    def _slave_mode(self) -> int:
        return self.values[SMCR] & 7 | (self.values[SMCR] >> 16 & 1) << 3

    def _listens_to(self) -> "Timer | None":
        if not self._slave_mode:
            return None
        master = self.masters.get(self.values[SMCR] >> 4 & 7)
        if master is None:
            self.unmodelled("a trigger from elsewhere")
        return master

    def trigger(self, at: int, level: bool, pulse: bool) -> None:
        """The chosen trigger has gone to ``level``; a ``pulse`` rises and falls again."""
        mode = self._slave_mode
        if mode == SLAVE_GATED:
            if level != self._gate_open:
                self._change(at, lambda: setattr(self, "_gate_open", level))
        elif level or pulse:
            if mode == SLAVE_TRIGGER and not self.values[CR1] & CEN:
                self._change(at, self._enable)
            elif mode == SLAVE_RESET:
                self._change(at, self._restart)
            elif mode not in (SLAVE_TRIGGER, SLAVE_RESET):
                self.unmodelled(f"slave mode {mode}")
        if level or pulse:
            self.values[SR] |= TIF

    def _enable(self) -> None:
        self.values[CR1] |= CEN

    def _restart(self) -> None:
        self._count = self._part = 0
        self._load_prescaler()

    def _load_prescaler(self) -> None:
        self._prescaler = self.values[PSC]
        self._step = period_ticks(self._rcc.timer_hz(1)) * (self._prescaler + 1)

    def _oc1ref(self) -> bool:
        mode = self.values[CCMR1] >> 4 & 7 | (self.values[CCMR1] >> 16 & 1) << 3
        if mode in (PWM1, PWM2):
            return (self._count < self.values[CCR1]) == (mode == PWM1)
        if mode not in (0, FORCED_LOW, FORCED_HIGH):
            self.unmodelled(f"output compare mode {mode}")
        return mode == FORCED_HIGH

    def _give(self, at: int, level: bool, pulse: bool = False) -> None:
        for slave in self.slaves:
            if slave._slave_mode and slave.masters.get(slave.values[SMCR] >> 4 & 7) is self:
                slave.trigger(at, level, pulse)

    # ---- changes and events ----

    def clock_changes(self) -> None:
        """Called before its clock has another frequency."""
        self._fold(self._clock.now)

    def clock_changed(self) -> None:
        """Called after."""
        self._step = period_ticks(self._rcc.timer_hz(1)) * (self._prescaler + 1)
        self._part = 0
        self._plan()

    def _change(self, at: int, change: Callable[[], None]) -> None:
        self._fold(at)
        change()
        self._settle(at)

    def _settle(self, at: int) -> None:
        """After a change: TRGO's level, the next event, the interrupt's line, whoever follows the
        updates."""
        mode = self._master_mode
        level = self._oc1ref() if mode == ON_OC1REF else mode == ON_ENABLE and self.counting
        if level != self._level:
            self._level = level
            self._give(at, level)
        self._plan()
        self.after_change()

    def _plan(self) -> None:
        soonest = NEVER
        heard = any(
            slave._slave_mode and slave.masters.get(slave.values[SMCR] >> 4 & 7) is self
            for slave in self.slaves
        )
        enabled = self.values[DIER]
        if (
            enabled & UIF
            or self.values[CR1] & OPM
            or (heard and self._master_mode in (ON_UPDATE, ON_OC1REF))
        ):
            soonest = self._reaches(0)
        if enabled & CC1IF or (heard and self._master_mode in (ON_COMPARE, ON_OC1REF)):
            soonest = min(soonest, self._reaches(self.values[CCR1]))
        self._schedule.set(self._event, None if soonest == NEVER else soonest)
        self._nvic.set_line(IRQ[self.number], bool(self.values[SR] & enabled & (UIF | CC1IF)))

    def _happens(self, at: int) -> None:
        self._fold(at)
        if self._count == 0 and self._part == 0:
            if self.values[PSC] != self._prescaler:
                self._load_prescaler()
            if self.values[CR1] & OPM:
                self.values[CR1] &= ~CEN
            if self._master_mode == ON_UPDATE:
                self._give(at, False, pulse=True)
        if self._count == self.values[CCR1] and self._part == 0 and self._master_mode == ON_COMPARE:
            self._give(at, False, pulse=True)
        self._settle(at)

    # ---- registers ----

    def read(self, offset: int, size: int) -> int:
        if offset == CNT:
            return self._now_counted(self._clock.now)[0]
        if offset == SR:
            self._fold(self._clock.now)
        return super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        at = self._clock.now
        self._fold(at)
        if offset == CNT:
            self._count = value & self.top
        elif offset == SR:
            self.values[SR] &= value
        elif offset == EGR:
            if value & ~1:
                self.unmodelled("EGR beyond UG")
            if value & 1:
                self._restart()
                if not self.values[CR1] & (UDIS | URS):
                    self.values[SR] |= UIF
                if self._master_mode in (ON_RESET, ON_UPDATE):
                    self._give(at, False, pulse=True)
        elif offset in (PSC, ARR):
            super().write(offset, size, value & (0xFFFF if offset == PSC else self.top))
        else:
            if offset == CR1 and value & ~(CEN | UDIS | URS | OPM | 1 << 7):
                self.unmodelled("CR1: counting down or centred, or a divided filter clock")
            if offset == CR2 and value >> 4 & 7 > ON_OC1REF:
                self.unmodelled("TRGO from OC2REF to OC4REF")
            super().write(offset, size, value)
            if offset == SMCR:
                master = self._listens_to()
                self._gate_open = self._slave_mode != SLAVE_GATED or (
                    master is not None and master._level
                )
                if master is not None:
                    master._plan_anew()
        self._settle(at)

    def _plan_anew(self) -> None:
        self._fold(self._clock.now)
        self._plan()
