"""Exact voltages of a disk with a concentric inclusion, and polar meshes that resolve it, to hold
FEM results against.

With a contact impedance that dwarfs the sheet's own resistance, the complete electrode model's
current density is uniform under each electrode, and the boundary value problem has a closed Fourier
series.
"""

from math import pi

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.mesh import Mesh
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

DWARFING_IMPEDANCE_OHM_M2 = 1e6


def transfer_ohm(
    skin: Skin, inclusion_mm: float, inclusion_s_per_m: float, terms: int = 20000
) -> FloatArray:
    """Mean potential under electrode m per ampere into l (and out evenly over the rim), (L, L),
    contacts left out.

    On the rim r = R, the current density cos(k theta) makes the potential R / (k sigma) T_k cos(k
    theta), where T_k = (1 - mu rho^2k) / (1 + mu rho^2k), with the inclusion's relative radius rho
    and mu = (sigma_in - sigma) / (sigma_in + sigma). An electrode of half-angle alpha has the
    coefficients sin(k alpha) / (k alpha), once for the current and once for the mean.
    """
    assert skin.outline.diameter_mm is not None
    radius_mm = skin.outline.diameter_mm / 2
    sigma = skin.conductivity_s_per_m
    mu = (inclusion_s_per_m - sigma) / (inclusion_s_per_m + sigma)
    k = np.arange(1, terms + 1)
    power = mu * (inclusion_mm / radius_mm) ** (2.0 * k)
    half_angle = skin.electrodes.width_mm / 2 / radius_mm
    coefficient = (1 - power) / (1 + power) * np.sinc(k * half_angle / pi) ** 2 / k
    x, y = skin.electrode_centres_mm().T
    angles = np.arctan2(y, x)
    between = angles[:, None] - angles[None, :]
    total = np.cos(between[..., None] * k) @ coefficient
    return np.asarray(total / (pi * sigma * skin.thickness_mm * 1e-3))


def exact_voltages(
    skin: Skin, protocol: Protocol, inclusion_mm: float, inclusion_s_per_m: float
) -> FloatArray:
    """Boundary voltages (m,) of rows that measure on electrodes without current."""
    z = transfer_ohm(skin, inclusion_mm, inclusion_s_per_m)
    a, b, c, d = protocol.drive_measure.T.astype(int)
    return np.asarray(protocol.current_a * (z[c, a] - z[c, b] - z[d, a] + z[d, b]))


def polar_mesh(skin: Skin, rings_mm: FloatArray, around: int) -> Mesh:
    """Rings of ``around`` nodes at radii ``rings_mm``, the last on the rim; electrodes must begin
    and end on nodes."""
    angles = 2 * pi * np.arange(around) / around
    unit = np.column_stack([np.cos(angles), np.sin(angles)])
    nodes = np.concatenate([np.zeros((1, 2)), *(r * unit for r in rings_mm)])
    k, after = np.arange(around), (np.arange(around) + 1) % around
    triangles = [np.column_stack([np.zeros(around, dtype=int), 1 + k, 1 + after])]
    for ring in range(len(rings_mm) - 1):
        inner, outer = 1 + ring * around, 1 + (ring + 1) * around
        triangles.append(np.column_stack([inner + k, outer + k, outer + after]))
        triangles.append(np.column_stack([inner + k, outer + after, inner + after]))
    step = skin.outline.perimeter_mm / around
    first = 1 + (len(rings_mm) - 1) * around
    edges = []
    for start, end in skin.electrode_spans_mm() / step:
        assert abs(start - round(start)) < 1e-9 and abs(end - round(end)) < 1e-9
        places = np.arange(round(start), round(end))
        edges.append(first + np.column_stack([places % around, (places + 1) % around]))
    return Mesh(nodes, np.concatenate(triangles), tuple(edges))
