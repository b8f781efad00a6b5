"""Noise, saturation, converter and jitter against their definitions."""

from math import exp, pi, sqrt
from typing import Any

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.errors import ConfigError
from eitskin.scene.effects import adc, jitter, noise, saturation


def _frames(step: Any, v: FloatArray, count: int) -> FloatArray:
    return np.array([step.apply(v, 0.0, frame) for frame in range(count)])


@pytest.mark.parametrize("snr_db", [20.0, 60.0, 90.0])
def test_snr_is_the_ratio_of_rms_to_deviation(make_session, v0, snr_db):
    session = make_session()
    step = noise.make(noise.Parameters(snr_db=snr_db), session)
    error = _frames(step, v0, 500) - v0
    found = 20 * np.log10(np.sqrt(np.mean(v0**2)) / error.std())
    assert found == pytest.approx(snr_db, abs=0.1)  # 104,000 draws: 0.02 dB
    assert abs(error.mean()) < 4 * error.std() / sqrt(error.size)
    by_row = error.std(axis=0)
    assert by_row.max() / by_row.min() < 1.35  # the same on every row
    neighbours = np.corrcoef(error[:, :-1].ravel(), error[:, 1:].ravel())[0, 1]
    in_time = np.corrcoef(error[:-1].ravel(), error[1:].ravel())[0, 1]
    assert max(abs(neighbours), abs(in_time)) < 4 / sqrt(error.size)


def test_noise_in_volts_and_its_default(make_session, v0):
    session, rms_v = make_session(), np.sqrt(np.mean(v0**2))
    assert noise.deviation_v(noise.Parameters(noise_v=3e-4), session) == 3e-4
    assert noise.deviation_v(noise.Parameters(), session) == pytest.approx(rms_v / 1000)


@pytest.mark.parametrize("bits", [6, 12, 16])
def test_quantisation_error_has_the_variance_of_a_uniform_step(make_session, bits):
    step = adc.make(adc.Parameters(bits=bits, range_v=2.0), make_session())
    lsb = 4.0 / 2**bits
    v = np.random.default_rng(5).uniform(-1.9, 1.9, 200_000)
    error = step.apply(v, 0.0, 0) - v
    assert error.var() == pytest.approx(lsb**2 / 12, rel=0.01)
    assert np.abs(error).max() <= lsb / 2 * (1 + 1e-9)
    assert abs(error.mean()) < 4 * lsb / sqrt(12 * len(v))
    # a full sine's signal-to-noise ratio: 6.02 B + 1.76 dB
    sine = 2.0 * (1 - 1 / 2**bits) * np.sin(2 * pi * 0.123456789 * np.arange(100_000))
    snr = 10 * np.log10(np.mean(sine**2) / np.mean((step.apply(sine, 0.0, 0) - sine) ** 2))
    assert snr == pytest.approx(6.02 * bits + 1.76, abs=0.4)


def test_codes_are_whole_and_end_where_twos_complement_does(make_session):
    step = adc.make(adc.Parameters(bits=8, range_v=1.0), make_session())
    lsb = 2 / 256
    out = step.apply(np.array([-9.0, -1.0, -0.4 * lsb, 0.0, 0.6 * lsb, 1.0, 9.0]), 0.0, 0)
    np.testing.assert_array_equal(out / lsb, [-128, -128, 0, 0, 1, 127, 127])


def test_headroom_counts_from_the_largest_untouched_voltage(make_session, v0):
    session = make_session()
    assert session.limit_v(None, 2.0) == pytest.approx(2 * np.abs(v0).max())
    assert session.limit_v(0.7, None) == 0.7
    clipped = saturation.make(saturation.Parameters(headroom=0.5), session).apply(v0, 0.0, 0)
    assert np.abs(clipped).max() == pytest.approx(np.abs(v0).max() / 2)
    for both in (
        lambda: adc.Parameters(range_v=1.0, headroom=1.0),
        lambda: saturation.Parameters(1.0, 1.0),
        lambda: noise.Parameters(snr_db=60.0, noise_v=1e-3),
    ):
        with pytest.raises(ConfigError, match="give either"):
            both()


def test_saturation_clips_exactly(make_session):
    step = saturation.make(saturation.Parameters(limit_v=0.7), make_session())
    v = np.array([-5.0, -0.7000001, -0.7, -0.3, 0.0, 0.69, 0.7, 0.70001, 1e9])
    expected = [-0.7, -0.7, -0.7, -0.3, 0.0, 0.69, 0.7, 0.7, 0.7]
    np.testing.assert_array_equal(step.apply(v, 0.0, 0), expected)


def _demodulated(s: float, samples: int, trials: int) -> FloatArray:
    """Amplitudes (trials,) that a demodulator finds in a sine whose samples are off by a phase of
    deviation s."""
    angle = 2 * pi * 5 * np.arange(samples) / samples  # five whole periods
    off = np.random.default_rng(11).standard_normal((trials, samples)) * s
    return np.asarray(2 * np.mean(np.sin(angle + off) * np.sin(angle), axis=1))


@pytest.mark.parametrize(
    ("jitter_ns", "samples"), [(10.0, 64), (300.0, 64), (2000.0, 16), (6000.0, 32)]
)
def test_jitter_is_what_a_demodulator_of_jittered_samples_finds(make_session, jitter_ns, samples):
    """At 50 kHz: s of 0.003 to 1.9 rad."""
    parameters = jitter.Parameters(jitter_ns=jitter_ns, samples=samples)
    mean, deviation = jitter.amplitude_error(parameters)
    s = 2 * pi * 50e3 * jitter_ns * 1e-9
    found = _demodulated(s, samples, 20_000)
    assert mean == pytest.approx(exp(-s * s / 2))
    assert found.mean() == pytest.approx(mean, abs=4 * deviation / sqrt(20_000))
    assert found.std() == pytest.approx(deviation, rel=0.03)
    if s < 0.1:
        assert deviation == pytest.approx(s / sqrt(2 * samples), rel=0.01)
    step = jitter.make(parameters, make_session())
    v = np.linspace(-1, 1, 208)
    out = _frames(step, v, 2000)
    np.testing.assert_allclose(out.std(axis=0), np.abs(v) * deviation, rtol=0.1)
