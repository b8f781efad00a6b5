"""The homogeneous prediction by finite elements, for outlines without a closed form. It needs the
extra ``model``."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.skin.protocol import table
from eitskin.skin.skin import Skin

ELEMENTS = 3000
TOUCH_CONTRAST = 3.0


@lru_cache(maxsize=4)
def fem_prediction(skin: Skin) -> "FemPrediction":
    """Return the prediction for ``skin``; it is made only once."""
    return FemPrediction(skin)


def transfer_by_elements(skin: Skin) -> FloatArray:
    """Return ``FemPrediction.transfer_ohm`` (n, n) of ``skin`` in ohm, contact impedances
    included."""
    return fem_prediction(skin).transfer_ohm()


class FemPrediction:
    """One mesh of ``skin``, solved without touches or with them; all frames follow from a transfer
    matrix (n, n)."""

    def __init__(self, skin: Skin) -> None:
        self._skin, self._n = skin, skin.electrodes.count
        self._mesh = mesh_for_elements(skin, ELEMENTS)
        self._pairs = [(j, k) for j in range(1, self._n) for k in range(1, j + 1)]
        protocol = table(self._n, [[j, 0, k, 0] for j, k in self._pairs], current_a=1.0)
        self._forward = ForwardModel(self._mesh, skin, protocol)

    def transfer_ohm(self, conductivity_s_per_m: FloatArray | None = None) -> FloatArray:
        """Return the potential (n, n) of each electrode per ampere that enters at another and
        leaves at electrode 0, which is grounded."""
        uniform = np.full(self._mesh.n_elements, self._skin.conductivity_s_per_m)
        voltages = self._forward.voltages(
            uniform if conductivity_s_per_m is None else conductivity_s_per_m
        )
        transfer = np.zeros((self._n, self._n))
        j, k = np.array(self._pairs).T
        transfer[j, k] = transfer[k, j] = voltages
        return transfer

    def touch_transfer(
        self, xy_mm: FloatArray, radius_mm: FloatArray, sign: NDArray[np.int8]
    ) -> FloatArray:
        """Return the change (n, n) of the transfer matrix by touches with centres (t, 2), radii
        (t,) and signs (t,), +1 or -1."""
        conductivity = np.full(self._mesh.n_elements, self._skin.conductivity_s_per_m)
        centroids = self._mesh.centroids_mm()
        for xy, radius, direction in zip(xy_mm, radius_mm, sign, strict=True):
            distance = np.hypot(*(centroids - xy).T)
            inside = distance <= max(float(radius), float(distance.min()))
            conductivity[inside] = self._skin.conductivity_s_per_m * TOUCH_CONTRAST ** int(
                direction
            )
        return self.transfer_ohm(conductivity) - self.transfer_ohm()
