"""Check by a raw frame that source and amplifier of a board suit its skin, and say which part to
change if they do not.

The board has one source and one gain at a time: two resistors set them (docs/guide/hardware.md),
and the owner's settings say which are fitted. So a gain per row or per drive is not possible.
"""

import numpy as np

from eitskin.device.wire.link_table import Quality
from eitskin.device.wire.packets import BoardInfo, RawFrame
from eitskin.frames.front_end import (
    CONVERTER_REACH_V,
    MAX_GAIN,
    RECEIVER_OHM,
    SHARE_USED,
    SOURCE_INPUT_V,
    resistor_from,
)

MODEL_A = 1e-3  # the amplitude that raw voltages are for
LEAST_SHARE = 0.02  # of the converter's range, in the greatest row: about 40 codes


def unserved(info: BoardInfo, raw: RawFrame) -> str | None:
    """Return what does not fit and which value to change; None if the parts serve the skin, or the
    board does not know them."""
    if not info.gain_ppm or not info.source_ua:
        return None
    saturated = sum(bool(one & Quality.SATURATED) for one in raw.quality)
    if saturated:
        # the true voltages are not known: half of the gain, or of the current, and again
        return (
            f"{saturated} rows exceed the converter's {CONVERTER_REACH_V:g} V with {_now(info)}; "
            + _change(info, info.gain / 2, info.source_ua)
        )
    row_ohm = float(np.abs(raw.voltage_v).max()) / MODEL_A
    source_a = 1e-6 * info.source_ua
    seen_v = row_ohm * source_a * info.gain
    if seen_v >= LEAST_SHARE * CONVERTER_REACH_V:
        return None
    wanted = SHARE_USED * CONVERTER_REACH_V / max(row_ohm, 1e-3)  # current times gain
    return (
        f"the greatest row reaches {1e3 * seen_v:.3g} mV of the converter's {CONVERTER_REACH_V:g} V"
        f" with {_now(info)}; {_change(info, wanted / source_a, info.source_ua)}"
    )


def _now(info: BoardInfo) -> str:
    return f"a gain of {info.gain:g} and {info.source_ua} uA"


def _change(info: BoardInfo, gain: float, source_ua: float) -> str:
    """The parts for this gain; where it is out of the amplifier's range, the current too."""
    settings = []
    parts = []
    if not 1 < gain <= MAX_GAIN:
        kept = min(max(gain, 1.0), MAX_GAIN)
        ohm = resistor_from(SOURCE_INPUT_V / (1e-6 * source_ua * gain / kept))
        parts.append(f"a source resistor (R13) of {ohm:,.0f} ohm")
        settings.append(f"--source-ua {1e6 * SOURCE_INPUT_V / ohm:.0f}")
        gain = kept
    if gain != info.gain:
        parts.insert(0, f"R_G (R52) of {_receiver(gain)}")
        settings.insert(0, f"--gain {gain:.3g}")
    return f"fit {' and '.join(parts)}, then  eitskin board {' '.join(settings)}"


def _receiver(gain: float) -> str:
    return f"{RECEIVER_OHM / (gain - 1):,.0f} ohm" if gain > 1.001 else "none (leave it open)"
