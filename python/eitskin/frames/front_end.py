"""The current and gain that suit a skin, and whether the instrument's own values do.

The instrument of docs/guide/hardware.md drives 0.5 mA and amplifies by 3. Source and return
together reach 24 V with supplies of 15 V, and its converter 1.65 V. A skin that conducts badly
needs less current; one that conducts well needs more current or gain.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.homogeneous import voltages_of
from eitskin.skin.protocol import Protocol

MULTIPLEXERS_OHM = 240.0  # two ADG1206 in the path of the current, data sheet
SOURCE_REACH_V = 24.0  # of source and driven return together; each reaches 12.8 V
CONVERTER_REACH_V = 1.65
SHARE_USED = 0.75  # of the converter's range; the rest is a reserve for contacts and worse skins
RECEIVER_OHM = 9_900.0  # AD8421: gain 1 + 9.9 kohm / R_G, data sheet
FILTER_GAIN = 0.989  # of 1 kohm and 470 pF behind it, at 50 kHz
MAX_GAIN = 100.0
MAX_CURRENT_A = 5e-3 * 2**0.5  # IEC 60601-1 at 50 kHz, 5 mA rms
SOURCE_INPUT_V = 1.0  # the current is 1 V over the resistor of the source
E24 = (
    1.0, 1.1, 1.2, 1.3, 1.5, 1.6, 1.8, 2.0, 2.2, 2.4, 2.7, 3.0,
    3.3, 3.6, 3.9, 4.3, 4.7, 5.1, 5.6, 6.2, 6.8, 7.5, 8.2, 9.1,
)  # fmt: skip


@dataclass(frozen=True)
class FrontEnd:
    """The settings of the front end: ``current_a`` is the amplitude between the driven electrodes,
    ``gain`` is the amplification from the electrodes to the converter."""

    current_a: float = 0.5e-3
    gain: float = 3.0

    @property
    def gain_ppm(self) -> int:
        """The board's FRONT_END_GAIN_PPM: volts at the converter per volt of a model for 1 mA, in
        millionths."""
        return round(self.current_a / 1e-3 * self.gain * 1e6)


@dataclass(frozen=True)
class Demand:
    """The demand of a skin on its instrument, per ampere: the greatest boundary voltage, and the
    greatest voltage between driven electrodes, multiplexers included."""

    row_ohm: float
    drive_ohm: float

    def at_converter_v(self, front_end: FrontEnd) -> float:
        """Return the greatest amplitude at the converter."""
        return self.row_ohm * front_end.current_a * front_end.gain

    def at_source_v(self, front_end: FrontEnd) -> float:
        """Return the greatest amplitude that the current source must reach."""
        return self.drive_ohm * front_end.current_a

    def suits(self, front_end: FrontEnd) -> bool:
        """Return whether nothing clips and at least a tenth of the converter's range is used."""
        seen = self.at_converter_v(front_end)
        return (
            self.at_source_v(front_end) <= SOURCE_REACH_V
            and 0.1 * CONVERTER_REACH_V <= seen <= 0.9 * CONVERTER_REACH_V
        )


def demand_of(transfer_ohm: FloatArray, protocol: Protocol) -> Demand:
    """Return the demand of ``protocol`` on the instrument for a skin with ``transfer_ohm`` (n, n),
    contacts included."""
    rows = protocol.drive_measure.astype(np.int64)
    drives = np.unique(rows[:, :2], axis=0)
    return Demand(
        float(np.abs(voltages_of(transfer_ohm, rows)).max()),
        float(voltages_of(transfer_ohm, np.hstack([drives, drives])).max()) + MULTIPLEXERS_OHM,
    )


def suitable(demand: Demand) -> FrontEnd:
    """Return the default front end if it suits, otherwise one with suitable resistors: the greatest
    current that the source can reach, then the gain."""
    usual = FrontEnd()
    if demand.suits(usual):
        return usual
    limit_a = min(usual.current_a, SOURCE_REACH_V / demand.drive_ohm)
    wanted = SHARE_USED * CONVERTER_REACH_V / demand.row_ohm  # current times gain
    if wanted / limit_a > MAX_GAIN:
        limit_a = min(MAX_CURRENT_A, SOURCE_REACH_V / demand.drive_ohm, wanted / MAX_GAIN)
    current_a = SOURCE_INPUT_V / resistor_from(SOURCE_INPUT_V / limit_a)
    gain = min(max(wanted / current_a, 1.0), MAX_GAIN)
    if gain == 1.0:
        current_a = SOURCE_INPUT_V / resistor_from(SOURCE_INPUT_V / wanted)
    return FrontEnd(current_a, gain)


def resistor_from(least_ohm: float) -> float:
    """Return the smallest resistance of series E24 that is at least ``least_ohm``."""
    decade = 10.0 ** np.floor(np.log10(least_ohm))
    steps = [step * decade for step in (*E24, 10.0)]
    return float(next(ohm for ohm in steps if ohm >= least_ohm * (1 - 1e-9)))


def advice(demand: Demand) -> list[str]:
    """Return lines that state how the default front end suits the skin, and what to change if it
    does not."""
    usual, better = FrontEnd(), suitable(demand)
    lines = [
        f"front end        {_described(demand, usual)}: "
        + ("suits" if better == usual else "unsuited")
    ]
    if better != usual:
        source_ohm = SOURCE_INPUT_V / better.current_a
        gain_ohm = RECEIVER_OHM / (better.gain / FILTER_GAIN - 1) if better.gain > 1 else np.inf
        resistor = f"R_G {gain_ohm:,.0f} ohm" if np.isfinite(gain_ohm) else "no R_G"
        lines.append(f"better           {_described(demand, better)}")
        lines.append(
            f"                 source resistor {source_ohm:,.0f} ohm, {resistor};"
            f"  eitskin board --gain {better.gain:.4g} --source-ua"
            f" {round(better.current_a * 1e6)}"
        )
        if not demand.suits(better):
            lines.append(
                "                 even so the converter is hardly used or clips: change the skin's"
                " conductivity or thickness, or the protocol"
            )
    return lines


def _described(demand: Demand, front_end: FrontEnd) -> str:
    return (
        f"{1e3 * front_end.current_a:.3g} mA, gain {front_end.gain:.3g}: source"
        f" {demand.at_source_v(front_end):.3g} of {SOURCE_REACH_V:g} V, converter"
        f" {demand.at_converter_v(front_end):.3g} of {CONVERTER_REACH_V:g} V"
    )
