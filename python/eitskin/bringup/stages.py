"""The stages of the bring-up: each measures what the ones before it have made sure of."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eitskin.bringup.findings import AskDone, AskNumber, Connect, Finding, StageReport
from eitskin.bringup.measuring import LEAST_V, Prober, Row, frequency_of, settled_us
from eitskin.bringup.predicted import (
    CODE_V,
    CONVERTER_BIAS_V,
    CONVERTER_GAIN,
    SETTLE_US,
    SOURCE_1K_V,
    SOURCE_10K_V,
    SOURCE_UA,
)
from eitskin.bringup.ring import (
    ELECTRODES,
    MULTIPLEXERS,
    decode,
    explain,
    levels_ohm,
    sweep_rows,
)
from eitskin.device.wire.link_table import FaultCode, Setting

RESISTOR_OHM = 1000.0  # of chain and ring
MOST_NOISE_CODES, MOST_SPAN_CODES = 3.0, 20
# of the predicted value; 1 % resistors and 0.1 % in the source
LEVEL_SHARE, RING_SHARE = 0.05, 0.06
LOAD_SHARE = 0.03  # of the source's current, lost on 10 kohm
SETTLED = 0.01
FIRST: Row = (0, 1, 0, 1)  # of the chain: over its 1 kohm
BEHIND: Row = (0, 2, 0, 1)  # the same, the current through 10 kohm too


@dataclass(frozen=True)
class Bench:
    """The instrument under test and the person at it."""

    probe: Prober
    connect: Connect
    number: AskNumber
    done: AskDone

    @property
    def full_v(self) -> float:
        """Predicted amplitude at the converter over 1 kohm, by the settings of the board."""
        info = self.probe.device.board
        gain = (info.gain or CONVERTER_GAIN) / CONVERTER_GAIN
        return SOURCE_1K_V * CONVERTER_GAIN * gain * (info.source_ua or SOURCE_UA) / SOURCE_UA


def supplies(bench: Bench) -> StageReport:
    """Supplies, the reference of the receiver, the owner's button."""
    bench.connect("nothing")
    report = StageReport("supplies")
    lost = FaultCode.ANALOG_SUPPLY in bench.probe.device.info().fault_codes
    wrong = "+15 V or -15 V is missing: look at the inlet J1 and its polarity" if lost else ""
    report.findings.append(
        Finding("supply-good input PC11", "missing" if lost else "good", "good", wrong)
    )
    level = bench.probe.level(None, generator=False)
    off_v = level.mean_v - CONVERTER_BIAS_V
    wrong = ""
    if abs(off_v) > 0.05:
        wrong = (
            "the receiver has no output: look at its +15 V and -15 V"
            if level.mean_v < 0.1 or level.mean_v > 3.2
            else "REF is not half of 3.3 V: look at R53, R54 and U11"
        )
    report.findings.append(Finding("mean at PA3", f"{level.mean_v:.3f} V", "1.650 V", wrong))
    report.findings.extend(_button(bench))
    return report


def _button(bench: Bench) -> list[Finding]:
    """Learn which level the button has while it is pressed."""
    device = bench.probe.device
    released = device.info().button
    if released > 1 or not bench.done("hold the blue button"):
        return []
    pressed = device.info().button
    bench.done("let go of the blue button")
    if pressed == released:
        return [Finding("blue button", "no change", "a change", "PC13 does not follow B1")]
    settings = Setting(device.board.settings)
    low = Setting.BUTTON_LOW if pressed == 0 else Setting(0)
    if settings & Setting.BUTTON_LOW != low:
        device.settings(settings ^ Setting.BUTTON_LOW)
    text = "pulls its pin low" if low else "lifts its pin"
    return [Finding("blue button", f"{text}; the board keeps that", "a change")]


def converter(bench: Bench) -> StageReport:
    """Noise and jitter with nothing connected and the generator in reset."""
    bench.connect("nothing")
    burst = bench.probe.burst(None, generator=False, samples=1000)
    noise = float(np.std(burst.codes))
    span = int(burst.codes.max() - burst.codes.min())
    bad = noise > MOST_NOISE_CODES or span > MOST_SPAN_CODES
    wrong = (
        "the converter is noisy: take analogue ground and 3.3 V from AGND and AVDD of the board,"
        " shorten the wire to PA3"
        if bad
        else ""
    )
    return StageReport(
        "converter",
        [
            Finding(
                "noise of the converter",
                f"{noise:.1f} codes rms, {span} from end to end",
                f"at most {MOST_NOISE_CODES:g} and {MOST_SPAN_CODES}",
                wrong,
            )
        ],
    )


def generator(bench: Bench) -> StageReport:
    """Frequency and purity over 1 kohm."""
    bench.connect("chain")
    probe = bench.probe
    burst = probe.burst(FIRST, samples=1000)
    size_v = CODE_V * float(np.std(burst.codes)) * 2**0.5
    expected = f"{probe.hz:.0f} Hz"
    if size_v < LEAST_V:
        wrong = (
            "no signal: look at the AD9833 (0.61 V from peak to peak at VOUT), its SPI lines PC10,"
            " PC12, PD2, and its MCLK from PA8; if that is right, at the source, and at EN and"
            " supplies of the multiplexers"
        )
        return StageReport("generator", [Finding("frequency", "no signal", expected, wrong)])
    found_hz = frequency_of(burst, probe.rate_hz)
    wrong = ""
    if abs(found_hz / probe.hz - 1) > 1e-3:
        wrong = (
            f"the generator's clock is {8 * found_hz / probe.hz:.3g} MHz and not 8: take the"
            " module's own oscillator off, and wire PA8 to MCLK"
        )
    findings = [Finding("frequency", f"{found_hz:.0f} Hz", expected, wrong)]
    if not wrong:
        level = probe.level(FIRST, samples=1000)
        share = level.rest_v / max(level.size_v, 1e-9)
        clipped = " or the gain is far too large" if level.clipped else ""
        wrong = f"not a sine: the filter U2{clipped}; look at VOUT" if share > 0.05 else ""
        findings.append(Finding("beside the sine", f"{100 * share:.1f} %", "below 5 %", wrong))
        if level.clipped:
            findings[-1] = Finding(
                "beside the sine", "clips", "below 5 %",
                "the receiver clips: the gain or the current is too large; look at R52 (R_G) and"
                " R13",
            )  # fmt: skip
    return StageReport("generator", findings)


def source(bench: Bench) -> StageReport:
    """Return whether the current depends on the load, and, where somebody measures it, its size."""
    bench.connect("chain")
    here, behind = bench.probe.level(FIRST), bench.probe.level(BEHIND)
    ratio = behind.size_v / max(here.size_v, 1e-9)
    wanted = SOURCE_10K_V / SOURCE_1K_V / 10
    wrong = ""
    if abs(ratio / wanted - 1) > LOAD_SHARE:
        out_ohm = 1e3 * max(11 * ratio - 1, 0.0) / max(1 - ratio, 1e-6)
        wrong = (
            f"the source's output impedance is about {out_ohm / 1e3:.0f} kohm instead of hundreds:"
            " look at R8 to R11 of the Howland source"
        )
    findings = [
        Finding("current into 11 kohm, of that into 1 kohm", f"{ratio:.3f}", f"{wanted:.3f}", wrong)
    ]
    across_v = bench.number(
        "amplitude over the 1 kohm between electrodes 0 and 1, in V, by an oscilloscope"
    )
    if across_v is not None:
        info = bench.probe.device.board
        predicted = SOURCE_1K_V * (info.source_ua or SOURCE_UA) / SOURCE_UA
        off = abs(across_v / predicted - 1) > LEVEL_SHARE
        wrong = (
            f"the source gives {1e3 * across_v:.3g} uA: look at R13, and at the gain of U3 (R6,"
            " R7); if that is meant,  eitskin board --source-ua"
            if off
            else ""
        )
        findings.append(
            Finding("amplitude over 1 kohm", f"{across_v:.3f} V", f"{predicted:.3f} V", wrong)
        )
    return StageReport("source", findings)


def amplifier(bench: Bench) -> StageReport:
    """Level at the converter, and how fast it settles."""
    bench.connect("chain")
    level = bench.probe.level(FIRST)
    ratio = level.size_v / bench.full_v
    wrong = ""
    if level.clipped or abs(ratio - 1) > LEVEL_SHARE:
        wrong = (
            f"the level is {ratio:.2f} of what is predicted. If the amplitude over the 1 kohm is"
            " 0.50 V, the gain is wrong: look at R52 (R_G) and R55; otherwise the source: R13"
        )
    findings = [
        Finding("amplitude at PA3", f"{level.size_v:.3f} V", f"{bench.full_v:.3f} V", wrong)
    ]
    burst = bench.probe.burst(FIRST, before=(1, 0, 0, 1), settle_us=1, samples=200)
    took_us = settled_us(burst, bench.probe.hz, bench.probe.rate_hz, SETTLED)
    allowed_us = bench.probe.device.board.settle_us + 1e6 / bench.probe.hz / 2
    wrong = (
        "the row settles slowly: look at C31, and for long or screened electrode wires"
        if took_us > allowed_us
        else ""
    )
    findings.append(
        Finding(
            "settled to 1 %", f"{took_us:.0f} us", f"{SETTLE_US} us, read by half periods", wrong
        )
    )
    return StageReport("amplifier", findings)


def multiplexers(bench: Bench) -> StageReport:
    """Find the electrode that each multiplexer joins at each address, by a ring of 1 kohm."""
    bench.connect("ring")
    probe, report = bench.probe, StageReport("multiplexers")
    expected = levels_ohm(1.0)
    reference = max(
        (probe.level(row) for row in ((15, 0, 15, 0), (9, 8, 9, 8))), key=lambda one: one.size_v
    )
    scale = 1 / bench.full_v
    turn = np.conj(reference.amplitude_v) / max(reference.size_v, 1e-9)
    for index, name in enumerate(MULTIPLEXERS):
        levels: list[float | None] = []
        for row in sweep_rows(index):
            if row is None:
                levels.append(None)
                continue
            seen = (probe.level(row).amplitude_v * turn).real
            levels.append(scale * seen * (-1 if index in (1, 3) else 1))
        nothing = all(level is None or abs(level) < 0.02 for level in levels)
        wrong = (
            f"{name} joins nothing: look at its EN, its supply and its D pin"
            if nothing
            else explain(name, decode(levels, 1 / ELECTRODES, expected))
        )
        report.findings.append(
            Finding(f"electrodes of {name}", "wrong" if wrong else "0 to 15", "0 to 15", wrong)
        )
    clear = [one for one in report.findings if one.wrong.startswith("A") or "nothing:" in one.wrong]
    if clear:  # the others follow from these
        return StageReport("multiplexers", clear)
    return report


def ring(bench: Bench) -> StageReport:
    """Each resistor of the ring: the wires of all electrodes."""
    bench.connect("ring")
    seen = [
        bench.probe.level((k, (k + 1) % ELECTRODES, k, (k + 1) % ELECTRODES))
        for k in range(ELECTRODES)
    ]
    levels = np.array([one.size_v for one in seen])
    usual = float(np.median(levels))
    predicted = 15 / 16 * bench.full_v
    findings = []
    for k in np.flatnonzero(np.abs(levels / usual - 1) > RING_SHARE):
        share = levels[k] / usual * 15 / 16
        ohm = RESISTOR_OHM * 15 * share / (15 - share) if share < 14.9 else float("inf")
        findings.append(
            Finding(
                f"resistor from electrode {k} to {(k + 1) % ELECTRODES}",
                f"{'more than ' if seen[k].clipped else ''}{ohm:.0f} ohm",
                f"{RESISTOR_OHM:.0f} ohm",
                f"look at the resistor and the wires of electrodes {k} and {(k + 1) % ELECTRODES}",
            )
        )
    wrong = (
        ""
        if abs(usual / predicted - 1) < 2 * LEVEL_SHARE
        else "all resistors differ: are they 1 kohm?"
    )
    findings.append(Finding("ring, median", f"{usual:.3f} V", f"{predicted:.3f} V", wrong))
    return StageReport("ring", findings)


MEASURED: dict[str, Callable[[Bench], StageReport]] = {
    "supplies": supplies,
    "converter": converter,
    "generator": generator,
    "source": source,
    "amplifier": amplifier,
    "multiplexers": multiplexers,
    "ring": ring,
}
