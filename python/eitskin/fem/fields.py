"""The electric fields that the electrodes' currents make in the untouched skin.

The Jacobian holds only products of fields, as if each touch were alone. The interaction of touches
needs the fields themselves: each touch responds as a dipole to the field that the other touches
have changed (csrc/src/touch/interaction.h has the formula).
"""

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.grid import Grid
from eitskin.fem.sensitivity import element_fields, element_to_pixel


def electrode_fields(
    forward: ForwardModel, conductivity_s_per_m: npt.ArrayLike, grid: Grid
) -> FloatArray:
    """Return the mean gradient of the potential over each pixel for a current into each electrode,
    (n, 2, L) in V/m per A, on the flattened copy if the skin covers a surface.

    Only differences between electrodes have a meaning: the field of a pair is that of its first
    electrode minus that of its second.
    """
    fields = element_fields(forward, forward.solve(conductivity_s_per_m))
    if forward.mesh.stretch is not None:
        fields = forward.mesh.stretch @ fields
    by_pixel = element_to_pixel(forward.mesh, grid).tocsc()
    by_pixel.data *= forward.mesh.areas_mm2[by_pixel.indices]
    area = np.maximum(np.asarray(by_pixel.sum(axis=0)).ravel(), np.finfo(float).tiny)
    by_pattern = np.stack(
        [(by_pixel.T @ fields[:, axis, :]) / area[:, None] for axis in (0, 1)], axis=1
    )
    incidence = forward.patterns.right_hand_sides(forward.protocol.n_electrodes)
    return np.asarray(by_pattern @ np.linalg.pinv(incidence))
