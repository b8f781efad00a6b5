"""The oracle against formulas that it does not use: a model that was built otherwise, derivatives,
another order of doing."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.model.build import BuildSettings, make_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.model.reduction import fold_rows
from eitskin.oracle.discs import Disc, DiscFit, cover
from eitskin.oracle.engine import Explained, OracleEngine
from eitskin.oracle.lasso import Lasso
from eitskin.oracle.whitening import project_out, singular, whitening
from small_models import DATA_KINDS, prebuilt, small, small_model


def oracle(model: Model, **options: object) -> OracleEngine:
    """With the skin's own reference."""
    engine = OracleEngine(model)
    engine.set_options(replace(default_options(model), **options))
    engine.set_reference(small().linear.v0_v[None])
    return engine


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_data_of_small_changes_are_the_linear_change(data_kind):
    """For a change towards nothing, y is S g whatever the kind of data; the drift direction is gone
    from both."""
    s, model = small(), small_model("f32", data_kind)
    change = s.discs(np.random.default_rng(1), 2, "increase") * 1e-4
    seen = oracle(model).explain(s.linear.v0_v + s.linear.jacobian @ change)
    expected = seen.s @ (change / model.column_weight)
    assert np.linalg.matrix_rank(seen.project) == model.rank - 1
    assert np.abs(seen.y - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_data_do_not_depend_on_the_instruments_unit_or_sign(data_kind):
    s, frame = small(), small().frames(3, 1)[0]
    ys = []
    for unit in (1.0, -0.02, 1e3):
        engine = OracleEngine(small_model("f32", data_kind))
        learned = engine.set_reference(unit * s.linear.v0_v[None])
        assert learned.gain == pytest.approx(1 / unit, rel=1e-5)
        assert learned.correlation == pytest.approx(np.sign(unit))
        ys.append(engine.explain(unit * frame).y)
    for y in ys[1:]:
        assert y == pytest.approx(ys[0], rel=1e-6, abs=1e-9 * np.abs(ys[0]).max())


@pytest.mark.parametrize("data_kind", DATA_KINDS)
def test_a_larger_gain_is_no_change(data_kind):
    seen = oracle(small_model("f32", data_kind)).explain(1.01 * small().linear.v0_v)
    assert np.abs(seen.y).max() < 1e-12 < np.abs(seen.whitening.data @ seen.folded.d).max()


@pytest.mark.parametrize("pairs", [1, 10, 30])
def test_rows_left_out_are_whitened_as_the_builder_does(pairs):
    """S'S and S'y are those of a reduction of the rows that are left by a singular value
    decomposition; directions that no row sees count by a hundredth of the regularisation."""
    s, model = small(), small_model()
    fold, draw = model.fold, np.random.default_rng(pairs)
    lost, damaged = draw.choice(len(fold.first), pairs, replace=False), s.frames(4, 1)[0]
    damaged[fold.first[lost]] = damaged[fold.second[lost]] = np.nan
    seen = oracle(model, project_reference=False, diagnostics=0).explain(damaged)
    known = seen.folded.known
    assert (~known).sum() == pairs
    u, sigma, vt = np.linalg.svd((singular(model)[0] @ singular(model)[2])[known], False)
    mu = 0.01 * max(known.mean() ** 3, 0.1)
    greatest = singular(model)[1].max()
    strength = sigma**2 / (sigma**2 + mu * greatest**2)
    scale = 0.995 * (1 + mu) / 1.01
    expected = scale * (vt.T * strength) @ vt
    filter_ = strength / np.maximum(sigma, 1e-9 * greatest)
    gradient = scale * (vt.T * filter_) @ (u.T @ seen.folded.d[known])
    assert np.linalg.norm(seen.s.T @ seen.s - expected, 2) < 0.012
    assert np.linalg.norm(seen.s.T @ seen.y - gradient) < 0.012 * np.linalg.norm(gradient)
    assert np.linalg.eigvalsh(seen.s @ seen.s.T).max() <= model.lipschitz


@pytest.mark.parametrize("noise", [4e-3, 0.02, 0.5])
def test_a_noisy_reference_gets_the_model_of_a_higher_floor(noise):
    """The same S'S, S'y and optimum, but for a scale, as from a model that was built with that
    regularisation."""
    s, frame, untouched = small(), small().frames(4, 1)[0], small().untouched(6, 8, noise=noise)
    engine = oracle(small_model(), diagnostics=0)
    learned = engine.set_reference(untouched)
    mu = min(5 * learned.noise_v / learned.v0_rms_v, 1.0)
    built = BuildSettings(rank=37, regularisation=mu)
    other = oracle(make_model(s.skin, s.protocol, s.linear, built), diagnostics=0)
    other.set_reference(untouched)
    a, b, scale = engine.explain(frame), other.explain(frame), (1 + mu) / 1.01
    assert a.whitening.regularisation == pytest.approx(mu)
    assert a.s.T @ a.s == pytest.approx(scale * b.s.T @ b.s, abs=1e-5)
    assert a.s.T @ a.y == pytest.approx(scale * b.s.T @ b.y, abs=1e-5 * np.linalg.norm(a.y))


def test_of_a_taught_model_the_rows_left_are_weighed_by_their_own_noise():
    """S'S and S'y of generalised least squares, by the covariance of the rows in use."""
    draw, model = np.random.default_rng(2), small_model()
    count = len(model.fold.first)
    root = np.eye(count) + 0.1 * draw.normal(size=(count, count))
    c = root @ root.T
    p = np.linalg.qr(draw.normal(size=(count, model.rank)))[0].T @ np.linalg.inv(root)
    precision = np.linalg.inv(c)[np.tril_indices(count)].astype(np.float32)
    stored = p.astype(np.float32)
    taught = replace(model, projection=stored, row_form=None, precision=precision)
    known = draw.uniform(size=count) > 0.1
    white = whitening(taught, known, 0.0)
    answers = (c @ p.T @ model.sensitivity)[known]
    metric, d = np.linalg.inv(c[np.ix_(known, known)]), np.where(known, draw.normal(size=count), 0)
    assert white.seen.T @ white.seen == pytest.approx(answers.T @ metric @ answers, abs=1e-4)
    expected = answers.T @ metric @ d[known]
    assert white.seen.T @ (white.data @ d) == pytest.approx(expected, abs=1e-4)


def test_one_row_of_a_pair_stands_for_both():
    s, model = small(), small_model()
    fold = s.protocol.reciprocal_pairs()
    frame = s.linear.v0_v + s.linear.jacobian @ s.discs(np.random.default_rng(3), 2, "increase")
    whole = oracle(model).explain(frame).y
    for side in (fold.first, fold.second):
        damaged = frame.copy()
        damaged[side[::2]] = np.nan
        assert oracle(model).explain(damaged).y == pytest.approx(whole, abs=1e-8)


def test_lambda_noise_is_the_greatest_of_the_second_half():
    s, model = small(), small_model()
    untouched, engine, seen = s.untouched(5, 10), OracleEngine(small_model()), []
    learned = engine.set_reference(untouched)
    first = OracleEngine(model)
    first.set_reference(untouched[:5].mean(axis=0)[None])
    gain, project = first.reference.gain, first.explain(untouched[0]).project  # type: ignore[union-attr]
    for k in range(5, 10):
        d = gain * (untouched[k] - untouched[:k].mean(axis=0))
        y = project @ (model.projection @ fold_rows(d, model.fold))
        seen.append(np.abs(model.sensitivity.T @ y).max())
    assert learned.lambda_noise == pytest.approx(max(seen), rel=1e-9)
    assert learned.noise_v == pytest.approx(untouched.std(axis=0, ddof=1).mean(), rel=0.1)
    assert OracleEngine(model).set_reference(untouched[:3]).lambda_noise == 0


def test_projection_takes_out_a_span():
    a, b = np.random.default_rng(4).normal(size=(2, 20))
    q, count = project_out(np.column_stack([a, 2 * a, b, a - b, np.zeros(20)]), 1e-6)
    assert count == 2 and np.linalg.matrix_rank(q) == 18
    assert q @ q == pytest.approx(q, abs=1e-12)
    assert max(np.abs(q @ a).max(), np.abs(q @ b).max()) < 1e-12


# ---- discs ----


def fit_of(model: Model, y: np.ndarray | None = None, **options: object) -> DiscFit:
    chosen = replace(default_options(model), **options)
    data = np.random.default_rng(1).normal(size=model.rank) if y is None else y
    return DiscFit(model, model.sensitivity, data, 0.0, chosen)


def test_a_disc_covers_its_area():
    """Its covers add up to pi r^2 of pixels, to 5 %, wherever its centre is."""
    grid = prebuilt()[0].grid
    for x, y, radius in ((12.0, -20.0, 15.0), (0.3, 2.2, 9.0), (-31.7, 18.3, 13.1)):
        area = cover(grid, x, y, radius).sum() * grid.pixel_area_mm2
        assert area == pytest.approx(np.pi * radius**2, rel=0.05)


def test_the_prior_is_nothing_at_the_expected_change():
    """One deviation of the radius costs touch_radius_weight times the disc's energy."""
    fit = fit_of(prebuilt()[0], touch_change_s_per_m=0.01, touch_radius_weight=1e-3)
    for change, expected_mm in ((0.01, 10.0), (0.04, 20.0), (1.0, 30.0), (1e-6, 3.0)):
        disc = Disc(0.0, 0.0, 10.0, change)
        answer = fit.answer(disc)
        off = (10.0 - expected_mm) / (0.12 * expected_mm)
        assert fit.prior(disc, answer) ** 2 == pytest.approx(1e-3 * answer @ answer * off**2)


def test_a_fit_finds_the_discs_that_made_the_data():
    """Two near ones, and one that is weak, from the peaks of the optimum's image."""
    model = prebuilt()[0]
    true = [
        Disc(-40.0, 20.0, 12.0, 0.0135),
        Disc(10.0, -5.0, 10.0, 0.0135),
        Disc(35.0, -25.0, 8.0, 0.009),
    ]
    y = -fit_of(model, np.zeros(model.rank)).residual(true)
    fit = fit_of(model, y)
    lasso = Lasso(model.sensitivity, y, 0.03 * float((model.sensitivity.T @ y).max()), "increase")
    image = lasso.optimum() * model.column_weight
    found = sorted(fit.fitted(fit.peaks(image)), key=lambda disc: disc.x_mm)
    assert len(found) == 3 and fit.cost(found) <= fit.cost(true)
    for one, other in zip(found, true, strict=True):
        assert np.hypot(one.x_mm - other.x_mm, one.y_mm - other.y_mm) < 0.7


def test_what_a_disc_explains_is_what_leaving_it_out_costs():
    """With changes at the joint least-squares optimum."""
    model = prebuilt()[0]
    fit = fit_of(model)
    places = [(-40.0, 20.0, 12.0), (10.0, -5.0, 15.0), (20.0, -18.0, 15.0)]
    atoms = np.array([fit.answer(Disc(*place, 1.0)) for place in places]).T
    changes = np.linalg.lstsq(atoms, fit.y, rcond=None)[0]
    discs = [Disc(*place, float(c)) for place, c in zip(places, changes, strict=True)]
    whole, left = float(fit.y @ fit.y), fit.residual(discs)
    for k, found in enumerate(fit.explained(discs, whole)):
        rest = np.delete(atoms, k, axis=1)
        without = fit.y - rest @ np.linalg.lstsq(rest, fit.y, rcond=None)[0]
        assert found == pytest.approx(float(without @ without - left @ left) / whole, rel=1e-6)


def test_an_explained_frame_is_the_solvers_problem():
    seen: Explained = oracle(small_model()).explain(small().frames(4, 1)[0])
    assert seen.project @ seen.y == pytest.approx(seen.y, abs=1e-12)
    assert seen.project @ seen.s == pytest.approx(seen.s, abs=1e-12)
