"""Names for what the effects' tests hand to each other."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from eitskin.scene.effect import EffectSession

FloatArray = npt.NDArray[np.float64]
MakeSession = Callable[..., EffectSession]
