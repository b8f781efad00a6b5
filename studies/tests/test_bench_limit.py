"""``eitskin bench limit``: the bound holds for a fit that reaches it, and the page says what
fails."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import UsageError
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_shape import TouchShape
from eitskin.skin.protocol import adjacent, opposite
from eitskin.skin.skin import paper_skin
from eitskin_studies.benchmarks import limit, limit_bound, limit_page, limit_scenes
from eitskin_studies.benchmarks.limit_scenes import exact_scenes
from eitskin_studies.experiments.electrodes.patterns import from_transfer
from eitskin_studies.harness.sections import fill_marks
from eitskin_studies.pictures.limit_picture import limit_drawing
from study_pages import page_copy

SCENES = 3


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("limit")


@pytest.fixture(scope="module")
def result(cache):
    return limit.run(limit.Settings(SCENES, 1, ("discs",), ("adjacent",), cache=cache))


def test_a_short_run_gives_every_line_and_fills_the_page(result, cache, tmp_path):
    names = {table: [row.name for row in result.table(table)] for table in limit_page.FIRST}
    assert names["touches"] == ["discs, 60 dB"]
    assert names["snr"] == ["40 dB", "50 dB", "60 dB", "70 dB", "80 dB"]
    assert len(names["place"]) == 4 and len(names["contrast"]) == 3
    assert names["pattern"] == [f"adjacent, {noise}" for noise in (limit.OWN_DB, limit.VOLTS)]
    (whole,) = result.table("touches")
    assert whole.scenes == SCENES and whole.found.hits >= 0.8 * whole.touches
    assert sum(row.touches for row in result.table("place")) == whole.touches
    assert whole.median_mm > 0.5 * whole.bound_mm > 0 and whole.macs_worst > 0
    falling = [row.bound_mm for row in result.table("snr")]
    assert falling == sorted(falling, reverse=True)
    values = json.loads(json.dumps(result.as_dict()))
    assert values["seed"] == 1 and values["commit"] == result.commit
    assert values["rows"][0]["ratio"] == pytest.approx(whole.ratio, abs=1e-4)
    page = page_copy(tmp_path, "limit")
    fill_marks(page, "limit", limit_page.for_page(result, "the command"))
    text = page.read_text()
    assert "Made by `the command`" in text and "| 40 dB |" in text
    assert text.index("<!-- fails -->") < text.index("<!-- conditions -->")
    limit_drawing(result)(tmp_path / "p.png")
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    kept = {path: path.stat().st_mtime_ns for path in cache.iterdir()}
    assert len(kept) == SCENES
    again = limit.run(limit.Settings(SCENES, 1, ("discs",), (), cache=cache))
    assert again.table("touches") == result.table("touches")
    assert {path: path.stat().st_mtime_ns for path in cache.iterdir()} == kept


def test_a_linear_fit_on_the_exact_slopes_reaches_the_bound():
    """The estimate of linearised frames, with contacts from the tare and touches from the priors,
    scatters as the bound says."""
    (scene,) = exact_scenes(paper_skin(), "discs", 1, 3)
    protocol, rng = adjacent(16), np.random.default_rng(1)
    sigma_v = 1e-3 * np.sqrt(np.mean(from_transfer(scene.untouched_v, protocol) ** 2))
    (bound, *_) = limit_bound.bounds(scene, protocol, sigma_v, 64, 0.1)
    touch = from_transfer(scene.slopes_v, protocol) / sigma_v
    tare, frame = from_transfer(scene.contact_slopes_v, protocol) / sigma_v
    slopes = np.block([[touch, np.zeros_like(touch)], [frame, 8 * tare]])
    own = [np.inf, np.inf, 0.35, 0.17]
    prior = np.diag(np.array([*own * len(scene.touches), *[0.1] * 16]) ** -2.0)
    draws = 3000
    true = rng.standard_normal((draws, len(slopes))) * np.sqrt(
        [value and 1 / value for value in np.diag(prior)]
    )
    data = true @ slopes + rng.standard_normal((draws, slopes.shape[1]))
    found = np.linalg.solve(slopes @ slopes.T + prior, slopes @ data.T).T
    off = np.hypot(*(found - true)[:, :2].T)
    assert np.median(off) == pytest.approx(bound.median_mm, rel=0.06)


@pytest.mark.parametrize("parameter", range(6))
def test_each_parameter_moves_a_touch_as_its_name_says(parameter):
    one = TrueTouch(10.0, 5.0, 8.0, 4.0, TouchShape("flat", 1.5, 20.0))
    moved = limit_bound._moved(one, parameter, 0.1)
    eta, other = (
        (t.shape.aspect - 1) / (t.shape.aspect + 1) * np.exp(2j * np.radians(t.shape.angle_deg))
        for t in (one, moved)
    )
    q, p = (2 * (t.contrast - 1) / (t.contrast + 1) for t in (one, moved))
    steps = [
        moved.x_mm - one.x_mm, moved.y_mm - one.y_mm, math.log(moved.radius_mm / one.radius_mm),
        p - q, (other - eta).real, (other - eta).imag,
    ]  # fmt: skip
    assert np.allclose(steps, 0.1 * np.eye(6)[parameter], atol=1e-12)


def test_fingers_take_a_third_of_the_scenes(monkeypatch):
    monkeypatch.setattr(limit_scenes, "exact_scene", lambda *given: given)
    drawn = {name: exact_scenes(paper_skin(), name, 6, 1) for name in ("ellipses", "fingers")}
    assert {name: len(scenes) for name, scenes in drawn.items()} == {"ellipses": 6, "fingers": 2}


def test_slopes_are_those_of_the_exact_frames():
    (scene,) = exact_scenes(paper_skin(), "ellipses", 1, 2)
    assert len(scene.slopes_v) == 6 * len(scene.touches)
    skin, contact = paper_skin(), np.full(16, 0.01)
    touches = (TrueTouch(30.0, -20.0, 9.0, 5.0),)
    one = limit_bound.exact_scene(skin, touches, contact)
    ahead = RoundSkin(skin, limit_bound.transfer(16), contact).voltages(
        (replace(touches[0], x_mm=30.01),)
    )
    slope = one.slopes_v[0]
    assert np.allclose((ahead - one.touched_v) / 0.01, slope, atol=2e-3 * np.abs(slope).max())


def test_contacts_that_the_tare_shows_leave_the_bound_where_it_is():
    (scene,) = exact_scenes(paper_skin(), "discs", 1, 1)
    free, known = (limit_bound.bounds(scene, adjacent(16), 4e-4, 64, sd) for sd in (0.3, 1e-6))
    for one, other in zip(free, known, strict=True):
        assert other.median_mm <= one.median_mm <= 1.02 * other.median_mm


def test_other_patterns_bound_differently_at_the_same_volts():
    (scene,) = exact_scenes(paper_skin(), "discs", 1, 1)
    bound = {
        protocol.n_rows: limit_bound.bounds(scene, protocol, 3.6e-4, 64, 0.1)[0].median_mm
        for protocol in (adjacent(16), opposite(16))
    }
    assert bound[192] < 0.6 * bound[208]


def test_lines_count_what_was_found_and_covered():
    true = TrueTouch(0.0, 0.0, 8.0, 4.0)
    bound = limit_bound.Bound(0.01 * np.eye(2), 0.05)
    hit = limit.TouchResult(true, 97.0, bound, 0.3, -1.0, False)
    missed = limit.TouchResult(true, 97.0, bound)
    scenes = [limit.SceneResult((hit, missed), False, 10), limit.SceneResult((hit,), True, 30)]
    line = limit.row("touches", "x", scenes)
    assert (line.found.hits, line.touches, line.exact.hits) == (2, 3, 1)
    assert (line.macs_mean, line.macs_worst) == (20, 30)
    assert line.bound_mm == pytest.approx(0.1 * math.sqrt(2 * math.log(2)), rel=0.03)
    words = limit_page.failures(line)
    assert [word[:9] for word in words] == ["error 2.5", "50 % (9 t", "ellipses "]
    none = limit.row("touches", "x", [limit.SceneResult((missed,), False, 0)])
    assert limit_page.failures(none) == ["no touch was found"]
    assert none.as_dict()["median_mm"] is None


def test_a_place_within_the_ellipse_is_covered():
    found = Touch(1, 0.0, 0.0, 8.0, 1.0, 0.5, 0.0, None, 4.0, 0.0, 1.0)
    for x, y, inside in ((4.2, 0.0, True), (4.4, 0.0, False), (0.0, 2.2, False)):
        assert limit._covered(TrueTouch(x, y, 8.0, 4.0), found) is inside
    assert limit._covered(TrueTouch(0.0, 0.0, 8.0, 4.0), replace(found, x_variance_mm2=0)) is None


def test_unknown_names_are_refused():
    with pytest.raises(UsageError, match="no set is named 'disks'"):
        limit.run(limit.Settings(1, 1, ("disks",)))
    with pytest.raises(UsageError, match="no pattern is named"):
        limit.run(limit.Settings(1, 1, patterns=("skip-9",)))
    assert main(["bench", "limit", "--scenes", "0"]) != 0
