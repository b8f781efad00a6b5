"""The stages of bring-up on the deck: the measurements of each, their expected values, and the
stage that finds a mistake."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.homogeneous import resistor_ring, voltages_of
from eitskin.frames.homogeneous_fem import transfer_by_elements
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.skin import Skin, paper_skin
from eitskin_hardware.circuit.design import Design
from eitskin_hardware.circuit.instrument import instrument
from eitskin_hardware.spice.bench import Bench, Row
from eitskin_hardware.spice.measure import CURRENT_A, GAIN, MODEL_PER_CONVERTER, against
from eitskin_hardware.spice.skins import Load, pair_load, ring_load, skin_load

RING_OHM = 2200.0
CODE_V = 3.3 / 4096
PAIRS = (0, 1, 2, 4, 8)  # neighbours of these numbers use each address line
DRIVES = (0, 9)


def dish() -> Skin:
    """Return the dish of docs/guide/build-a-skin.md: 10 mm of tap water."""
    electrodes = Electrodes(count=16, width_mm=8.0)
    return Skin("dish", disk(194.0), electrodes, conductivity_s_per_m=0.05, thickness_mm=10.0)


@dataclass(frozen=True, eq=False)
class Setup:
    """An instrument on the bench: its circuit, its supplies, and what is connected to it later."""

    design: Design
    plus_v: float | None
    minus_v: float | None
    ring: Load
    dish: Load
    gel: Load

    def bench(self, load: Load | None = None, row: Row | None = None, *extra: str) -> Bench:
        """Return the bench with a load."""
        return Bench(self.design, load, row, self.plus_v, self.minus_v, extra=extra)


@cache
def right() -> Setup:
    """Return the instrument without a mistake."""
    return Setup(instrument(), 15.0, -15.0, ring_load(RING_OHM), skin_load(dish()), skin_load())


@dataclass(frozen=True)
class Reading:
    """A value that is measured: ``least`` to ``greatest`` passes."""

    what: str
    value: float
    unit: str
    least: float
    greatest: float

    @property
    def passes(self) -> bool:
        """Return whether it is as it should be."""
        return self.least <= self.value <= self.greatest


def _about(what: str, value: float, should: float, unit: str, share: float = 0.03) -> Reading:
    spread = abs(should) * share
    return Reading(what, value, unit, should - spread, should + spread)


def supplies(setup: Setup) -> Iterator[Reading]:
    """Supplies, REF and the supply-good input."""
    names = ("v(p_15v)", "v(m_15v)", "v(ref)", "v(supply_good)")
    plus, minus, ref, good = setup.bench().levels(*names).values()
    yield _about("+15 V at U6 pin 1", plus, 15.0, "V", 0.05)
    yield _about("-15 V at U6 pin 27", minus, -15.0, "V", 0.05)
    yield _about("REF, U11 pin 1", ref, 1.65, "V", 0.01)
    yield Reading("PC11, CN8-8", good, "V", 2.31, 3.3)


def generator(setup: Setup) -> Iterator[Reading]:
    """The sine, its filter, and the amplified sine."""
    at = setup.bench().phasors("v(sine)", "v(smooth)", "v(drive_v)")
    yield _about("VOUT of the AD9833, peak to peak", 2 * abs(at["v(sine)"]), 0.612, "V", 0.05)
    yield _about(
        "behind the filter, U2 pin 6, peak to peak", 2 * abs(at["v(smooth)"]), 0.613, "V", 0.05
    )
    yield _about("behind the gain, U3 pin 6, amplitude", abs(at["v(drive_v)"]), 1.0, "V", 0.05)


def source(setup: Setup) -> Iterator[Reading]:
    """The source into resistors between its output and ground, and the mirrored voltage."""
    for ohm, should in ((1e3, 0.499), (10e3, 4.93)):
        v = setup.bench(None, None, f"RLOAD drive 0 {ohm:g}").phasors("v(drive)")["v(drive)"]
        yield _about(f"{ohm / 1e3:g} kΩ from C14 to AGND, amplitude", abs(v), should, "V")
    at = setup.bench(None, None, "RLOAD drive 0 10k").phasors("v(mirror)", "v(source)")
    ratio = float(np.real(at["v(mirror)"] / at["v(source)"]))
    yield _about("return over source, U14 pin 6 over U13 pin 3", ratio, -1.0, "")
    mean = setup.bench().levels("v(source)")["v(source)"]
    yield Reading("mean at the source, U13 pin 3", mean, "V", -0.02, 0.02)


def multiplexers(setup: Setup) -> Iterator[Reading]:
    """1 kohm between two neighbours, driven and measured there."""
    for k in PAIRS:
        bench = setup.bench(pair_load(1e3, k, k + 1), (k, k + 1, k, k + 1))
        v = bench.phasors("v(vplus,vminus)")["v(vplus,vminus)"]
        yield _about(
            f"1 kΩ between electrodes {k} and {k + 1}, V+ to V-, amplitude", abs(v), 0.499, "V"
        )


def amplifier(setup: Setup) -> Iterator[Reading]:
    """The receiver, with 1 kohm between electrodes 0 and 1."""
    bench = setup.bench(pair_load(1e3), (0, 1, 0, 1))
    at = bench.phasors("v(vplus,vminus)", "v(received)")
    gain = float(np.real(at["v(received)"] / at["v(vplus,vminus)"]))
    yield _about("gain from V+, V- to U10 pin 7", gain, 3.03, "")
    yield _about("mean at U10 pin 7", bench.levels("v(received)")["v(received)"], 1.65, "V", 0.02)


def converter(setup: Setup) -> Iterator[Reading]:
    """The same resistor, in the converter's codes."""
    bench = setup.bench(pair_load(1e3), (0, 1, 0, 1))
    amplitude = abs(bench.phasors("v(converter)")["v(converter)"]) / CODE_V
    mean = bench.levels("v(converter)")["v(converter)"] / CODE_V
    yield _about("amplitude of the codes", amplitude, 1857.0, "")
    yield _about("mean of the codes", mean, 2048.0, "", 0.02)


def ring(setup: Setup) -> Iterator[Reading]:
    """Sixteen resistors in a ring; each electrode drives and measures."""
    should = float(
        abs(voltages_of(resistor_ring(16, RING_OHM).transfer_ohm, np.array([(0, 1, 8, 9)]))[0])
    )
    for k in range(16):
        row = (k, (k + 1) % 16, (k + 8) % 16, (k + 9) % 16)
        v = setup.bench(setup.ring, row).phasors("v(converter)")["v(converter)"]
        volts = abs(v) * MODEL_PER_CONVERTER
        yield _about(f"row {row}, the model's volts", volts, should * 1e-3, "V", 0.05)


def _skin(load: Load, skin: Skin, setup: Setup, share: float) -> Iterator[Reading]:
    transfer = transfer_by_elements(skin)
    for drive in DRIVES:
        other = (drive + 1) % 16
        rows = [(drive, other, (drive + k) % 16, (drive + k + 1) % 16) for k in range(2, 15, 3)]
        measured, across = [], 0j
        for row in rows:
            at = setup.bench(load, row).phasors("v(converter)", "v(drive,return)")
            measured.append(at["v(converter)"])
            across = at["v(drive,return)"]
        ideal = voltages_of(transfer, np.array(rows)) * CURRENT_A * GAIN
        scale, worst, _ = against(ideal, _as_array(measured))
        yield _about(
            f"level of the rows that drive {drive} and {other}, of the model's", scale, 1.0, "", 0.1
        )
        yield Reading(
            f"greatest deviation of a row that drives {drive} and {other} from that level",
            worst,
            "",
            0.0,
            share,
        )
        pair = np.array([(drive, other, drive, other)])
        should = (voltages_of(transfer, pair)[0] + 240.0) * CURRENT_A
        yield _about(
            f"from I+ to I- while {drive} and {other} are driven, amplitude",
            abs(across),
            should,
            "V",
            0.08,
        )


def _as_array(values: list[complex]) -> FloatArray:
    return np.asarray(values)


def in_dish(setup: Setup) -> Iterator[Reading]:
    """Water in the dish."""
    return _skin(setup.dish, dish(), setup, 0.05)


def in_gel(setup: Setup) -> Iterator[Reading]:
    """The gel."""
    return _skin(setup.gel, paper_skin(), setup, 0.05)


STAGES: dict[str, Callable[[Setup], Iterator[Reading]]] = {
    "supplies": supplies,
    "generator": generator,
    "source": source,
    "multiplexers": multiplexers,
    "amplifier": amplifier,
    "converter": converter,
    "ring": ring,
    "dish": in_dish,
    "gel": in_gel,
}


@dataclass(frozen=True)
class Named:
    """The stage that finds something wrong, and the reading that shows it."""

    stage: str
    reading: Reading


def first_wrong(setup: Setup) -> Named | None:
    """Go through the stages, as a maker does, and return the first reading that is wrong."""
    for stage, readings in STAGES.items():
        for reading in readings(setup):
            if not reading.passes:
                return Named(stage, reading)
    return None


@dataclass(frozen=True)
class Mistake:
    """A mistake of a maker, and the stage that must name it."""

    what: str
    make: Callable[[Setup], Setup]
    stage: str


def _wired(change: Callable[[Design], Design]) -> Callable[[Setup], Setup]:
    return lambda setup: replace(setup, design=change(setup.design))


def _exchanged(load: Load, i: int, j: int) -> Load:
    order = np.arange(len(load.siemens))
    order[[i, j]] = order[[j, i]]
    return replace(load, siemens=load.siemens[np.ix_(order, order)])


def _contact(load: Load, electrode: int, ohm: float) -> Load:
    contacts = load.contact_ohm.copy()
    contacts[electrode] = ohm
    return load.with_contacts(contacts)


def _bridged(load: Load, i: int, j: int) -> Load:
    siemens = load.siemens.copy()
    siemens[i, j] = siemens[j, i] = 1.0
    return replace(load, siemens=siemens)


MISTAKES = (
    Mistake("-15 V is not connected", lambda s: replace(s, minus_v=None), "supplies"),
    Mistake("the divider of REF does not reach AVDD", _wired(lambda d: d.rewired("R53", **{"1": "OPEN"})), "supplies"),
    Mistake("MCLK is not connected", _wired(lambda d: d.rewired("U1", MCLK="OPEN")), "generator"),
    Mistake("C7 is 47 nF, not 470 pF", _wired(lambda d: d.with_value("C7", "47n")), "generator"),
    Mistake("R6 is 22.6 kΩ, not 2.26 kΩ", _wired(lambda d: d.with_value("R6", "22.6k")), "generator"),
    Mistake("R13 is 20 kΩ, not 2 kΩ", _wired(lambda d: d.with_value("R13", "20k")), "source"),
    Mistake("R11 is 1 kΩ, not 10 kΩ", _wired(lambda d: d.with_value("R11", "1k")), "source"),
    Mistake("R17 is 1 kΩ, not 10 kΩ: the return is not driven", _wired(lambda d: d.with_value("R17", "1k")), "source"),
    Mistake("A0 and A1 of I+ are exchanged", _wired(lambda d: d.rewired("U6", A0="IP_A1", A1="IP_A0")), "multiplexers"),
    Mistake("EN of V+ is not connected", _wired(lambda d: d.rewired("U8", EN="OPEN")), "multiplexers"),
    Mistake("electrodes 2 and 3 are exchanged at V-", _wired(lambda d: d.rewired("U9", S3="E3", S4="E2")), "multiplexers"),
    Mistake("R52 (R_G) is 48.7 kΩ, not 4.87 kΩ", _wired(lambda d: d.with_value("R52", "48.7k")), "amplifier"),
    Mistake("V+ and V- are exchanged at the AD8421", _wired(lambda d: d.rewired("U10", IN_P="VMINUS", IN_N="VPLUS")), "amplifier"),
    Mistake("C31 is 47 nF, not 470 pF", _wired(lambda d: d.with_value("C31", "47n")), "converter"),
    Mistake("the wire of electrode 5 is broken", lambda s: replace(s, ring=_contact(s.ring, 5, 1e9)), "ring"),
    Mistake("the wires of electrodes 3 and 4 are exchanged", lambda s: replace(s, ring=_exchanged(s.ring, 3, 4)), "ring"),
    Mistake("solder bridges electrodes 7 and 8", lambda s: replace(s, ring=_bridged(s.ring, 7, 8)), "ring"),
    Mistake("the dish has half of the water", lambda s: replace(s, dish=replace(s.dish, siemens=s.dish.siemens / 2)), "dish"),
    Mistake("the cables to the gel have 60 pF each", lambda s: replace(s, gel=s.gel.with_cable(60e-12)), "gel"),
    Mistake("the gel has drawn back from electrode 9: 5 kΩ more", lambda s: replace(s, gel=_contact(s.gel, 9, 5e3)), "gel"),
)  # fmt: skip


def stage_table() -> str:
    """Return the page of what each stage shows, and which stage names which mistake."""
    text = [
        "# Readings of bring-up",
        "",
        "`eitskin hardware make` wrote this page for [bring-up](../../docs/guide/bring-up.md). Each"
        " reading is simulated on the circuit without a mistake; the stage passes between the"
        " bounds. Amplitudes are half of what an oscilloscope shows from peak to peak.",
        "",
        "| stage | reading | simulated | least | greatest |",
        f"|{5 * '---|'}",
    ]
    for stage, readings in STAGES.items():
        for reading in readings(right()):
            value, least, greatest = (
                f"{number:.4g}" for number in (reading.value, reading.least, reading.greatest)
            )
            text.append(
                f"| {stage} | {reading.what} | {value} {reading.unit} | {least} | {greatest} |"
            )
    text += [
        "",
        "## Mistakes",
        "",
        "Each mistake is made in the circuit or at the skin, and the stages are gone through in"
        " their order on the simulated instrument. The first wrong reading names it.",
        "",
        "| mistake | stage that names it | reading | shows | should be |",
        f"|{5 * '---|'}",
    ]
    for mistake in MISTAKES:
        named = first_wrong(mistake.make(right()))
        if named is None:
            text.append(f"| {mistake.what} | none | | | |")
            continue
        reading = named.reading
        text.append(
            f"| {mistake.what} | {named.stage} | {reading.what} | {reading.value:.3g}"
            f" {reading.unit} | {reading.least:.3g} to {reading.greatest:.3g} |"
        )
    return "\n".join(text) + "\n"
