"""Drying, temperature, background and misplaced electrodes against their laws."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest

from eitskin.errors import ConfigError
from eitskin.fem.mesh import build_mesh
from eitskin.scene.effects import background, gel_drying, misplacement, temperature
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.skin import Skin, paper_skin


def test_gel_dries_exponentially_from_the_first_frame(make_session):
    session = make_session(n_frames=100, quiet_frames=10, rate_hz=1 / 360)
    parameters = gel_drying.Parameters(time_constant_h=2.0, final_water=0.4, exponent=1.7)
    step = gel_drying.make(parameters, session)
    sigma = np.array([0.01, 0.02])
    assert np.array_equal(step.apply(sigma, session.times_s()[0], 0), sigma)
    for frame in (10, 50, 99):
        water = 0.4 + 0.6 * exp(-frame * 0.1 / 2)
        dried = step.apply(sigma, session.times_s()[frame], frame)
        np.testing.assert_allclose(dried, sigma * water**1.7, rtol=1e-12)
    assert gel_drying.drying_factor(1e9, parameters) == pytest.approx(0.4**1.7)
    # the law itself: what is left to lose falls by the same part in every hour
    free = [gel_drying.drying_factor(3600 * h, parameters) ** (1 / 1.7) - 0.4 for h in range(5)]
    np.testing.assert_allclose(np.diff(np.log(free)), -0.5, rtol=1e-9)


def test_temperature_is_linear_with_its_coefficient(make_session):
    session = make_session(n_frames=121, quiet_frames=0, rate_hz=1.0)
    parameters = temperature.Parameters(offset_k=1.0, drift_k_per_min=2.0, coefficient_per_k=0.02)
    step = temperature.make(parameters, session)
    sigma = np.array([0.01])
    factors = [float(step.apply(sigma, t, 0)[0] / 0.01) for t in (0.0, 60.0, 120.0)]
    np.testing.assert_allclose(factors, [1.02, 1.06, 1.10], rtol=1e-12)
    assert step.varies
    steady = temperature.Parameters(offset_k=3.0, drift_k_per_min=0.0)
    assert not temperature.make(steady, session).varies


def test_a_temperature_that_would_empty_the_sheet_is_refused(make_session):
    falling = temperature.Parameters(drift_k_per_min=-100.0)
    with pytest.raises(ConfigError, match="drift_k_per_min: over the session"):
        temperature.make(falling, make_session(n_frames=2000, rate_hz=1.0))


@pytest.mark.parametrize("spread", [0.05, 0.5, 2.0])
def test_the_backgrounds_mean_over_the_area_is_kept(make_session, small_mesh, spread):
    step = background.make(background.Parameters(spread, 25.0), make_session())
    sigma = step.apply(np.full(small_mesh.n_elements, 0.01), 0.0, 0)
    assert np.average(sigma, weights=small_mesh.areas_mm2) == pytest.approx(0.01, rel=1e-12)
    assert sigma.min() > 0 and not step.varies


def test_the_background_has_its_spread_and_its_length():
    """Over 300 draws: the deviation, and the correlation exp(-d^2 / 2 l^2) of the field under
    it."""
    places = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 20.0], [200.0, 0.0]])
    draws = (np.random.default_rng(k) for k in range(3000))
    fields = np.array([background.random_field(places, 20.0, draw) for draw in draws])
    correlation = np.corrcoef(fields.T)[0]
    np.testing.assert_allclose(correlation, [1, exp(-0.125), exp(-0.5), 0], atol=0.06)
    assert fields.std() == pytest.approx(1, rel=0.03)
    grid = np.stack(np.meshgrid(np.arange(100.0), np.arange(100.0)), axis=-1).reshape(-1, 2)
    parameters, draw = background.Parameters(0.3, 2.0), np.random.default_rng(1)
    made = background.pattern(grid, np.ones(len(grid)), parameters, draw)
    assert made.std() == pytest.approx(0.3, rel=0.1)


def test_another_mesh_samples_the_same_background(make_session, small_mesh):
    finer = build_mesh(paper_skin(), max_size_mm=5.0, electrode_size_mm=1.0)
    session = make_session()
    other = replace(session, build_mesh=lambda: finer)
    parameters = background.Parameters(0.3, 40.0)
    a = background.make(parameters, session).apply(np.ones(small_mesh.n_elements), 0.0, 0)
    b = background.make(parameters, other).apply(np.ones(finer.n_elements), 0.0, 0)
    apart = np.linalg.norm(finer.centroids_mm()[:, None] - small_mesh.centroids_mm(), axis=2)
    near = np.argmin(apart, axis=1)
    assert np.corrcoef(a[near], b)[0, 1] > 0.99


def test_misplacement_moves_electrodes_along_the_rim(make_session):
    session = make_session()
    step = misplacement.make(misplacement.Parameters(3.0), session)
    before, after = session.skin, step.apply(session.skin)
    moved = np.linalg.norm(after.electrode_centres_mm() - before.electrode_centres_mm(), axis=1)
    assert 1.5 < moved.max() <= 3.0 and moved.min() > 0
    away = np.linalg.norm(after.electrode_centres_mm(), axis=1)
    np.testing.assert_allclose(away, 97.0, rtol=1e-12)
    assert after.outline == before.outline and after.electrodes.width_mm == 4.0
    # only one electrode is shifted, by 2.5 mm
    one = misplacement.shifted(before, np.eye(16)[5] * 2.5)
    moved = np.linalg.norm(one.electrode_centres_mm() - before.electrode_centres_mm(), axis=1)
    assert np.flatnonzero(moved > 1e-9).tolist() == [5]
    assert moved[5] == pytest.approx(2 * 97 * np.sin(2.5 / 97 / 2))
    still = misplacement.make(misplacement.Parameters(0.0), session).apply(before)
    moved = still.electrode_centres_mm() - before.electrode_centres_mm()
    np.testing.assert_allclose(moved, 0, atol=1e-9)


def test_misplacement_keeps_given_places_and_refuses_overlap(make_session):
    skin = Skin("uneven", disk(100.0), Electrodes(4, 6.0, positions_mm=(0.0, 50.0, 150.0, 200.0)))
    moved = misplacement.shifted(skin, np.array([1.0, -1.0, 0.0, 2.0]))
    assert moved.electrodes.positions_mm == (1.0, 49.0, 150.0, 202.0)
    with pytest.raises(ConfigError, match=r"spread_mm = 60: .*electrode"):
        misplacement.make(misplacement.Parameters(60.0), make_session())


def test_known_shifts_are_taken_as_they_are(make_session):
    drawn: list[str] = []
    session = make_session(drawn=drawn)
    known = tuple(0.1 * k for k in range(16))
    step = misplacement.make(misplacement.Parameters(shift_mm=known), session)
    assert step.apply(session.skin) == misplacement.shifted(session.skin, np.array(known))
    assert not drawn and step.cost.random_numbers == 0
    with pytest.raises(ConfigError, match="shift_mm: 3 shifts for 16 electrodes"):
        misplacement.make(misplacement.Parameters(shift_mm=(1.0, 2.0, 3.0)), session)
    with pytest.raises(ConfigError, match=r"shift_mm: .*electrode"):
        misplacement.make(misplacement.Parameters(shift_mm=(60.0, *[0.0] * 15)), session)
