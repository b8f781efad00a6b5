"""Contact impedance within its spread, what is off or bridged, the interface's phase against an RC
circuit."""

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.errors import ConfigError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh
from eitskin.scene.cover import NO_CHANGE
from eitskin.scene.effect import Contacts, EffectSession, PhaseStep
from eitskin.scene.effects import bridged, contact_impedance, detached, phase
from eitskin.scene.forward_steps import FactoriseComplex, Work
from eitskin.scene.reading import OPEN_BRIDGED_OHM_M2, OPEN_OHM_M2
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import polygon
from eitskin.skin.protocol import table
from eitskin.skin.skin import Skin


def _ideal(count: int = 16) -> Contacts:
    return Contacts(np.zeros(count), np.zeros(count, dtype=bool))


def _impedance(session: EffectSession, mean: float, spread: float = 0.0) -> FloatArray:
    step = contact_impedance.make(contact_impedance.Parameters(mean, spread), session)
    return step.apply(_ideal(), 0.0, 0).impedance_ohm_m2


def test_impedances_lie_within_their_spread(make_session):
    z = _impedance(make_session(), 0.02, 0.25)
    assert 0.015 <= z.min() < 0.018 and 0.022 < z.max() <= 0.025
    assert np.array_equal(_impedance(make_session(), 0.02), np.full(16, 0.02))
    assert not np.array_equal(_impedance(make_session(seed=2), 0.02, 0.25), z)


def _bar(cells: int = 8) -> tuple[Mesh, Skin]:
    """A bar of 80 x 20 mm, 5 mm thick: electrodes 2 and 3 cover its ends, 0 and 1 are short ones on
    its lower side.

    Electrode 0 lies from 20 to 25 mm, electrode 1 from 55 to 60 mm.
    """
    nx, ny = 16 * cells // 8, 4 * cells // 8
    x, y = np.meshgrid(np.linspace(0, 80, nx + 1), np.linspace(0, 20, ny + 1))
    number = np.arange((nx + 1) * (ny + 1)).reshape(ny + 1, nx + 1)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    bottom, ends = (nx // 4, nx * 11 // 16), (number[:, 0], number[:, -1])
    below = [number[0, k : k + 2][None] for k in bottom]
    rims = (*below, *(np.column_stack([end[:-1], end[1:]]) for end in ends))
    mesh = Mesh(np.column_stack([x.ravel(), y.ravel()]), triangles, rims)
    outline = polygon([(0, 0), (80, 0), (80, 20), (0, 20)])
    return mesh, Skin("bar", outline, Electrodes(4, 5.0), 0.05, 5.0)


@pytest.mark.parametrize("hertz", [100.0, 5e3, 50e3, 1e6])
@pytest.mark.parametrize("resistance", [0.0, 0.003, 0.1])
def test_phase_against_the_circuit_of_a_bar_between_rc_interfaces(make_session, hertz, resistance):
    """A bar with whole ends as electrodes: Z = length / ((sigma + j w eps) area) + 2 (R || C) /
    area, exactly."""
    mesh, skin = _bar()
    protocol = table(4, [[2, 3, 2, 3], [2, 3, 0, 1]])
    parameters = phase.Parameters(hertz, relative_permittivity=2e4, capacitance_f_per_m2=0.02)
    step = phase.make(parameters, make_session())
    forward = ForwardModel(mesh, skin, protocol, 0.0)
    contacts = np.array([9e5, 9e5, resistance, resistance])
    solver = FactoriseComplex(forward, _only_ends(step), Work())
    electrodes = solver.electrodes(np.full(mesh.n_elements, 0.05), NO_CHANGE, contacts)
    v: Any = forward.patterns.voltages(electrodes) * 1e-3
    omega, area_m2 = 2 * pi * hertz, 20e-3 * 5e-3
    admittivity = 0.05 + 1j * omega * 8.8541878128e-12 * 2e4
    interface = resistance / (1 + 1j * omega * resistance * 0.02)
    whole = 80e-3 / (admittivity * area_m2) + 2 * interface / area_m2
    assert v[0] == pytest.approx(1e-3 * whole, rel=1e-9)
    assert v[1] == pytest.approx(1e-3 * 35e-3 / (admittivity * area_m2), rel=1e-6)
    np.testing.assert_allclose(step.readout(v), v.real, rtol=0)
    magnitude = phase.make(phase.Parameters(hertz, readout="magnitude"), make_session()).readout
    np.testing.assert_allclose(magnitude(-v), -np.abs(v))


def _only_ends(step: PhaseStep) -> PhaseStep:
    """``step`` with electrodes 0 and 1 left without a double layer: voltmeters that do not disturb
    the bar."""
    inner = step.contact
    return replace(step, contact=lambda z: np.where(np.arange(len(z)) < 2, z + 0j, inner(z)))


def test_the_interface_is_a_resistance_parallel_to_a_capacitance():
    z = np.array([0.0, 0.01, 0.5, 1e6])
    slow, corner = phase.interface(z, 1e-6, 0.1), phase.interface(z, 1 / (2 * pi * 0.01 * 0.1), 0.1)
    np.testing.assert_allclose(slow, z, rtol=1e-6)
    assert corner[1] == pytest.approx(0.01 / (1 + 1j))
    fast = phase.interface(z, 1e9, 0.1)
    np.testing.assert_allclose(fast[1:3], 1 / (2j * pi * 1e9 * 0.1), rtol=1e-6)
    # a shunt stays one, and what does not touch has no double layer
    assert fast[0] == 0 and fast[3] == 1e6
    most = contact_impedance.Parameters.__dataclass_fields__["mean_ohm_m2"].metadata["high"]
    # detached electrodes are solved with these
    assert most < phase.NO_CONTACT_OHM_M2 <= min(OPEN_OHM_M2, OPEN_BRIDGED_OHM_M2)
    y = phase.admittivity(np.array([0.01]), 50e3, 80.0)
    assert y[0].imag == pytest.approx(2.2253e-4, rel=1e-3)


def test_detached_electrodes_are_marked_while_they_are_off(make_session):
    step = detached.make(detached.Parameters((2, 9), from_s=1.0, until_s=2.0), make_session())
    assert step.varies
    for time_s, off in ((-0.1, False), (0.99, False), (1.0, True), (1.99, True), (2.0, False)):
        assert step.apply(_ideal(), time_s, 0).detached.sum() == (2 if off else 0)
    assert np.flatnonzero(step.apply(_ideal(), 1.5, 0).detached).tolist() == [2, 9]
    assert not detached.make(detached.Parameters((2,)), make_session()).varies


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda s: detached.make(detached.Parameters((16,)), s),
         "16 does not exist; the skin's are 0 to 15"),
        (lambda s: detached.make(detached.Parameters(tuple(range(13))), s),
         "no row of the protocol can be measured"),
        (lambda s: detached.Parameters(()), "name at least one"),
        (lambda s: detached.Parameters((1,), 2.0, 1.0), "until_s = 1 must come after from_s = 2"),
        (lambda s: bridged.Parameters((3,)), "name at least two"),
        (lambda s: bridged.Parameters((3, 3)), "none twice"),
        (lambda s: bridged.make(bridged.Parameters((3, 99)), s), "99 does not exist"),
        (lambda s: contact_impedance.Parameters(spread=1.0), "must be below 1"),
    ],
)  # fmt: skip
def test_impossible_contacts_are_refused(make_session, build, message):
    with pytest.raises(ConfigError, match=message):
        build(make_session())
