"""A model taught from a few presses finds others without any sign; odd places are reported."""

from dataclasses import replace

import numpy as np
import pytest

from all_engines import AllEngines
from eitskin.arrays import FloatArray
from eitskin.cli.teach_fit import described_skin
from eitskin.errors import ConfigError, FrameError, UsageError
from eitskin.model.eitm import decode_model, encode_model
from eitskin.teaching.kernel import Placement, placement_text
from eitskin.teaching.left_out import CHI2_90, ellipse_factor, leave_one_out, without_own
from eitskin.teaching.make import taught_model
from eitskin.teaching.presses import Presses, aged, shifted
from eitskin.teaching.teach import Taught, best_share, near_sums, size_law, solve_presses, teach
from simulated_presses import RADIUS_MM, SKIN, TRUE, presses


@pytest.fixture(scope="module")
def taught() -> Taught:
    return teach(presses(30), SKIN)


def test_presses_never_seen_are_found(taught):
    error, count, *_ = solve_presses(taught.model, presses(40, seed=2))
    assert np.median(error) < 0.05 * 2 * RADIUS_MM and np.mean(count == 1) > 0.9
    own = taught.report["error_mm"]["held_out_median"]
    assert 0.3 * np.median(error) < own < 3 * np.median(error)
    turn = taught.report["placement"]["turn_deg"]
    assert turn == pytest.approx(TRUE.turn_deg, abs=3)
    assert not taught.report["placement"]["mirrored"]
    assert taught.report["notes"][0].startswith("touches have a force: depth")


def test_a_turn_is_said_the_short_way_round():
    said = [placement_text(Placement(turn)) for turn in (0.04, 359.97, -0.02, 350.0, 180.0, -181.0)]
    assert said[:3] == ["not turned, scaled by 1.000"] * 3
    assert [text.split()[2] for text in said[3:]] == ["-10.0", "-180.0", "179.0"]


def test_ellipses_cover_about_what_they_say(taught):
    """Thirty presses do not determine the factor of their ellipses well, so the model has none."""
    judged, factor = presses(100, seed=2), ellipse_factor(taught.held.mahalanobis2)
    assert taught.model.place_factor == 0 and taught.report["ellipse_factor"] is None
    squared = solve_presses(replace(taught.model, place_factor=factor), judged)[3]
    assert 0.65 < np.mean(squared < CHI2_90) < 0.97
    assert ellipse_factor(np.arange(1.0, 51.0)) == 46 / CHI2_90


def test_a_press_left_out_has_no_part_in_the_noise():
    """Products are those of the inverse covariance without its residual."""
    draw = np.random.default_rng(4)
    residual, data = draw.normal(size=8), draw.normal(size=(3, 8))
    share = 0.7 / (residual @ residual)
    white = data + without_own(residual, share, data)
    inverse = np.linalg.inv(np.eye(8) - share * np.outer(residual, residual))
    assert white @ white.T == pytest.approx(data @ inverse @ data.T)


def with_shuffled_places() -> Presses:
    some = presses(30)
    return replace(some, place_mm=some.place_mm[np.random.default_rng(3).permutation(30)])


def test_shuffled_places_are_refused():
    with pytest.raises(FrameError, match="do not explain the voltages"):
        teach(with_shuffled_places(), SKIN)


@pytest.mark.long("test_shuffled_places_are_refused")
def test_shuffled_places_teach_nothing():
    """Made all the same, such a model answers about the middle, or anywhere."""
    made = teach(with_shuffled_places(), SKIN, refuse=False).model
    error, *_ = solve_presses(made, presses(40, seed=2))
    assert np.median(error) > 0.25 * 2 * RADIUS_MM


def test_the_file_brings_its_own_options_and_every_engine_agrees(taught):
    model = decode_model(encode_model(taught.model), "taught")
    some = presses(8, seed=5)
    away = np.linalg.norm(some.place_mm[:, None] - some.place_mm, axis=2)
    both = np.argwhere(np.triu(away > RADIUS_MM))[:6]
    model = replace(model, place_factor=4.0)
    cores = AllEngines(model, solver="fista")
    found: dict[str, list[FloatArray]] = {name: [] for name in cores}
    variances: dict[str, list[list[float | None]]] = {name: [] for name in cores}
    exact = 0
    for core in cores.values():
        assert not core.options.project_reference and core.options.touch_seek
        assert core.options.touch_fit == 0
    for i, j in both:
        cores.forget()
        cores.tare(some.untouched[i])
        made = cores.reconstruct(some.pressed[i] + some.difference[j])
        for engine, result in made.items():
            found[engine].append(np.array([(one.x_mm, one.y_mm) for one in result.touches]))
            variances[engine] += [
                [t.x_variance_mm2, t.xy_covariance_mm2, t.y_variance_mm2] for t in result.touches
            ]
    images = {engine: result.solver_image for engine, result in made.items()}
    size = images["numpy"].max()
    assert images["c64"] == pytest.approx(images["numpy"], abs=1e-9 * size)
    for c32, c64 in zip(found["c"], found["c64"], strict=True):
        assert c32 == pytest.approx(c64, abs=0.02)
    known = np.array(variances["c64"])
    assert np.min(known[:, [0, 2]]) > 0
    assert variances["c"] == pytest.approx(known, abs=1e-2 * known.max())
    for (i, j), seen in zip(both, found["c"], strict=True):
        apart = np.linalg.norm(seen[:, None] - some.place_mm[[i, j]], axis=2)
        exact += len(seen) == 2 and apart.min(axis=0).max() < 0.1 * 2 * RADIUS_MM
    assert exact >= 3


def test_a_row_left_out_is_filled_in_by_every_engine_alike(taught):
    judged = presses(25, seed=5)
    out, median = np.arange(judged.protocol.n_rows) < 9, []
    whole = taught_model(
        taught.learned, judged.protocol, taught.model.grid, judged.untouched, 0.2, rank=14
    )
    for precision in (whole.precision, None):
        cores, errors = AllEngines(replace(whole, precision=precision), solver="fista"), []
        cores.mask_rows(out)
        for i in range(25):
            if i == 1:
                del cores["c64"], cores["numpy"]
            cores.forget()
            cores.tare(judged.untouched[i])
            found = cores.reconstruct(judged.pressed[i])
            if not i:
                image = found["numpy"].solver_image
                assert found["c64"].solver_image == pytest.approx(image, abs=1e-6 * image.max())
            touches = found["c"].touches[:1]
            at = [(one.x_mm, one.y_mm) for one in touches] or [(2 * RADIUS_MM, 0.0)]
            errors.append(float(np.linalg.norm(at[0] - judged.place_mm[i])))
        median.append(np.median(errors))
    assert median[0] < median[1]


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (lambda p: replace(p, place_mm=p.place_mm * (1, -1)), "mirrored relative to"),
        (lambda p: replace(p, place_mm=0.6 * p.place_mm), "0.62 times as large as described"),
        (lambda p: p.take(p.place_mm[:, 0] > 0), "elsewhere the model is only an extrapolation"),
        (lambda p: shifted(p, 1), "as if one more came first"),
        pytest.param(
            lambda p: shifted(p, -3),
            "as if the first 3 were missed",
            marks=pytest.mark.long("one too many"),
        ),
    ],
    ids=["mirrored", "another unit", "one half", "one too many", "three missed"],
)
def test_odd_places_are_told_and_taught(change, note):
    taught = teach(change(presses(30)), SKIN)
    assert sum(note in one for one in taught.report["notes"]) == 1
    assert taught.report["error_mm"]["held_out_median"] < 0.05 * 2 * RADIUS_MM


def test_the_share_serves_single_presses_and_sums_of_two():
    """Few sums have no say; many may cost a few single presses, not more."""
    alone, reported = np.array([0.9, 0.94, 0.96, 1.0]), np.array([0.9, 0.85, 0.7, 0.5])
    two = np.linspace(0, 1, 200)[None] < reported[:, None]
    assert best_share(alone, two) == 1 and best_share(alone, two[:, :0]) == 2
    assert best_share(0.9 * alone, two[:, :0]) == 3
    place = presses(40).place_mm
    pairs = near_sums(place, 2 * RADIUS_MM)
    away = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
    assert len(pairs) == 30 and away.min() > 26 and away.max() < 41


def test_more_presses_are_not_promised_wonders(taught):
    """The gain that more presses would bring is not overestimated: the error with five of thirty
    presses is very large, and its fall must not be continued."""
    curve = taught.report["held_out_by_presses"]
    assert 0.5 * curve["measured_24"] < curve["expected_120"] < curve["expected_60"]


def test_presses_of_one_depth_give_no_force_and_say_so(taught):
    one = replace(taught.held, which=np.zeros(30, dtype=int))
    law, notes = size_law(presses(30), one, taught.model.grid)
    assert law is None and "1 different depths or forces are too few" in notes[0]


def test_drift_that_is_known_as_noise_does_less_harm():
    """A skin that creeps by one pattern; the reference is eight presses old."""
    some, steps = presses(80), np.random.default_rng(6).normal(size=80).cumsum()
    pattern = np.random.default_rng(4).normal(size=some.protocol.n_rows)
    creep = 2e-3 * steps[:, None] * pattern
    some = replace(some, untouched=some.untouched + creep, pressed=some.pressed + creep)
    known, judged, errors = some.take(np.arange(40)), aged(some, 8).take(np.arange(40, 80)), {}
    for age in (0, 8):
        taught = teach(known, SKIN, reference_age=age)
        errors[age] = float(np.median(solve_presses(taught.model, judged)[0]))
        assert taught.report["reference_age"] == age
    assert errors[8] < 0.5 * errors[0]
    assert 0.3 * errors[8] < taught.report["error_mm"]["held_out_median"] < 3 * errors[8]
    with pytest.raises(UsageError, match="40 presses show the drift over 0 to 20 presses"):
        teach(known, SKIN, reference_age=21)


def test_a_press_that_does_not_fit_is_named(taught):
    some = presses(30)
    pressed = some.pressed.copy()
    pressed[7] += pressed[(7 + 11) % 30] - some.untouched[(7 + 11) % 30]
    report = teach(replace(some, pressed=pressed), SKIN).report
    assert 7 in report["strange_presses"] and len(report["strange_presses"]) <= 4
    every = replace(some, pressed=some.pressed + np.roll(some.difference, 11, axis=0))
    assert any("with one finger" in note for note in teach(every, SKIN).report["notes"])


def test_without_a_description_a_stationary_kernel_says_what_is_lost():
    taught = teach(presses(30), None)
    assert any("give --skin" in note for note in taught.report["notes"])
    assert np.isfinite(leave_one_out(taught.learned, taught.model.grid).error_mm).all()


@pytest.mark.parametrize("text", ["a = [", "x = " + 5000 * "[", "a." * 2000 + "b = 1"])
def test_a_description_that_is_none_is_refused_in_one_line(text):
    with pytest.raises(ConfigError, match=r"own description: not .*; give --skin"):
        described_skin(replace(presses(10), skin=text), None)
