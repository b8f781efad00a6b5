"""The board's capture where the emulated board seldom takes it: late interrupts, failed transfers,
overruns, refused settings."""

import struct
from pathlib import Path

import pytest
from bare_image import CALLBACK, DMA2, SCRATCH, BareImage

TIM3, TIM5, ADC1 = 0x40000400, 0x40000C00, 0x40012000
NOW, TIM5_CCR1, TIM3_CR1, TIM3_SMCR = TIM5 + 0x24, TIM5 + 0x34, TIM3, TIM3 + 8
ADC_SR, ADC_CR2 = ADC1, ADC1 + 8
LISR, CR, NDTR, M0AR, M1AR = DMA2, DMA2 + 0x10, DMA2 + 0x14, DMA2 + 0x1C, DMA2 + 0x20
TEIF, TCIF, CT, EN, OVR = 1 << 3, 1 << 5, 1 << 19, 1, 1 << 5
RANGE = -5
SAMPLES, SLOT_US, BURST_US = 80, 100, 80
Burst = tuple[int, int, int, bool]


class Capture:
    """The capture of a fresh image, started at the time ``now``."""

    def __init__(
        self, elf: Path, now: int = 1000, rate: int = 1_000_000, slot_us: int = SLOT_US
    ) -> None:
        self.image = BareImage(elf)
        self.bursts: list[Burst] = []
        self.image.on_callback = self._told
        self.image.call("nucleo_capture_start")
        self.image.write(NOW, now)
        assert self.configure(rate, SAMPLES, slot_us) == 0
        assert self.image.call(self.image.operation("nucleo_capture_ops", 1), 0) == 0
        self.first = (self.image.read(TIM5_CCR1) + 1) % 2**32

    def configure(self, rate: int, samples: int, slot_us: int) -> int:
        self.image.write_bytes(SCRATCH, struct.pack("<III", rate, samples, slot_us))
        return self.image.call(
            self.image.operation("nucleo_capture_ops", 0), 0, SCRATCH, CALLBACK | 1, 77
        )

    def stop(self) -> None:
        self.image.call(self.image.operation("nucleo_capture_ops", 2), 0)

    def _told(self, user: int, burst: int) -> None:
        assert user == 77
        samples, start, entered, lost = struct.unpack("<IIIB", self.image.read_bytes(burst, 13))
        buffers = self.image.symbols["buffers"]
        self.bursts.append((start, entered, (samples - buffers) // 2048, bool(lost)))

    def interrupt(self, slots_done: int, now: int, flags: int = TCIF) -> list[Burst]:
        """The DMA interrupt at ``now``, after ``slots_done`` bursts since the start; what it
        reported."""
        image, self.bursts = self.image, []
        image.write(NOW, now)
        image.write(CR, (image.read(CR) & ~CT) | (CT if slots_done % 2 else 0))
        image.write(LISR, image.read(LISR) | flags)
        image.call("nucleo_dma2_stream0_irq")
        assert image.read(LISR) == 0, "a flag is left"
        return self.bursts


def test_start_arms_everything(elf):
    capture = Capture(elf, now=5000)
    image = capture.image
    assert capture.first - 5000 >= 20
    assert image.read(NDTR) == SAMPLES and image.read(CR) & EN
    assert image.read(M0AR) == image.symbols["buffers"]
    assert image.read(M1AR) == image.symbols["buffers"] + 2048
    assert image.read(TIM3_SMCR) == 0x26  # trigger mode, ITR2
    assert image.read(TIM3 + 0x2C) == SLOT_US - 1 and image.read(TIM3 + 0x34) == BURST_US


def test_bursts_in_time_alternate_between_the_buffers(elf):
    capture = Capture(elf)
    for slot in range(7):
        start = capture.first + SLOT_US * slot
        entered = start + BURST_US + 3
        assert capture.interrupt(slot + 1, entered) == [(start, entered, slot % 2, False)]


@pytest.mark.parametrize("now", [1000, 2**32 - 250])
@pytest.mark.parametrize("missed", range(6))
@pytest.mark.parametrize("late_us", [-1, 0, 4, 40, 97])
def test_a_late_interrupt_tells_each_slot_once_and_only_the_last_is_whole(
    elf, now, missed, late_us
):
    capture = Capture(elf, now=now)
    slot = 0
    for skipped in (0, missed, 0, missed):
        last = slot + skipped
        entered = (capture.first + SLOT_US * last + BURST_US + late_us) % 2**32
        reported = capture.interrupt(last + 1, entered)
        starts = [(capture.first + SLOT_US * k) % 2**32 for k in range(slot, last + 1)]
        assert [start for start, *_ in reported] == starts
        assert {one for _, one, *_ in reported} == {entered}
        assert [lost for *_, lost in reported] == [True] * skipped + [False]
        assert reported[-1][2] == last % 2
        slot = last + 1


@pytest.mark.parametrize("late_us", [-49, 0, 60])
def test_at_a_slow_rate_too_where_a_burst_ends_before_its_last_period(elf, late_us):
    capture = Capture(elf, rate=10_000, slot_us=8100)
    reported = capture.interrupt(2, capture.first + 8100 + 8000 + late_us)
    found = [(start - capture.first, lost) for start, _, _, lost in reported]
    assert found == [(0, True), (8100, False)]


def test_where_clock_and_buffer_disagree_the_buffer_is_believed(elf):
    capture = Capture(elf)
    reported = capture.interrupt(2, capture.first + BURST_US + 1)
    assert [lost for *_, lost in reported] == [True, False] and reported[-1][2] == 1


@pytest.mark.parametrize("cause", ["transfer error", "overrun"])
def test_a_failure_is_told_and_the_scan_goes_on_in_the_same_grid(elf, cause):
    capture = Capture(elf)
    image = capture.image
    capture.interrupt(1, capture.first + BURST_US)
    capture.bursts, now = [], capture.first + SLOT_US + 35
    if cause == "overrun":
        image.write(NOW, now)
        image.write(ADC_SR, OVR)
        image.call("nucleo_adc_irq")
        assert image.read(ADC_SR) == 0
    else:
        capture.interrupt(1, now, TEIF)
    ((start, entered, _, lost),) = capture.bursts
    next_start = image.read(TIM5_CCR1) + 1
    assert start == capture.first + SLOT_US and entered == now and lost
    assert next_start >= now + 20 and (next_start - capture.first) % SLOT_US == 0
    assert image.read(CR) & EN
    assert image.read(ADC_CR2) & 1
    reported = capture.interrupt(1, next_start + BURST_US)
    assert reported == [(next_start, next_start + BURST_US, 0, False)]


@pytest.mark.parametrize(
    ("status", "running"), [(1 << 1, True), (OVR, False)], ids=["no overrun", "after stop"]
)
def test_an_interrupt_of_the_converter_that_tells_nothing(elf, status, running):
    """An overrun after stop is cleared: it would interrupt for ever."""
    capture = Capture(elf)
    if not running:
        capture.stop()
    capture.image.write(ADC_SR, status)
    capture.image.call("nucleo_adc_irq")
    assert capture.bursts == [] and (running or capture.image.read(ADC_SR) == 0)


def test_after_stop_nothing_is_told(elf):
    capture = Capture(elf)
    capture.stop()
    assert capture.interrupt(1, capture.first + BURST_US) == []
    assert not capture.image.read(CR) & EN and not capture.image.read(TIM3_CR1)
    assert not capture.image.read(TIM3_SMCR) & 7


@pytest.mark.parametrize(
    ("rate", "samples", "slot_us", "status"),
    [
        (1_000_000, 80, 100, 0),
        (500_000, 80, 170, 0),
        (1_500_000, 90, 70, 0),
        (10_000, 100, 10_100, 0),
        (0, 80, 100, RANGE),
        (800_000, 80, 110, RANGE),  # 27 MHz is not a multiple of it
        (1_800_000, 90, 70, RANGE),  # faster than the converter
        (900_000, 80, 100, RANGE),  # the burst is not a whole number of microseconds
        (1_000_000, 0, 100, RANGE),
        (1_000_000, 1025, 2000, RANGE),
        (1_000_000, 80, 80, RANGE),  # no time between bursts
        (1_000_000, 80, 65_537, RANGE),
    ],
)
def test_settings(elf, rate, samples, slot_us, status):
    capture = Capture(elf)
    capture.stop()
    assert capture.configure(rate, samples, slot_us) == status


def test_no_settings_while_it_runs(elf):
    assert Capture(elf).configure(1_000_000, 80, 100) == -1
