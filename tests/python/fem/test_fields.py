"""The fields of the electrodes' currents."""

import numpy as np

from eitskin.fem.cem import ForwardModel
from eitskin.fem.fields import electrode_fields
from eitskin.fem.grid import grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.fem.sensitivity import element_fields, element_to_pixel, sensitivity
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import Skin


def test_fields_are_those_of_the_jacobian():
    """Differences of the electrodes' fields are those of the patterns, to rounding. The product of
    the means over a pixel is the mean of the products, except for the change of the fields within
    the pixel."""
    skin = Skin("disk", disk(100.0), Electrodes(16, 3.0), 0.02, 5.0)
    protocol = adjacent(16)
    mesh = mesh_for_elements(skin, 3000)
    grid, forward = grid_for(skin.outline, 24), ForwardModel(mesh, skin, protocol)
    fields = electrode_fields(forward, 0.02, grid)
    assert fields.shape == (grid.n_pixels, 2, 16)
    by_element = element_fields(forward, forward.solve(0.02))
    weight = element_to_pixel(mesh, grid).toarray() * mesh.areas_mm2[:, None]
    means = np.einsum("en,eap->nap", weight, by_element) / weight.sum(axis=0)[:, None, None]
    pairs = fields @ forward.patterns.right_hand_sides(16)
    assert np.abs(pairs - means).max() < 1e-9 * np.abs(means).max()
    jacobian, _ = sensitivity(forward, 0.02, grid)
    rows = protocol.drive_measure.astype(int)
    drive, measure = (fields[:, :, rows[:, k]] - fields[:, :, rows[:, k + 1]] for k in (0, 2))
    inner = np.linalg.norm(grid.centres_mm(), axis=1) < 35
    volume_m3 = forward.thickness_m * grid.pixel_mm**2 * 1e-6
    product = -protocol.current_a * volume_m3 * (drive * measure).sum(axis=1)
    difference = product[inner] - jacobian.T[inner]
    assert np.linalg.norm(difference) < 0.03 * np.linalg.norm(jacobian.T[inner])
