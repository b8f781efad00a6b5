"""The comparison: fixed on training scenes, judged on test scenes, the same for every method, the
same every time."""

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.scene.random_touches import random_touches
from eitskin.scoring import metrics
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare import baselines
from eitskin_studies.compare.families import Family, FindsTouches, Learns, Setup
from eitskin_studies.compare.methods import baseline_methods
from eitskin_studies.compare.run import CompareSettings, Comparison, compare, truth_masks
from eitskin_studies.compare.table import CSV_COLUMNS, header, to_csv, to_json, to_text
from eitskin_studies.harness.thresholds import THRESHOLDS, miou_curves

SKIN, PROTOCOL = paper_skin(), adjacent(16)
SMALL = CompareSettings(
    scenes=8, train_scenes=6, seed=3, elements=1500, simulated_elements=2500, lookup="nearest"
)


def quick(setup: Setup) -> tuple[Family, ...]:
    return (
        Family("", (0.0,), lambda _: baselines.back_projection(setup.jacobian)),
        Family("strength", (1e-5, 1e-2), lambda a: baselines.noser(setup.jacobian, a)),
    )


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare(SKIN, PROTOCOL, SMALL, families=quick)


def test_results_are_what_their_parts_give(comparison):
    """Thresholds, parameter and MIoU of the second method, worked out again from frames and
    truth."""
    setup, result = comparison.setup, comparison.results[1]
    image_scorer = metrics.judge_for(SKIN.outline, setup.grid, lookup="nearest")

    def curves(strength: float, of: str) -> np.ndarray:
        session = getattr(comparison, of)
        images = baselines.noser(setup.jacobian, strength).reconstruct(session.differences_v())
        truths = truth_masks(session.touches, image_scorer.raster.points_mm)
        return miou_curves(image_scorer, images, truths)

    best = max((1e-5, 1e-2), key=lambda a: curves(a, "train").mean(axis=0).max())
    assert result.value == best
    at = int(np.argmax(curves(best, "train").mean(axis=0)))
    assert result.threshold == THRESHOLDS[at]
    assert result.train_miou == pytest.approx(curves(best, "train").mean(axis=0)[at])
    assert result.miou == pytest.approx(curves(best, "test")[:, at])
    assert result.curve == pytest.approx(curves(best, "test").mean(axis=0))
    assert result.miou_summary.mean == pytest.approx(result.curve[at])
    assert 0.6 < result.miou_summary.mean < comparison.ceiling
    assert result.miou_summary.mean > comparison.results[0].miou_summary.mean


def test_both_methods_saw_the_same_scenes(comparison):
    assert comparison.test.touches == random_touches(SKIN.outline, 3, 8, "test")
    assert comparison.train.touches == random_touches(SKIN.outline, 3, 6, "train")
    assert all(len(r.miou) == len(r.matchings) == len(r.found_mm) == 8 for r in comparison.results)
    assert comparison.test.mesh_elements > comparison.setup.mesh_elements
    assert 0.83 < comparison.ceiling < 0.9


def test_counts_add_up(comparison):
    touches = sum(len(scene.touches) for scene in comparison.test.touches.scenes)
    for result in comparison.results:
        assert sum(m.hits + m.misses for m in result.matchings) == touches
        assert result.hit_share == sum(m.hits for m in result.matchings) / touches
        exact = sum(m.misses + m.false_touches == 0 for m in result.matchings)
        assert result.exact_count == exact / 8
        found = sum(map(len, result.found_mm))
        assert sum(m.hits + m.false_touches for m in result.matchings) == found
        assert result.position_summary.count == sum(m.hits for m in result.matchings)


def without_time(values: dict) -> dict:
    methods = [{**one, "frame_ms": None} for one in values["methods"]]
    return {**values, "methods": methods}


def test_the_same_arguments_give_the_same_numbers(comparison):
    again = compare(SKIN, PROTOCOL, SMALL, families=quick)
    assert without_time(to_json(again)) == without_time(to_json(comparison))
    assert to_csv(again) == to_csv(comparison)


def test_training_does_not_see_the_test_set(comparison):
    fewer = compare(SKIN, PROTOCOL, replace(SMALL, scenes=3), families=quick)
    for short, full in zip(fewer.results, comparison.results, strict=True):
        assert (short.value, short.threshold) == (full.value, full.threshold)
        assert short.touch_threshold == full.touch_threshold
        assert short.miou == pytest.approx(full.miou[:3])


def test_bilinear_lookup_changes_the_numbers_and_says_so(comparison):
    other = compare(SKIN, PROTOCOL, replace(SMALL, lookup="bilinear"), families=quick)
    assert other.ceiling > 0.94
    assert "bilinear" in dict(header(other))["MIoU"]
    assert "nearest" in dict(header(comparison))["MIoU"]
    assert (other.results[1].images == comparison.results[1].images).all()


@dataclass
class Oracle:
    """Knows the truth; finds it by the difference frame it is asked about."""

    grid: object
    known: dict[bytes, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    learned: list[np.ndarray] = field(default_factory=list)
    name: str = "oracle"

    def learn(self, untouched_v: np.ndarray) -> None:
        self.learned.append(untouched_v)

    def reconstruct(self, dv: np.ndarray) -> np.ndarray:
        role = {6: "train", 8: "test"}.get(len(dv))
        if role is None:  # GREIT's small targets
            return np.zeros((len(dv), self.grid.n_pixels))
        scenes = random_touches(SKIN.outline, 3, len(dv), role).scenes
        return np.array([pixel_cover(self.grid, s.centres_mm(), s.radii_mm()) for s in scenes])

    def touches(self, dv: np.ndarray) -> Sequence[np.ndarray]:
        scenes = random_touches(SKIN.outline, 3, len(dv), "test").scenes
        return [scene.centres_mm() for scene in scenes]


def test_a_method_may_learn_and_may_find_touches_itself():
    made: list[Oracle] = []

    def families(setup: Setup) -> tuple[Family, ...]:
        made.append(Oracle(setup.grid))
        assert isinstance(made[0], Learns) and isinstance(made[0], FindsTouches)
        return (Family("", (0.0,), lambda _: made[0]),)

    outcome = compare(SKIN, PROTOCOL, SMALL, families=families)
    result = outcome.results[0]
    assert result.exact_count == 1.0 and result.position_summary.p95 == 0.0
    assert result.hit_share == 1.0 and result.touch_threshold is None
    assert outcome.ceiling - 0.03 < result.miou_summary.mean <= outcome.ceiling + 1e-12
    assert [len(untouched) for untouched in made[0].learned] == [64, 64, 4]
    assert (made[0].learned[0] == outcome.train.untouched_v).all()
    assert (made[0].learned[1] == outcome.test.untouched_v).all()
    assert "own touches" in dict(header(outcome))["positions"]


def test_baselines_do_not_have_those_abilities():
    grid = grid_for(SKIN.outline, 6)
    jacobian = np.random.default_rng(0).normal(size=(10, grid.n_pixels))
    families = baseline_methods(jacobian, grid)
    made = [family.make(family.values[0]) for family in families]
    assert not any(isinstance(method, (Learns, FindsTouches)) for method in made)
    assert [method.name for method in made] == [
        "linear back projection", "Gauss-Newton (Tikhonov)", "NOSER", "GREIT-like",
        "conjugate gradient", "plain FISTA 30, signed", "plain FISTA 300, signed",
        "plain FISTA 30, non-negative", "plain FISTA 300, non-negative",
    ]  # fmt: skip
    assert all(method.reconstruct(np.ones((2, 10))).shape == (2, grid.n_pixels) for method in made)


def test_text_names_every_condition(comparison):
    text = to_text(comparison)
    for part in (
        "test-s3-n8 (seed 3)", "train-s3-n6 (seed 3)", "60 dB", "20 log10(rms(V0) / sigma)",
        "12-bit", "+-20 %",
        f"{comparison.test.mesh_elements} elements", f"{comparison.setup.mesh_elements} elements",
        "1.5 mm",
        "x > t max(x)", "training scenes", "812 pixels", "within 10 mm",
    ):  # fmt: skip
        assert part in text, part
    scores, figures = (part.splitlines()[-4:] for part in text.split("\n\nGREIT's figures"))
    noser = comparison.results[1]
    for lines, number in ((scores, noser.miou_summary.mean), (figures, noser.figures.resolution)):
        assert lines[0].split(" | ")[0].strip() == "method"
        assert lines[-1].startswith("NOSER") and f"{number:.3f}" in lines[-1]


def test_json_is_json_and_csv_is_csv(comparison):
    values = json.loads(json.dumps(to_json(comparison), allow_nan=False))
    assert values["settings"]["seed"] == 3 and values["pixels"] == 812
    assert len(values["methods"][0]["miou_over_threshold"]) == len(values["thresholds"]) == 49
    assert values["methods"][1]["miou"]["mean"] == comparison.results[1].miou_summary.mean
    lines = [line for line in to_csv(comparison).splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    assert tuple(rows[0]) == CSV_COLUMNS and len(rows) == 16
    noser = [float(row["miou"]) for row in rows if row["method"] == "NOSER"]
    assert noser == pytest.approx(comparison.results[1].miou, abs=1e-6)


def test_noise_free_frames_do_no_worse(comparison):
    noiseless = replace(SMALL, measurement=replace(SMALL.measurement, snr_db=None))
    clean = compare(SKIN, PROTOCOL, noiseless, families=quick)
    # of eight scenes; the strength is chosen on training scenes of the same noise
    assert clean.results[1].miou_summary.mean > comparison.results[1].miou_summary.mean - 0.05
    assert "no noise" in dict(header(clean))["SNR"]


def test_progress_is_told_all_work():
    reported: list[tuple[str, int]] = []

    def watch(items: Sequence[object], what: str) -> Sequence[object]:
        reported.append((what, len(items)))
        return items

    few = replace(SMALL, scenes=2, train_scenes=1)
    compare(SKIN, PROTOCOL, few, families=quick, progress=watch)
    assert reported == [("simulating (train)", 1), ("simulating (test)", 2), ("reconstructing", 2)]


def test_impossible_settings_are_refused():
    with pytest.raises(UsageError, match="at least 1 scene"):
        CompareSettings(scenes=0)
    with pytest.raises(UsageError, match="nearest, bilinear"):
        CompareSettings(lookup="cubic")
