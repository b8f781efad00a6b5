"""Gains, multiplexers, charge, cross-talk, mains and common mode against closed forms."""

from dataclasses import replace
from math import exp, pi, sin

import numpy as np
import pytest

from eitskin.scene.effect import Loads
from eitskin.scene.effects import channel_gain, charge_injection, common_mode, crosstalk, mains, mux
from eitskin.scene.scan import channels, row_delays_s, settled_from_the_row_before, switched
from eitskin.skin.protocol import adjacent, table


def _loads(m: int = 208, seed: int = 3) -> Loads:
    draw = np.random.default_rng(seed)
    source, sink, plus, minus = draw.standard_normal((4, m))
    return Loads(source, sink, plus, minus, 1e-3)


def test_channels_of_adjacent_measurement_are_the_sixteen_pairs():
    pairs, number = channels(adjacent(16))
    assert pairs.shape == (16, 2)
    assert np.array_equal(pairs[number], adjacent(16).drive_measure[:, 2:])


def test_a_channel_has_one_gain_within_its_spread(make_session, v0):
    session = make_session()
    gain = channel_gain.make(channel_gain.Parameters(0.05), session).apply(np.ones(208), 0.0, 0)
    _, number = channels(session.protocol)
    assert all(np.ptp(gain[number == channel]) == 0 for channel in range(16))
    assert len(np.unique(gain)) == 16 and 0.02 < np.abs(gain - 1).max() <= 0.05
    none = channel_gain.make(channel_gain.Parameters(0.0), session)
    assert np.array_equal(none.apply(v0, 0.0, 0), v0)


@pytest.mark.parametrize("ratio", [0.2, 1.0, 3.0, 30.0])
def test_settling_leaves_exp_of_dwell_over_tau_of_the_row_before(make_session, ratio):
    """From a single step in the scan: the rows after it, each by itself, against exp(-t / tau)."""
    parameters = mux.Parameters(on_resistance_ohm=0.0, settling_us=10.0, dwell_us=10.0 * ratio)
    step = mux.make(parameters, make_session())
    v = np.zeros(208)
    v[100] = 1.0
    out = step.apply(v, 0.0, 0)
    assert mux.unsettled(parameters) == pytest.approx(exp(-ratio))
    assert out[100] == pytest.approx(1 - exp(-ratio), rel=1e-12)
    after = out[100] * np.exp(-ratio * np.arange(1, 10))
    np.testing.assert_allclose(out[101:110], after, rtol=1e-9, atol=1e-15 * out[100])
    # a constant passes unchanged
    np.testing.assert_allclose(step.apply(np.full(208, 0.3), 0.0, 0), 0.3, rtol=1e-12)


@pytest.mark.parametrize("left", [0.0, 0.01, 0.6, 0.99, 0.999])
def test_settling_is_the_periodic_recurrence(left):
    target = np.random.default_rng(2).standard_normal(208)
    found = settled_from_the_row_before(target, left)
    np.testing.assert_allclose(found, target + left * (np.roll(found, 1) - target), atol=1e-11)


def test_settling_depends_on_the_order_of_the_scan(make_session, v0):
    session = make_session()
    parameters = mux.Parameters(settling_us=50.0)
    order = np.random.default_rng(4).permutation(208)
    turned = replace(session, protocol=table(16, session.protocol.drive_measure[order]))
    straight = mux.make(parameters, session).apply(v0, 0.0, 0)[order]
    shuffled = mux.make(parameters, turned).apply(v0[order], 0.0, 0)
    assert np.abs(shuffled - straight).max() > 0.01 * np.abs(v0).max()
    settled = replace(parameters, settling_us=0.0)
    straight = mux.make(settled, session).apply(v0, 0.0, 0)[order]
    assert np.array_equal(mux.make(settled, turned).apply(v0[order], 0.0, 0), straight)


def test_on_resistance_divides(make_session):
    session = make_session()
    parameters = mux.Parameters(
        on_resistance_ohm=100.0, input_resistance_ohm=800.0, settling_us=0.0
    )
    assert mux.make(parameters, session).apply(np.ones(208), 0.0, 0) == pytest.approx(0.8)
    spread = mux.make(replace(parameters, on_spread_ohm=50.0), session).apply(np.ones(208), 0.0, 0)
    assert 800 / 1100 <= spread.min() < 0.79 and 0.81 < spread.max() <= 800 / 900


def test_switched_lines():
    rows = table(8, [[0, 1, 2, 3], [0, 1, 3, 4], [1, 2, 3, 4], [1, 2, 5, 4]])
    assert switched(rows).tolist() == [
        [True, True, True, True],
        [False, False, True, True],
        [True, True, False, False],
        [False, False, True, False],
    ]


def _quadrature(p: charge_injection.Parameters) -> float:
    """The demodulator's mean of 2 sin(w t) exp(-(dwell + t) / tau) over the window, by the midpoint
    rule."""
    t = (np.arange(2_000_000) + 0.5) / 2_000_000 * p.window_us
    decay = np.exp(-(p.dwell_us + t) / p.settling_us)
    weight = 2 * np.sin(2 * pi * p.frequency_hz * t * 1e-6) if p.frequency_hz else 1.0
    return float(np.mean(decay * weight))


@pytest.mark.parametrize(
    "parameters",
    [
        charge_injection.Parameters(),
        charge_injection.Parameters(frequency_hz=0.0),
        charge_injection.Parameters(settling_us=3.0, dwell_us=1.0, window_us=20.0),
        charge_injection.Parameters(
            settling_us=500.0, dwell_us=100.0, window_us=1000.0, frequency_hz=1e3
        ),
    ],
)
def test_what_a_demodulator_keeps_of_injected_charge(parameters):
    kept = charge_injection.kept_by_demodulator(parameters)
    assert kept == pytest.approx(_quadrature(parameters), rel=1e-6)


def test_injected_charge_is_q_over_c_on_lines_that_switch(make_session):
    """One line switches, the other stays: exactly Q / C, with the line's sign, whatever the
    signal."""
    rows = table(8, [[0, 1, 2, 4], [0, 1, 3, 4], [1, 2, 3, 4], [1, 2, 3, 5]])
    session = replace(make_session(), protocol=rows)
    p = charge_injection.Parameters(charge_pc=2.0, capacitance_pf=100.0, spread=0.0)
    step = charge_injection.make(p, session)
    unit = 0.02 * charge_injection.kept_by_demodulator(p)
    # row 0 follows row 3: both lines switch, equal charges cancel
    np.testing.assert_allclose(step.apply(np.zeros(4), 0.0, 0), [0.0, unit, 0.0, -unit], atol=1e-18)
    v = np.array([1.0, -2.0, 3.0, 0.5])
    np.testing.assert_allclose(step.apply(v, 0.0, 0) - v, step.apply(0 * v, 9.0, 5), atol=1e-15)
    uneven = charge_injection.make(replace(p, spread=0.4), session).apply(np.zeros(4), 0.0, 0)
    assert 0 < abs(uneven[0]) <= 0.8 * unit and uneven[2] == 0


def test_crosstalk_comes_from_driven_wires_beside(make_session):
    rows = [[0, 1, 2, 3], [3, 8, 2, 5], [8, 3, 4, 2], [0, 5, 15, 10], [0, 8, 4, 12], [7, 5, 6, 12]]
    session = replace(make_session(), protocol=table(16, rows))
    loads, part = _loads(6), 10 ** (-40 / 20)
    step = crosstalk.make(crosstalk.Parameters(coupling_db=-40.0), session)
    got = step.apply(np.zeros(6), loads, 0.0, 0) / part
    a, b = loads.source_v, loads.sink_v
    # wires 15 and 0 are not neighbours; 3 lies between 4 and 2, so couples onto both lines and
    # cancels
    expected = [b[0], a[1], 0.0, 0.0, 0.0, a[5] + b[5]]
    np.testing.assert_allclose(got, expected, atol=1e-13)


@pytest.mark.parametrize(
    ("frequency_hz", "alias"), [(50.0, 10.0), (60.0, 0.0), (50.3, 9.7), (47.0, 7.0)]
)
def test_mains_aliases_at_its_frequency_and_amplitude(make_session, frequency_hz, alias):
    """400 frames at 20 Hz: the spectrum of any row has one line, at the alias, with the amplitude
    given."""
    session = make_session(n_frames=400, quiet_frames=0)
    step = mains.make(mains.Parameters(2e-3, frequency_hz, 30.0), session)
    seen = np.array([step.apply(np.zeros(208), t, k) for k, t in enumerate(session.times_s())])
    assert mains.alias_hz(frequency_hz, 20.0) == pytest.approx(alias)
    row, frame = 77, 13
    time_s = frame / 20 + 77 / (208 * 20)
    wave = sin(2 * pi * frequency_hz * time_s + pi / 6)
    assert seen[frame, row] == pytest.approx(2e-3 * wave, abs=1e-15)
    spectrum = np.abs(np.fft.rfft(seen[:, row])) / 400
    place = np.fft.rfftfreq(400, 1 / 20)
    assert place[np.argmax(spectrum)] == pytest.approx(alias)
    if 0 < alias < 10:
        assert 2 * spectrum.max() == pytest.approx(2e-3, rel=1e-9)
        assert np.sort(spectrum)[-2] < 1e-12
    # through the rows of one frame, it is a sine at its own frequency
    in_frame = np.sin(2 * pi * frequency_hz * row_delays_s(session) + pi / 6)
    np.testing.assert_allclose(seen[0], 2e-3 * in_frame)


@pytest.mark.parametrize("cmrr_db", [0.0, 40.0, 80.0])
def test_common_mode_is_the_inputs_mean_over_the_rejection(make_session, cmrr_db):
    loads, v = _loads(), np.linspace(-1, 1, 208)
    middle = (loads.plus_v + loads.minus_v) / 2
    for ground, common in (("sink", middle - loads.sink_v), ("mean", middle)):
        added = []
        for inverted in (False, True):
            parameters = common_mode.Parameters(cmrr_db, ground, inverted=inverted)
            step = common_mode.make(parameters, make_session())
            added.append(step.apply(v, loads, 0.0, 0) - v)
        np.testing.assert_allclose(added[0], common * 10 ** (-cmrr_db / 20), atol=1e-15)
        np.testing.assert_allclose(added[1], -added[0], atol=1e-14)
