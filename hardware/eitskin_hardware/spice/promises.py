"""The promises of docs/guide/hardware.md: the page's former text, and the results of the
simulation."""

import re
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Promise:
    """A number of the page. ``before`` is the page's old text, ``key`` the number in the results,
    ``shown`` how the page prints it; the circuit as it was has ``before_`` + key where that was
    simulated."""

    what: str
    before: str
    key: str
    shown: str
    scale: float = 1.0

    def text(self, numbers: Mapping[str, float]) -> str:
        """Return the number as the page prints it."""
        return self.shown.format(numbers[self.key] * self.scale)

    def text_before(self, numbers: Mapping[str, float]) -> str:
        """Return what the simulation says of the circuit as it was, empty if it was not asked."""
        key = f"before_{self.key}"
        return self.shown.format(numbers[key] * self.scale) if key in numbers else ""


PROMISES = (
    Promise("AD9833 at VOUT, from peak to peak", "0.6 V", "sine_pp_v", "{:.2f} V"),
    Promise("corner of the generator's filter", "200 kHz, from no parts listed", "filter_corner_hz", "{:.0f} kHz", 1e-3),
    Promise("images at 8 MHz weakened by", "60 dB and more", "filter_image_db", "{:.0f} dB"),
    Promise("amplitude at the source's input", "1.0 V", "drive_v", "{:.2f} V"),
    Promise("source into 1 kΩ", "0.5 V", "source_1k_v", "{:.2f} V"),
    Promise("source into 10 kΩ", "5.0 V", "source_10k_v", "{:.2f} V"),
    Promise("source into 19 kΩ, as the prebuilt skin", "9.5 V", "source_skin_v", "{:.2f} V"),
    Promise("output impedance of the source at 50 kHz", "assumed: hundreds of kΩ", "source_output_ohm", "{:.0f} kΩ", 1e-3),
    Promise("the same with 0.1 % resistors at their worst", "", "source_output_worst_ohm", "{:.0f} kΩ", 1e-3),
    Promise("greatest amplitude at the source's output", "12 V", "source_reach_v", "{:.1f} V"),
    Promise("mean of the source's output, amplifiers 3 mV off", "below 10 mV", "source_dc_v", "{:.0f} mV", 1e3),
    Promise("time constant of that mean", "1 s, where the firmware waits 40 ms", "servo_s", "{:.0f} ms", 1e3),
    Promise("amplitude at I+ on the prebuilt skin", "9.5 V", "skin_drive_v", "{:.1f} V"),
    Promise("common mode at the receiver, first row", "up to 4.5 V", "skin_common_mode_v", "{:.1f} V"),
    Promise("rejection of common mode at 50 kHz", "", "common_mode_db", "{:.0f} dB"),
    Promise("gain of the receiver", "2.98", "receiver_gain", "{:.2f}"),
    Promise("gain from electrodes to converter at 50 kHz", "3", "converter_gain", "{:.2f}"),
    Promise("corner of the receiver's filter", "339 kHz", "receiver_corner_hz", "{:.0f} kHz", 1e-3),
    Promise("a step settles to half a bit within", "4.3 µs", "receiver_settle_s", "{:.1f} µs", 1e6),
    Promise("mean at the converter", "1.65 V", "converter_bias_v", "{:.2f} V"),
    Promise("1 kΩ through the multiplexers, at the receiver", "0.5 V", "receiver_1k_in_v", "{:.2f} V"),
    Promise("1 kΩ through the multiplexers, at the converter", "1.5 V", "receiver_1k_v", "{:.2f} V"),
    Promise("PA3 when the receiver is at its limit", "", "clamped_v", "{:.1f} V"),
    Promise("greatest row of the prebuilt skin, in the model's volts", "0.80 V", "skin_model_v", "{:.2f} V"),
    Promise("rows of the prebuilt skin against the model, no cable", "equal", "skin_0pf_error", "{:.1f} %", 1e2),
    Promise("the same with 60 pF of cable", "equal", "skin_60pf_error", "{:.0f} %", 1e2),
    Promise("the same with 150 pF", "equal", "skin_150pf_error", "{:.0f} %", 1e2),
    Promise("the same with 60 pF at 10 kHz", "equal", "skin_60pf_10khz_error", "{:.1f} %", 1e2),
    Promise("level of the rows with 60 pF, of the model's", "1", "skin_60pf_scale", "{:.2f}"),
    Promise("level with 150 pF", "1", "skin_150pf_scale", "{:.2f}"),
    Promise("all rows turned by 60 pF", "", "skin_60pf_turn_deg", "{:.0f}°"),
    Promise("all rows turned by 150 pF", "", "skin_150pf_turn_deg", "{:.0f}°"),
    Promise("phase of a row with a contact 1 kΩ worse, 60 pF", "", "contact_1k_phase_deg", "{:.1f}°"),
    Promise("a ring of 2.2 kΩ, each row in the model's volts", "0.1375 V", "ring_2k2_v", "{:.3f} V"),
    Promise("greatest deviation of a row of that ring", "0", "ring_2k2_error", "{:.1f} %", 1e2),
    Promise("greatest deviation of a row of a ring of 10 kΩ", "0", "ring_10k_error", "{:.0f} %", 1e2),
    Promise("error after 16 µs of settling, prebuilt skin", "", "settling_error", "{:.0f} ppm", 1e6),
    Promise("the same, contacts of 8.5 kΩ and 60 pF", "", "settling_error_8k5_60pf", "{:.2f} %", 1e2),
    Promise("error of an amplitude by the converter's steps", "", "demodulation_error", "{:.0f} ppm", 1e6),
    Promise("a logic line into dead rails", "over 30 mA", "dead_line_a", "{:.1f} mA", 1e3),
    Promise("all 20 of them", "", "dead_total_a", "{:.0f} mA", 1e3),
    Promise("PC11 while ±15 V are there", "", "supply_good_v", "{:.1f} V"),
    Promise("PC11 when one or both are missing", "", "supply_lost_v", "{:.1f} V"),
)  # fmt: skip


def missing(page: str, numbers: Mapping[str, float]) -> list[str]:
    """Return the promises whose number does not stand on the page."""
    plain = re.sub(r"\s+", " ", page)
    return [
        f"{promise.what}: {promise.text(numbers)}"
        for promise in PROMISES
        if promise.text(numbers) not in plain
    ]


def table(numbers: Mapping[str, float]) -> str:
    """Return the page of promises."""
    text = [
        "# Promises of the hardware page",
        "",
        "`eitskin hardware make` wrote this page. For each number of"
        " [hardware](../../docs/guide/hardware.md): what the page said before the circuit was"
        " simulated, what ngspice says of that circuit where it was asked, and what it says of the"
        " circuit as it is now. Frequencies are 50 kHz where nothing else stands.",
        "",
        "| promise | the page before | SPICE of that circuit | SPICE now |",
        f"|{4 * '---|'}",
    ]
    text += [
        f"| {promise.what} | {promise.before} | {promise.text_before(numbers)} | {promise.text(numbers)} |"
        for promise in PROMISES
    ]
    return "\n".join(text) + "\n"
