"""From the voltage between the electrodes to codes: the amplifier's gain, half the reference as
bias, 12 bits (docs/guide/hardware.md).

The converter's transfer is ideal: code k from k - 1/2 to k + 1/2 steps of VREF / 4096, and its ends
beyond. No noise: that is the scene's.
"""

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray

REFERENCE_V = 3.3
STEPS = 4096
CODE_V = REFERENCE_V / STEPS  # of one code, at the converter
# at the electrodes by a model's 1 mA, with the source and gain as designed: 0.5 mA and 3
STEP_V = CODE_V / 1.5


def codes(v: FloatArray) -> npt.NDArray[np.uint16]:
    """Codes (.,) of the voltages ``v`` (.,) that the amplifier adds to half the reference."""
    return np.clip(np.round(STEPS / 2 + v / CODE_V), 0, STEPS - 1).astype(np.uint16)
