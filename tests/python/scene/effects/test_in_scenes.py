"""Effects in whole scenes, against closed forms and against the forward model called directly."""

from math import pi
from typing import Any

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.errors import ConfigError
from eitskin.fem.cem import ForwardModel
from eitskin.scene.compiler import Compiled, MeshCache, compile_scene
from eitskin.scene.description import Scene
from eitskin.scene.effects import gel_drying, misplacement, temperature
from eitskin.scene.runner import simulate_frames
from eitskin.skin.protocol import Protocol, adjacent, table
from eitskin.skin.skin import paper_skin

ELEMENTS = 1200
BENCH = MeshCache()  # keeps the meshes


def _compiled(effects: dict[str, Any], protocol: Protocol | None = None, **more: Any) -> Compiled:
    given = {"quiet_frames": 1, "frames": 1, "elements": ELEMENTS, "seed": 3, **more}
    scene = Scene("test", protocol=protocol or adjacent(16), effects=effects, **given)
    return compile_scene(scene, mesh_cache=BENCH)


def _last(effects: dict[str, Any], protocol: Protocol | None = None, **more: Any) -> FloatArray:
    return np.asarray(simulate_frames(_compiled(effects, protocol, **more)).voltage_v[-1])


def _direct(impedance: Any = 0.0, protocol: Protocol | None = None) -> FloatArray:
    mesh = BENCH.mesh(paper_skin(), ELEMENTS)
    return ForwardModel(mesh, paper_skin(), protocol or adjacent(16), impedance).voltages(0.01)


@pytest.mark.parametrize("contact", [{}, {"contact_impedance": {"mean_ohm_m2": 0.02}}])
@pytest.mark.parametrize("ohm", [0.0, 1.0, 300.0, 1e5, 1e9])
def test_a_bridge_is_a_resistor_parallel_to_the_skin(ohm, contact):
    """Seen from electrodes 3 and 4 the skin is R_34: a bridge leaves R / (R + R_34) of their
    voltage."""
    rows = table(16, [[3, 4, 3, 4], [0, 8, 3, 4], [12, 5, 4, 3]])
    whole = _last(contact, rows)
    skin_ohm = whole[0] / rows.current_a
    bridged = _last({**contact, "bridged": {"electrodes": [3, 4], "resistance_ohm": ohm}}, rows)
    expected, least = whole * ohm / (ohm + skin_ohm), 1e-12 * np.abs(whole).max()
    np.testing.assert_allclose(bridged, expected, rtol=1e-9, atol=least)


def test_bridged_without_resistance_electrodes_are_at_one_potential():
    """A chain of three: rows between its electrodes read 0 V, all others the same on each of
    them."""
    rows = table(
        16,
        [[0, 8, 2, 3], [0, 8, 3, 9], [0, 8, 2, 9], [0, 8, 2, 6], [0, 8, 9, 6], [2, 8, 5, 6],
         [3, 8, 5, 6]],
    )  # fmt: skip
    v = _last({"bridged": {"electrodes": [2, 3, 9], "resistance_ohm": 0.0}}, rows)
    assert np.abs(v[:3]).max() < 1e-12
    assert v[3] == pytest.approx(v[4], rel=1e-9)
    assert v[5] == pytest.approx(v[6], rel=1e-9)  # driving one of them is driving any
    assert abs(_last({}, rows)[0]) > 0.1


@pytest.mark.parametrize("others", [{}, {"contact_impedance": {"mean_ohm_m2": 0.01}}])
@pytest.mark.parametrize("electrodes", [[5], [0, 15], [2, 3, 11]])
def test_detached_electrodes_carry_no_signal_and_leave_the_rest(electrodes, others):
    v = _last({**others, "detached": {"electrodes": electrodes}})
    impedance = np.full(16, others["contact_impedance"]["mean_ohm_m2"] if others else 0.0)
    impedance[electrodes] = 1e5
    direct = _direct(impedance)
    lost = np.isin(adjacent(16).drive_measure, electrodes).any(axis=1)
    assert not v[lost].any() and lost.sum() > 50
    np.testing.assert_allclose(v[~lost], direct[~lost], rtol=1e-5)
    assert np.abs(v - _direct())[~lost].max() > 1e-4  # an insulated rim is not a shunted one


def test_a_wobbling_electrode_is_lost_for_a_while():
    effects = {"detached": {"electrodes": [5], "from_s": 0.1, "until_s": 0.2}}
    compiled = _compiled(effects, frames=6, rate_hz=20.0)
    done = simulate_frames(compiled)
    lost = np.isin(adjacent(16).drive_measure, [5]).any(axis=1)
    off = [not row[lost].any() for row in done.voltage_v]
    assert off == [False, False, False, True, True, False, False]
    assert np.array_equal(done.voltage_v[0], done.voltage_v[-1]) and len(compiled.states) == 2


def test_phase_leaves_detached_electrodes_detached():
    """The double layer would else shunt what does not touch."""
    off = {"detached": {"electrodes": [5]}, "contact_impedance": {"mean_ohm_m2": 0.01}}
    even = {"relative_permittivity": 1.0}
    slow = {"phase": {"frequency_hz": 1e-3, "capacitance_f_per_m2": 1e-3, **even}}
    np.testing.assert_allclose(_last({**off, **slow}), _last(off), rtol=1e-6, atol=1e-9)
    fast = {"phase": {"frequency_hz": 50e3, "capacitance_f_per_m2": 10.0, **even}}
    bare = _last({"detached": {"electrodes": [5]}})
    np.testing.assert_allclose(_last({**off, **fast}), bare, rtol=1e-4, atol=1e-6)


def test_phase_on_an_even_sheet_with_shunts_is_one_complex_factor():
    effects = {"phase": {"frequency_hz": 50e3, "relative_permittivity": 80.0}}
    compiled = _compiled(effects)
    done = simulate_frames(compiled)
    factor = 0.01 / (0.01 + 2j * pi * 50e3 * 8.8541878128e-12 * 80.0)
    assert np.iscomplexobj(done.true_v) and done.work.complex_factorisations == 1
    np.testing.assert_allclose(done.true_v[0], _direct() * factor, rtol=1e-9)
    np.testing.assert_allclose(done.voltage_v[-1], _direct() * factor.real, rtol=1e-9)
    magnitude = _last({"phase": {**effects["phase"], "readout": "magnitude"}})
    np.testing.assert_allclose(magnitude, _direct() * abs(factor), rtol=1e-9)


@pytest.mark.parametrize(("hertz", "with_phase"), [(0.0, False), (50e3, False), (50e3, True)])
def test_source_impedance_divides_the_current(hertz, with_phase):
    """The load is what a row measures on the driven electrodes themselves."""
    rows = table(16, [[0, 8, 0, 8], [0, 8, 3, 4], [1, 2, 1, 2], [1, 2, 9, 11]])
    source = {
        "resistance_ohm": 30e3, "capacitance_pf": 200.0, "frequency_hz": hertz, "series_ohm": 240.0,
    }  # fmt: skip
    more = {"phase": {"frequency_hz": 50e3}} if with_phase else {}
    truth = simulate_frames(_compiled(more, rows)).true_v[0]
    load = np.repeat(truth[[0, 2]] / rows.current_a, 2) + 240.0
    share = 1 / (1 + load * (1 / 30e3 + 2j * pi * hertz * 200e-12))
    divided = _last({**more, "source_impedance": source}, rows)
    np.testing.assert_allclose(divided, (truth * share).real, rtol=1e-9)
    assert 0.3 < abs(share).min() < abs(share).max() < 0.9


def test_a_sheets_factor_divides_the_voltages_of_shunts():
    more: dict[str, Any] = {"frames": 5, "rate_hz": 0.01}
    warm = {"offset_k": 3.0, "drift_k_per_min": 0.1}
    dry = {"time_constant_h": 0.1}
    done = simulate_frames(_compiled({"temperature": warm, "gel_drying": dry}, **more)).voltage_v
    for frame in range(6):
        age_s = frame * 100.0
        factor = temperature.temperature_factor(age_s, temperature.Parameters(**warm))
        factor *= gel_drying.drying_factor(age_s, gel_drying.Parameters(**dry))
        np.testing.assert_allclose(done[frame], _direct() / factor, rtol=1e-9)


def test_contact_impedance_is_the_forward_models():
    compiled = _compiled({"contact_impedance": {"mean_ohm_m2": 0.03, "spread": 0.5}})
    drawn = compiled.states[0].contacts.impedance_ohm_m2
    assert np.ptp(drawn) > 0.01
    assert np.array_equal(simulate_frames(compiled).voltage_v[-1], _direct(drawn))


def test_misplacement_is_the_forward_models_on_the_moved_skin(make_session):
    compiled = _compiled({"misplacement": {"spread_mm": 3.0}})
    skin = misplacement.make(misplacement.Parameters(3.0), make_session(seed=3)).apply(paper_skin())
    assert compiled.skin == skin
    direct = ForwardModel(BENCH.mesh(skin, ELEMENTS), skin, adjacent(16), 0.0).voltages(0.01)
    assert np.array_equal(simulate_frames(compiled).voltage_v[-1], direct)
    assert np.abs(direct - _direct()).max() > 0.01


def test_common_mode_with_a_grounded_sink():
    """Row [0, 8, 3, 12]: the common voltage is the mean of what [0, 8, 3, 8] and [0, 8, 12, 8]
    read."""
    rows = table(16, [[0, 8, 3, 12], [0, 8, 3, 8], [0, 8, 12, 8]])
    plain = _last({}, rows)
    mixed = _last({"common_mode": {"cmrr_db": 40.0}}, rows)
    assert mixed[0] - plain[0] == pytest.approx(0.01 * (plain[1] + plain[2]) / 2, rel=1e-9)


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"detached": {"electrodes": list(range(14))}}, r"\[effects.detached\]: .*no row"),
        ({"bridged": {"electrodes": [0, 77]}}, r"\[effects.bridged\]: .*77 does not exist"),
        ({"noise": {"snr_db": 60.0, "noise_v": 1e-3}}, r"\[effects.noise\]: snr_db: give either"),
        (
            {"charge_injection": {"window_us": 15.0}},
            r"\[effects.charge_injection\]: window_us = 15 is 0\.75 periods of 50000 Hz",
        ),
        (
            {"detached": {"electrodes": list(range(0, 16, 2)), "from_s": 0.05}},
            r"\[effects.detached\]: .*no row of the protocol",
        ),
        (
            {"phase": {"frequency_hz": 1e4}, "source_impedance": {"frequency_hz": 5e4}},
            r"\[effects.source_impedance\]: frequency_hz = 50000.0 contradicts"
            r" \[effects.phase\] frequency_hz",
        ),
        ({"misplacement": {"spread_mm": 80.0}}, r"\[effects.misplacement\]: spread_mm = 80"),
        ({"phase": {"readout": "in_fase"}}, r"\[effects.phase\].*did you mean 'in_phase'"),
        ({"mux": {"dwell_us": 0.0}}, r"\[effects.mux\].*dwell_us.*above 0"),
        ({"adc": {"bits": 0}}, r"\[effects.adc\].*bits.*at least 1"),
    ],
)
def test_impossible_parameters_name_table_and_key(effects, message):
    with pytest.raises(ConfigError, match=message) as caught:
        _compiled(effects)
    assert "\n" not in str(caught.value)
