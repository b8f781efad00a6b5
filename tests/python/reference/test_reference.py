"""The numpy reference against the formulas that it writes out: brute force, finite differences,
another order of doing."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.model.build import BuildSettings, make_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.model.reduction import fold_rows
from eitskin.scoring.metrics import pixel_cover
from eitskin_reference.disc_fit import Disc, Fit, Reduced, damped_step
from eitskin_reference.engine import ReferenceEngine
from eitskin_reference.fista import fista
from eitskin_reference.problem import greatest, project, shrink
from small_models import DATA_KINDS, SIGNS, prebuilt, small, small_model

GENERATOR = np.random.default_rng(41)


def reference(model: Model, **options: object) -> ReferenceEngine:
    """An engine with its reference set to the skin's own."""
    engine = ReferenceEngine(model)
    engine.set_options(replace(default_options(model), **options))
    engine.set_reference(small().linear.v0_v[None])
    return engine


@pytest.mark.parametrize("sign", SIGNS)
def test_shrink_minimises_its_objective(sign):
    """argmin over allowed x of (x - v)^2 / 2 + t |x|, by brute force on a fine grid."""
    low, high = {"increase": (0, 4), "decrease": (-4, 0), "both": (-4, 4)}[sign]
    allowed, v = np.linspace(low, high, 1000 * (high - low) + 1), GENERATOR.uniform(-3, 3, 50)
    cost = 0.5 * (allowed - v[:, None]) ** 2 + 0.7 * np.abs(allowed)
    assert shrink(v, 0.7, sign) == pytest.approx(allowed[cost.argmin(axis=1)], abs=1e-3)


def test_greatest_is_the_lambda_at_which_zero_is_optimal():
    g = np.array([-3.0, 1.0, 2.0])
    assert [greatest(g, sign) for sign in SIGNS] == [2.0, 3.0, 3.0]
    assert greatest(np.array([-1.0, -2.0]), "increase") == 0
    model = small_model()
    y, basis, _ = reference(model).frame_stage(small().frames(2, 1)[0])
    top = greatest(model.sensitivity.T @ y, "increase")
    for share, zero in ((1.0001, True), (0.9999, False)):
        options = default_options(model)
        x = fista(model.sensitivity, y, share * top, model.lipschitz, options, basis).x
        assert (not x.any()) == zero


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_data_of_small_changes_are_the_linear_change(data_kind):
    """For a change towards nothing, y is S g whatever the kind of data; the drift direction is gone
    from both."""
    s, model = small(), small_model("f32", data_kind)
    change = s.discs(np.random.default_rng(1), 2, "increase") * 1e-4
    frame = s.linear.v0_v + s.linear.jacobian @ change
    engine = reference(model)
    y, basis, masked = engine.frame_stage(3.0 * frame / 3.0)
    expected = project(model.sensitivity @ (change / model.column_weight), basis)
    assert (masked, basis.shape) == (0, (1, 37))
    assert np.abs(y - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_data_have_the_units_of_the_model_whatever_the_gain(data_kind):
    s, frame = small(), small().frames(3, 1)[0]
    ys = []
    for gain in (1.0, -0.02, 1e3):
        engine = ReferenceEngine(small_model("f32", data_kind))
        baseline = engine.set_reference(gain * s.linear.v0_v[None])
        assert baseline.gain == pytest.approx(1 / gain, rel=1e-5)
        assert baseline.correlation == pytest.approx(np.sign(gain))
        ys.append(engine.frame_stage(gain * frame)[0])
    for y in ys[1:]:
        assert y == pytest.approx(ys[0], rel=1e-6, abs=1e-9 * np.abs(ys[0]).max())


@pytest.mark.parametrize("pairs", [1, 10, 30])
def test_rows_left_out_are_whitened_anew(pairs):
    """What S sees, and the data that it is to meet, are those of the reduction by SVD of the rows
    that are left: S'S and S'y."""
    s, model = small(), small_model()
    fold, draw = model.fold, np.random.default_rng(pairs)
    lost, damaged = draw.choice(len(fold.first), pairs, replace=False), s.frames(4, 1)[0]
    damaged[fold.first[lost]] = damaged[fold.second[lost]] = np.nan
    engine = reference(model, project_reference=False, diagnostics=0)
    y, basis, masked = engine.frame_stage(damaged)
    known = np.ones(len(fold.first), dtype=bool)
    known[lost] = False
    assert (masked, basis.shape[0]) == (2 * pairs, 0)
    p, stored = model.projection.astype(np.float64), model.sensitivity
    w = np.linalg.norm(p, axis=1)
    jacobian = (p / w[:, None] ** 2).T @ stored  # of rank r, by columns as they are scaled
    greatest = np.linalg.svd(jacobian, compute_uv=False)[0]
    regularisation = 0.01 * max(known.mean() ** 3, 0.1)
    u, sigma, vt = np.linalg.svd(jacobian[known], full_matrices=False)
    strength = sigma**2 / (sigma**2 + regularisation * greatest**2)
    frame = np.where(np.isnan(damaged), s.linear.v0_v, damaged)
    d = engine._gain * (frame - s.linear.v0_v)
    folded = 0.5 * (d[fold.first] + fold.sign * d[fold.second])[known]
    scale = 0.995 * (1 + regularisation) / 1.01
    expected = scale * (vt.T * strength) @ vt
    gradient = scale * (vt.T * (strength / np.maximum(sigma, 1e-9 * greatest))) @ (u.T @ folded)
    # directions that no row sees count by a hundredth of the regularisation
    assert np.linalg.norm(engine.seen.T @ engine.seen - expected, 2) < 0.012
    assert np.linalg.norm(engine.seen.T @ y - gradient) < 0.012 * np.linalg.norm(gradient)


@pytest.mark.parametrize("noise", [4e-3, 0.02, 0.5])
def test_a_noisy_reference_gets_the_model_of_a_higher_floor(noise):
    """The same S'S, S'y and images, but for a scale, as from a model that was built with that
    regularisation."""
    s, frame = small(), small().frames(4, 1)[0]
    quiet = s.quiet(6, 8, noise=noise)
    # of discs this strong some rows count as outliers
    engine = reference(small_model(), diagnostics=0)
    learned = engine.set_reference(quiet)
    regularisation = min(5 * learned.noise_v / learned.v0_rms_v, 1.0)
    settings = BuildSettings(rank=37, regularisation=regularisation)
    other = reference(make_model(s.skin, s.protocol, s.linear, settings), diagnostics=0)
    other.set_reference(quiet)
    scale = (1 + regularisation) / 1.01
    y, expected = engine.frame_stage(frame)[0], other.frame_stage(frame)[0]
    assert engine.seen.T @ engine.seen == pytest.approx(scale * other.seen.T @ other.seen, abs=1e-5)
    expected = scale * other.seen.T @ expected
    assert engine.seen.T @ y == pytest.approx(expected, abs=1e-5 * np.linalg.norm(y))
    images = []
    for one in (engine, other):
        exact = {"solver": "active-set", "lambda_noise_factor": 0.0, "detection_factor": 0.0}
        one.set_options(replace(one.options, **exact))
        result = one.reconstruct(frame)
        assert result.info.regularisation == pytest.approx(regularisation, rel=1e-4)
        images.append(result.image)
    assert images[0] == pytest.approx(images[1], abs=2e-3 * images[1].max())


@pytest.mark.parametrize("quiet_frames", [1, 8])
def test_the_regularisation_stays_where_noise_is_little_or_unknown(quiet_frames):
    s = small()
    engine = reference(small_model(), diagnostics=0)
    engine.set_reference(s.quiet(6, quiet_frames, noise=1.5e-3 if quiet_frames > 1 else 0.1))
    found = engine.reconstruct(s.frames(4, 1)[0]).info.regularisation
    assert found == pytest.approx(0.01, rel=1e-4)
    assert engine.seen is small_model().sensitivity


def test_one_of_a_pair_stands_for_both():
    s, model = small(), small_model()
    fold = s.protocol.reciprocal_pairs()
    frame = s.linear.v0_v + s.linear.jacobian @ s.discs(np.random.default_rng(3), 2, "increase")
    engine = reference(model)
    whole = engine.frame_stage(frame)[0]
    for side in (fold.first, fold.second):
        damaged = frame.copy()
        damaged[side[::2]] = np.nan
        least = 1e-9 * np.abs(whole).max()
        assert engine.frame_stage(damaged)[0] == pytest.approx(whole, rel=1e-6, abs=least)


def test_lambda_noise_is_the_greatest_of_the_second_half():
    s, model = small(), small_model()
    quiet = s.quiet(5, 10)
    engine = ReferenceEngine(model)
    baseline = engine.set_reference(quiet)
    seen = []
    for k in range(5, 10):
        probe = ReferenceEngine(model)
        probe.set_reference(quiet[:5].mean(axis=0)[None])
        direction = probe.frame_stage(quiet[k])[1]
        d = probe._gain * (quiet[k] - quiet[:k].mean(axis=0))
        y = project(model.projection @ fold_rows(d, model.fold), direction)
        seen.append(np.abs(model.sensitivity.T @ y).max())
    assert baseline.lambda_noise == pytest.approx(max(seen), rel=1e-9)
    assert baseline.noise_v == pytest.approx(quiet.std(axis=0, ddof=1).mean(), rel=0.1)
    assert baseline.frames == 10
    assert ReferenceEngine(model).set_reference(quiet[:3]).lambda_noise == 0


# ---- discs ----


def fit_of(model: Model, **options: object) -> Fit:
    chosen = replace(default_options(model), **options)
    y, none = GENERATOR.normal(size=model.rank), np.zeros((0, model.rank))
    return Fit(model, Reduced(y, None, model.sensitivity, none, 0.0, 0.0), chosen)


def test_a_discs_answer_is_that_of_the_pixels_it_covers():
    model = prebuilt()[0]
    fit = fit_of(model)
    disc = Disc(12.0, -20.0, 15.0, 1.0, 1.0)
    atom, _ = fit.answers(disc)
    cover = pixel_cover(model.grid, [(12.0, -20.0)], [15.0])
    exact = model.sensitivity @ (cover / model.column_weight)
    assert np.linalg.norm(atom - exact) < 0.05 * np.linalg.norm(exact)


def test_slopes_are_derivatives():
    """Against central differences; the cover is piecewise smooth, so a step far below a pixel."""
    fit = fit_of(prebuilt()[0])
    disc = Disc(-31.7, 18.3, 13.1, 1.0, 1.0)
    _, slopes = fit.answers(disc)
    step = 1e-5
    for row, name in enumerate(("x_mm", "y_mm", "radius_mm")):
        near = (replace(disc, **{name: getattr(disc, name) + h}) for h in (step, -step))
        up, down = (fit.answers(one)[0] for one in near)
        least = 1e-6 * np.abs(slopes[row]).max()
        assert slopes[row] == pytest.approx((up - down) / (2 * step), rel=1e-4, abs=least)


def test_the_step_solves_the_damped_equations_and_leaves_what_nothing_moves():
    a = GENERATOR.normal(size=(9, 4)) * [1.0, 1e3, 1e-3, 1.0]
    h, g = a.T @ a, GENERATOR.normal(size=4)
    step = damped_step(h, g)
    assert (h + 1e-3 * np.diag(np.diag(h))) @ step == pytest.approx(g, rel=1e-9)
    h[2], h[:, 2] = 0, 0
    assert damped_step(h, g)[2] == 0


def test_expected_radius_from_strength():
    fit = fit_of(prebuilt()[0], touch_change_s_per_m=0.01)
    disc = Disc(0, 0, 10.0, 0.04, 1.0)
    free = pytest.approx(20.0)
    for change, radius_mm in ((0.04, free), (1.0, 30.0), (1e-6, 3.0), (-0.04, free)):
        one = replace(disc, change=change, polarity=float(np.sign(change)))
        assert fit.expected_radius(one) == radius_mm
    assert fit_of(prebuilt()[0], touch_change_s_per_m=0.0).expected_radius(disc) == 9.0


def test_what_a_disc_explains_is_what_leaving_it_out_costs():
    """With changes at the joint least-squares optimum: (|residual without k|^2 - |residual|^2) /
    |y|^2."""
    fit = fit_of(prebuilt()[0])
    fit.discs = [
        Disc(-40.0, 20.0, 12.0, 0.0, 1.0),
        Disc(10.0, -5.0, 15.0, 0.0, 1.0),
        Disc(20.0, -18.0, 15.0, 0.0, 1.0),
    ]
    atoms = np.array([fit.answers(disc)[0] for disc in fit.discs]).T
    y = fit.data
    changes, *_ = np.linalg.lstsq(atoms, y, rcond=None)
    fit.discs = [replace(disc, change=float(c)) for disc, c in zip(fit.discs, changes, strict=True)]
    whole = float(np.sum((y - atoms @ changes) ** 2))
    expected = []
    for k in range(3):
        rest = np.delete(atoms, k, axis=1)
        left = y - rest @ np.linalg.lstsq(rest, y, rcond=None)[0]
        expected.append((float(left @ left) - whole) / float(y @ y))
    assert fit.explained() == pytest.approx(expected, rel=1e-3)
