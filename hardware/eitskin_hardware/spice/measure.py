"""Everything that the pages say of the analog circuit, measured on the deck.

``measure_all`` returns the numbers of ``hardware/made/results.json``. "before" is the circuit as
the page described it before it was simulated.
"""

from functools import cache

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.homogeneous import voltages_of
from eitskin.frames.homogeneous_fem import transfer_by_elements
from eitskin.skin.skin import paper_skin
from eitskin_hardware.circuit.design import Design
from eitskin_hardware.circuit.instrument import instrument
from eitskin_hardware.spice.bench import Bench, Switching
from eitskin_hardware.spice.elements import SINE_V, Conditions
from eitskin_hardware.spice.receive import (
    APERTURE_S,
    SAMPLE_S,
    SAMPLES,
    STEPS,
    codes,
    demodulated,
    sampler,
)
from eitskin_hardware.spice.skins import Load, pair_load, ring_load, skin_load

CURRENT_A = 0.5e-3
GAIN = 3.0
MODEL_PER_CONVERTER = 1 / 1.5  # a volt of a model for 1 mA is 1.5 V at the converter
ROWS = tuple((0, 1, k, k + 1) for k in range(2, 15))  # the rows of one drive, adjacent
SETTLE_S = 16e-6
SKIN_OHM = 19_000.0  # the paper's skin between neighbours, multiplexers included
PIN_OHM = 30.0  # of the processor's outputs, typical
Numbers = dict[str, float]


def as_before() -> Design:
    """Return the circuit as the page had it before: four equal resistors of the source without a
    buffer, a grounded return, no servo, no resistors in the logic lines, 1 uF in series, R_G 4.99
    kohm."""
    design = instrument().without("U13", "U14", "R16", "R17", "C41", "R18", "U5", "C15", "R15")
    design = design.rewired("R11", **{"2": "SOURCE"}).rewired("R60", **{"1": "AGND"})
    design = design.rewired("R5", **{"2": "AGND"}).rewired("R7", **{"2": "AGND"})
    design = design.with_value("C14", "1u").with_value("R52", "4.99k")
    for number in range(20, 40):
        design = design.with_value(f"R{number}", "0")
    return design


def loaded(design: Design, ohm: float, **settings: object) -> Bench:
    """Return a bench with a resistor from the source's output to ground, no multiplexer on."""
    return Bench(design, extra=(f"RLOAD drive 0 {ohm:g}",), **settings)  # type: ignore[arg-type]


def into(design: Design, ohm: float) -> float:
    """Return the amplitude that the source makes at a resistor to ground."""
    return abs(loaded(design, ohm).phasors("v(drive)")["v(drive)"])


def generator(design: Design) -> Numbers:
    """Amplitudes from the sine to the source's input, and the filter."""
    bench = Bench(design)
    names = ("v(sine)", "v(smooth)", "v(drive_v)")
    at = bench.phasors(*names)
    image = bench.phasors("v(smooth)", frequency_hz=7.95e6)["v(smooth)"]
    return {
        "sine_pp_v": 2 * abs(at["v(sine)"]),
        "drive_v": abs(at["v(drive_v)"]),
        "filter_corner_hz": corner_hz(bench, "v(smooth)", SINE_V),
        "filter_image_db": 20 * np.log10(SINE_V / abs(image)),
    }


def corner_hz(bench: Bench, name: str, full: float, start_hz: float = 1e4) -> float:
    """Return the frequency where ``name`` falls to 0.707 of ``full``."""
    low, high = start_hz, 3e6
    for _ in range(14):
        middle = float(np.sqrt(low * high))
        if abs(bench.phasors(name, frequency_hz=middle)[name]) > full / np.sqrt(2):
            low = middle
        else:
            high = middle
    return float(np.sqrt(low * high))


def output_ohm(design: Design) -> float:
    """Return the source's output impedance at 50 kHz: what a volt at its output draws."""
    quiet = design.rewired("U1", MCLK="NOWHERE")
    bench = Bench(quiet, extra=("VTEST source 0 ac 1",))
    current = bench.phasors("i(vtest)")["i(vtest)"]
    return 1 / abs(current)


def worst_tolerance(design: Design, tolerance: float = 1e-3) -> list[Design]:
    """Return the two worst cases of the source's resistors."""
    cases = []
    for side in (1, -1):
        case = design
        for ref, sign in (("R8", 1), ("R9", -1), ("R10", 1), ("R11", -1)):
            case = case.with_value(ref, f"{10e3 * (1 + side * sign * tolerance):.3f}")
        cases.append(case)
    return cases


def reach_v(design: Design) -> float:
    """Return the greatest amplitude at the source's output at which the current is within 1 % of
    the linear one."""
    low, high = 1e3, 60e3
    while high / low > 1.03:
        ohm = float(np.sqrt(low * high))
        if tone_v(design, ohm) > 0.99 * into(design, ohm):
            low = ohm
        else:
            high = ohm
    return tone_v(design, low)


def tone_v(design: Design, ohm: float) -> float:
    """Return the amplitude at 50 kHz into a resistor to ground, with all limits."""
    course = loaded(design, ohm).course(("v(drive)",), 180e-6, 100e-9, 80e-6)
    times = np.arange(100e-6, 180e-6, 1e-6)
    return abs(demodulated(np.interp(times, course[:, 0], course[:, 1]), times[0]))


def source(design: Design) -> Numbers:
    """The source by load, its output impedance and reach, and its direct voltage."""
    offsets = Conditions(offset_v=3e-3)
    worst = [output_ohm(case) for case in worst_tolerance(design)]
    return {
        "source_1k_v": into(design, 1e3),
        "source_10k_v": into(design, 10e3),
        "source_skin_v": into(design, SKIN_OHM),
        "source_output_ohm": output_ohm(design),
        "source_output_worst_ohm": min(worst),
        "source_reach_v": reach_v(design),
        "source_dc_v": abs(Bench(design, conditions=offsets).levels("v(source)")["v(source)"]),
    }


def servo_s(design: Design) -> float:
    """Return the time in which a step of the mean falls to 1/e, with the paper's skin connected."""
    quiet = design.rewired("U1", MCLK="NOWHERE")
    step = "ISTEP 0 source pwl(0 0 1m 0 1.01m 1u)"
    bench = Bench(quiet, skin_load(), (0, 1, 2, 3), extra=(step,))
    course = bench.course(("v(source)",), 0.25, 50e-6)
    time, v = course[:, 0] - 1e-3, course[:, 1]
    peak = int(np.argmax(v))
    below = np.nonzero(v[peak:] < v[peak] / np.e)[0]
    return float(time[peak + below[0]] - time[peak]) if len(below) else np.inf


def rows_of(design: Design, load: Load, frequency_hz: float = 50_000.0) -> FloatArray:
    """Return the complex amplitudes at the converter of all rows of one drive, (13,)."""
    conditions = Conditions(frequency_hz=frequency_hz)
    bench = Bench(design, load, conditions=conditions)
    return np.array([
        bench.with_row(row).phasors("v(converter)", frequency_hz=frequency_hz)["v(converter)"]
        for row in ROWS
    ])  # fmt: skip


@cache
def ideal_rows() -> FloatArray:
    """Return the amplitudes at the converter by the model, (13,), of the paper's skin."""
    return voltages_of(transfer_by_elements(paper_skin()), np.array(ROWS)) * CURRENT_A * GAIN


def against_model(rows: FloatArray) -> tuple[float, float, float]:
    """Compare the paper's rows with the model, as ``against`` does."""
    return against(ideal_rows(), rows)


def against(ideal: FloatArray, rows: FloatArray) -> tuple[float, float, float]:
    """Compare rows with what they should be: the scale after the turn of the whole frame by one
    angle, which is what the firmware does; the greatest deviation of a row's in-phase part from it,
    relative to that row; and the spread of phases in degrees."""
    turn = np.vdot(ideal, rows)
    phase = np.angle(rows / ideal / turn, deg=True)
    in_phase = np.real(rows * np.conj(turn) / abs(turn)) / ideal
    scale = float(np.median(in_phase))
    return scale, float(np.abs(in_phase / scale - 1).max()), float(np.ptp(phase))


def receiver(design: Design) -> Numbers:
    """Gain, filter and common mode of the receiver."""
    bench = Bench(design, pair_load(1e3), (0, 1, 0, 1))
    names = ("v(vplus,vminus)", "v(received)", "v(converter)")
    at = bench.phasors(*names)
    across = abs(at["v(vplus,vminus)"])
    grounded = design.without("R60")
    both = Bench(grounded, pair_load(19e3), (0, 1, 0, 0), extra=("RRET return 0 1m",))
    common = both.phasors("v(vplus)", "v(converter)")
    # A source before R55 in place of the amplifier: the filter alone
    alone = Bench(design.rewired("U10", OUT="NOWHERE"), extra=("VIN received 0 dc 1.65 ac 1",))
    bias = bench.levels("v(converter)")["v(converter)"]
    limited = Bench(design.rewired("U10", OUT="NOWHERE"), extra=("VIN received 0 dc 13",))
    return {
        "receiver_gain": abs(at["v(received)"]) / across,
        "converter_gain": abs(at["v(converter)"]) / across,
        "receiver_1k_in_v": across,
        "receiver_1k_v": abs(at["v(converter)"]),
        "converter_bias_v": bias,
        "receiver_corner_hz": (corner := corner_hz(alone, "v(converter)", 1.0)),
        "receiver_settle_s": float(np.log(2 * STEPS)) / (2 * np.pi * corner),
        "common_mode_db": 20 * np.log10(
            abs(common["v(vplus)"]) / (abs(common["v(converter)"]) / GAIN)
        ),
        "clamped_v": limited.levels("v(converter)")["v(converter)"],
    }  # fmt: skip


def skin_numbers(design: Design) -> Numbers:
    """The paper's skin at the electrodes and at the converter, with cables and contacts."""
    found: Numbers = {}
    for picofarad in (0, 60, 150):
        rows = rows_of(design, skin_load().with_cable(picofarad * 1e-12))
        scale, error, _ = against_model(rows)
        found |= {
            f"skin_{picofarad}pf_v": float(np.abs(rows).max()),
            f"skin_{picofarad}pf_phase_deg": float(np.angle(np.vdot(ideal_rows(), rows), deg=True)),
            f"skin_{picofarad}pf_scale": scale,
            f"skin_{picofarad}pf_error": error,
        }
    turned = found["skin_0pf_phase_deg"]
    for picofarad in (60, 150):
        found[f"skin_{picofarad}pf_turn_deg"] = found.pop(f"skin_{picofarad}pf_phase_deg") - turned
    slow = rows_of(design, skin_load().with_cable(60e-12), 10_000.0)
    found["skin_60pf_10khz_error"] = against_model(slow)[1]
    drive = Bench(design, skin_load(), (0, 1, 2, 3)).phasors("v(drive)", "v(vplus)", "v(vminus)")
    found["skin_drive_v"] = abs(drive["v(drive)"])
    found["skin_common_mode_v"] = abs(drive["v(vplus)"] + drive["v(vminus)"]) / 2
    contacts = np.full(16, 1e-3)
    contacts[2] = 1000.0
    one = rows_of(design, skin_load().with_contacts(contacts).with_cable(60e-12))
    even = rows_of(design, skin_load().with_cable(60e-12))
    found["contact_1k_phase_deg"] = float(np.abs(np.angle(one / even, deg=True)).max())
    found["skin_model_v"] = found["skin_0pf_v"] * MODEL_PER_CONVERTER
    for name, ohm in (("2k2", 2200.0), ("10k", 10_000.0)):
        ring = rows_of(design, ring_load(ohm))
        ideal = np.full(len(ROWS), ohm / 16 * CURRENT_A * GAIN)
        found[f"ring_{name}_v"] = float(np.abs(ring).mean()) * MODEL_PER_CONVERTER
        found[f"ring_{name}_error"] = against(ideal, ring)[1]
    return found


def settling_error(design: Design, load: Load, settle_s: float = SETTLE_S) -> float:
    """Return the error of the first row of another drive that is sampled ``settle_s`` after the
    switch, relative to the greatest row, by the converter's own samples but without its steps."""
    at_s = 100e-6 + 7.3e-6  # anywhere in a period
    first_s = np.ceil((at_s + settle_s) / SAMPLE_S) * SAMPLE_S
    bench = Bench(design, load, (15, 0, 2, 3), extra=sampler(), then=Switching((0, 1, 2, 3), at_s))
    later_s = first_s + 200e-6
    course = bench.course(("v(held)",), later_s + (SAMPLES + 2) * SAMPLE_S, 25e-9)
    early, late = (demodulated(held(course, start), start) for start in (first_s, later_s))
    return abs(early - late) / abs(late)


def held(course: FloatArray, start_s: float) -> FloatArray:
    """Return the held voltages without the converter's steps."""
    at = start_s + SAMPLE_S * np.arange(SAMPLES) + 0.4 * (SAMPLE_S - APERTURE_S)
    return np.asarray(np.interp(at, course[:, 0], course[:, 1]))


def time_numbers(design: Design) -> Numbers:
    """Settling and demodulation."""
    skin = skin_load()
    contacts = np.full(16, 8.5e3)
    found = {
        "settling_error": settling_error(design, skin),
        "settling_error_8k5_60pf": settling_error(
            design, skin.with_contacts(contacts).with_cable(60e-12)
        ),
        "servo_s": servo_s(design),
    }
    bench = Bench(design, skin, (0, 1, 2, 3), extra=sampler())
    start_s = 200e-6
    course = bench.course(("v(held)",), start_s + (SAMPLES + 2) * SAMPLE_S, 20e-9)
    exact = demodulated(held(course, start_s), start_s)
    rounded = demodulated(codes(course, start_s), start_s) * 3.3 / 4096
    linear = bench.phasors("v(converter)")["v(converter)"]
    found["demodulation_error"] = abs(rounded - exact) / abs(exact)
    found["sampling_error"] = abs(abs(exact) / abs(linear) - 1)
    return found


def supply_numbers(design: Design) -> Numbers:
    """The supply-good input, and the logic lines when +-15 V are missing."""
    lines = [wire for wire in design["A1"].net if wire.startswith(("PE", "PF"))]
    high = tuple(
        line
        for pin in lines
        for line in (f"V{pin} {pin}_v 0 3.3", f"RV{pin} {pin}_v {pin.lower()} {PIN_OHM:g}")
    )
    dead = Bench(design, plus_v=0.0, minus_v=0.0, conditions=Conditions(body=True), extra=high)
    wanted = [f"i(v{pin})" for pin in lines]
    measured = dead.levels(*wanted, "v(supply_good)")
    currents = [-measured[name] for name in wanted]

    def good(plus_v: float | None, minus_v: float | None) -> float:
        return Bench(design, plus_v=plus_v, minus_v=minus_v).levels("v(supply_good)")[
            "v(supply_good)"
        ]

    return {
        "dead_line_a": max(currents),
        "dead_total_a": sum(currents),
        "supply_good_v": good(15.0, -15.0),
        "supply_lost_v": measured["v(supply_good)"],
        "supply_lost_minus_v": good(15.0, None),
        "supply_lost_plus_v": good(None, -15.0),
        "supply_12v_v": good(12.0, -12.0),
    }


def measure_before() -> Numbers:
    """Return the numbers of the circuit as it was described, rounded to six digits."""
    design = as_before()
    numbers = source(design)
    numbers |= {key: value for key, value in receiver(design).items() if key != "clamped_v"}
    dead = supply_numbers(design)
    numbers |= {key: dead[key] for key in ("dead_line_a", "dead_total_a")}
    drive = Bench(design, skin_load(), (0, 1, 2, 3)).phasors("v(vplus)", "v(vminus)")
    numbers["skin_common_mode_v"] = abs(drive["v(vplus)"] + drive["v(vminus)"]) / 2
    numbers["skin_0pf_error"] = against_model(rows_of(design, skin_load()))[1]
    return rounded({f"before_{key}": value for key, value in numbers.items()})


def measure_now() -> Numbers:
    """Return the numbers of the circuit as it is, rounded to six digits."""
    design = instrument()
    numbers: Numbers = {}
    for measure in (generator, source, receiver, skin_numbers, time_numbers, supply_numbers):
        numbers |= measure(design)
    return rounded(numbers)


def measure_all() -> Numbers:
    """Return every number, rounded to six digits."""
    return measure_now() | measure_before()


def rounded(numbers: Numbers) -> Numbers:
    """Return the numbers with six digits."""
    return {key: float(f"{value:.6g}") for key, value in numbers.items()}
