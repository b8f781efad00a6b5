"""The energy of a frame, estimated: data sheets' typical currents, times of the
measured trade-off.

While frames follow each other, everything analog is on, and the processor runs for solve and
touches and sleeps (WFI) for the rest of the scan. Where fewer frames are asked for, three ways to
wait are compared: as the firmware does, with processor and generator stopped, and with the analog
supply switched off too.
"""

from dataclasses import dataclass
from typing import Any

from eitskin.tuning.front import Conditions, Front, OperatingPoint, load_front
from eitskin_studies.harness.sections import Filling, Tabular, text_table

KEPT_MIOU = 0.84
RATES_HZ = (10.0, 1.0)
SETTLE_MS = 5.0  # after the analog supply or the generator is switched on
BIPOLAR_EFFICIENCY = 0.75  # of the isolated +-15 V supply
RAILS = {3.3: "3.3 V", 15.0: "+15 V", 30.0: "±15 V"}


@dataclass(frozen=True)
class Part:
    """``number`` of a part at ``volts``: typical ``active_ma`` each, and ``asleep_ma`` where it can
    be told to sleep, by the data sheet ``source``. ``bipolar``: from the +-15 V supply."""

    name: str
    number: int
    volts: float
    active_ma: float
    asleep_ma: float | None = None
    source: str = ""

    @property
    def bipolar(self) -> bool:
        return self.volts > 5

    def mw(self, asleep: bool = False) -> float:
        """The power of all of them, in mW, at the input of their supply."""
        current = self.asleep_ma if asleep and self.asleep_ma is not None else self.active_ma
        power = self.number * self.volts * current
        return power / BIPOLAR_EFFICIENCY if self.bipolar else power


RUNNING = Part(
    "STM32F767, running from flash at 216 MHz", 1, 3.3, 110.0, 25.0, "ST DS11532, supply current"
)
STOPPED_MW = 3.3 * 0.5
ALWAYS = (
    Part("STM32F767's ADC", 1, 3.3, 1.6, 0.0, "ST DS11532, ADC"),
    Part("AD9833", 1, 3.3, 4.5, 0.5, "Analog Devices AD9833; a draft of it: 20 mW at 3 V"),
    Part("OPA320 (reference)", 1, 3.3, 1.45, None, "TI SBOS513"),
    Part("OPA828 (filter, gain, source)", 3, 30.0, 5.5, None, "TI SBOS671"),
    Part("AD8421 (receiver)", 1, 30.0, 2.0, None, "Analog Devices AD8421"),
    Part("ADG1206, logic at 3.3 V", 4, 15.0, 0.26, None, "Analog Devices ADG1206"),
    Part("current into the skin, 0.5 mA amplitude", 1, 15.0, 0.32, 0.0, "mean of a half-wave"),
)


@dataclass(frozen=True)
class PointEnergy:
    """A point's ``miou``, ``rate_hz`` frame after frame, and mJ a frame of the processor and of
    all."""

    name: str
    scan: str
    miou: float
    rate_hz: float
    scan_ms: float
    solve_ms: float
    processor_mj: float
    frame_mj: float


def measuring_mw() -> float:
    """All parts but the processor."""
    return sum(one.mw() for one in ALWAYS)


def energy_of(point: OperatingPoint, where: Conditions) -> PointEnergy | None:
    """None if accuracy or instructions were not measured, or the board does not hold it."""
    solve_us, miou = point.cost("us", "f767", where), point.accuracy(where)
    if solve_us is None or miou is None or not point.fits_f767:
        return None
    scan_ms, solve_ms = point.costs["acquisition_us"] / 1e3, solve_us / 1e3
    period_ms = max(scan_ms, solve_ms)
    processor = RUNNING.mw() * solve_ms + RUNNING.mw(asleep=True) * (period_ms - solve_ms)
    whole = processor + measuring_mw() * period_ms
    one = point.configuration
    return PointEnergy(
        point.name, f"{one.scan}, {one.samples} samples", miou, 1e3 / period_ms, scan_ms, solve_ms,
        processor / 1e3, whole / 1e3,
    )  # fmt: skip


def waiting_mw() -> dict[str, float]:
    """Between frames, by how the board waits."""
    stopped = STOPPED_MW + sum(one.mw(asleep=True) for one in ALWAYS)
    bipolar = sum(one.mw(asleep=True) for one in ALWAYS if one.bipolar)
    return {
        "as the firmware (WFI)": RUNNING.mw(asleep=True) + measuring_mw(),
        "processor, ADC, generator stopped": stopped,
        "analog supply off, too": stopped - bipolar,
    }


def mean_mw(one: PointEnergy, rate_hz: float, waiting: float) -> float:
    """Return the mean power at ``rate_hz`` if each frame is measured, and then solved while the
    analog side already waits."""
    active_ms = one.scan_ms + SETTLE_MS
    measured = (measuring_mw() + RUNNING.mw(asleep=True)) * active_ms
    solved = (RUNNING.mw() + max(waiting - RUNNING.mw(asleep=True), 0)) * one.solve_ms
    rest_ms = 1e3 / rate_hz - active_ms - one.solve_ms
    return rate_hz * (measured + solved + waiting * rest_ms) / 1e3


@dataclass(frozen=True)
class EnergyResult:
    """All points that the board holds, by energy a frame; the cheapest that keeps ``KEPT_MIOU``."""

    points: tuple[PointEnergy, ...]

    @property
    def cheapest(self) -> PointEnergy:
        """The first point that keeps the accuracy."""
        return next(one for one in self.points if one.miou >= KEPT_MIOU)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "points": [vars(one) for one in self.points],
            "cheapest": self.cheapest.name,
            "measuring_mw": measuring_mw(),
            "waiting_mw": waiting_mw(),
        }


def run(front: Front | None = None) -> EnergyResult:
    """From the shipped results of ``eitskin tradeoff run``, or ``front``."""
    where = Conditions()
    reported = (energy_of(point, where) for point in (front or load_front()).points)
    return EnergyResult(
        tuple(sorted((one for one in reported if one is not None), key=lambda one: one.frame_mj))
    )


def on_the_front(result: EnergyResult) -> list[PointEnergy]:
    """Points that none cheaper beats."""
    shown: list[PointEnergy] = []
    for one in result.points:
        if not shown or one.miou > shown[-1].miou:
            shown.append(one)
    return shown


def parts_table() -> Tabular:
    """Each part's power."""
    rows = [
        (
            f"{one.number} {one.name}" if one.number > 1 else one.name,
            f"{one.active_ma:g} at {RAILS[one.volts]}",
            one.source,
            f"{one.mw():.0f}",
            "-" if one.asleep_ma is None else f"{one.mw(asleep=True):.0f}",
        )
        for one in (RUNNING, *ALWAYS)
    ]
    rows[0] = (*rows[0][:-1], f"{rows[0][-1]} (WFI), {STOPPED_MW:.0f} (stop)")
    return ("part", "each, mA", "data sheet", "active, mW", "asleep, mW"), rows


def points_table(result: EnergyResult) -> Tabular:
    """The front by energy a frame."""
    head = (
        "point", "scan", "image MIoU", "frames a second", "processor, mJ a frame",
        "all, mJ a frame", "mean, W",
    )  # fmt: skip
    rows = [
        (
            one.name, one.scan, f"{one.miou:.3f}".removeprefix("0"), f"{one.rate_hz:.0f}",
            f"{one.processor_mj:.1f}", f"{one.frame_mj:.1f}",
            f"{one.frame_mj * one.rate_hz / 1e3:.2f}",
        )
        for one in on_the_front(result)
    ]  # fmt: skip
    return head, rows


def sleep_table(result: EnergyResult) -> Tabular:
    """The cheapest point at fewer frames per second, by how the board waits."""
    one = result.cheapest
    rows = []
    for name, waiting in waiting_mw().items():
        means = [mean_mw(one, rate, waiting) for rate in RATES_HZ]
        rows.append((name, f"{waiting:.0f}", *(f"{mean:.0f}" for mean in means)))
    rates = (f"{rate:g} frames a second, mW" for rate in RATES_HZ)
    return ("between frames", "waiting, mW", *rates), rows


def summary(result: EnergyResult) -> str:
    """In words."""
    one = result.cheapest
    analog = sum(part.mw() for part in ALWAYS if part.bipolar)
    return (
        f"By `eitskin bench energy` from the points of [the trade-off](tradeoff.md). All parts but"
        f" the processor take {measuring_mw():.0f} mW, {100 * analog / measuring_mw():.0f} % of it"
        f" from ±15 V. The cheapest point with an image MIoU of .84 is *{one.name}* ({one.scan}):"
        f" at {one.rate_hz:.0f} frames per second it takes {one.frame_mj:.1f} mJ per frame, and"
        f" {one.processor_mj:.1f} mJ of this is the processor's."
    )


def as_text(result: EnergyResult) -> str:
    """For a terminal."""
    tables = (parts_table(), points_table(result), sleep_table(result))
    return "\n\n".join([summary(result), *(text_table(*table) for table in tables)])


def for_page(result: EnergyResult) -> Filling:
    """The marks of studies/results/board-cost.md."""
    return {"energy-run": summary(result)}, {
        "energy-parts": parts_table(),
        "energy": points_table(result),
        "energy-sleep": sleep_table(result),
    }
