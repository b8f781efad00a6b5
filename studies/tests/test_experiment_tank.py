"""The study on measured tank frames: what it refuses, simulates and scores, and its results if the
measured frames are available."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.progress import silent
from eitskin.scene.random_touches import random_touches
from eitskin.scoring import metrics
from eitskin.skin.skin import load_skin
from eitskin_studies.experiments import tank as study
from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace, workspace_in
from eitskin_studies.experiments.tank.discs import VARIANTS
from eitskin_studies.experiments.tank.imagers import (
    DISCS,
    KINDS,
    TUNED_DISCS,
    Levers,
    datum,
    disc_kernel,
)
from eitskin_studies.experiments.tank.levers import chosen, one_by_one, together, words_of
from eitskin_studies.experiments.tank.scenes import RULES, simulated, with_signs
from eitskin_studies.experiments.tank.signed_scores import jittered_truth, places, signed_miou
from eitskin_studies.experiments.tank.tables import CHOSEN
from eitskin_studies.experiments.tank.tanks import (
    TOUCH_LIKE,
    folder_of,
    phantoms,
    reciprocal_share,
    rods,
    tank,
)
from study_pages import fills_its_page, goes_on, workspace

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "tank_kit4.toml"


def test_without_frames_it_says_what_to_give(tmp_path, capsys):
    found = main(["study", "tank", "-o", str(tmp_path / "out"), "--no-pictures"])
    assert found == UsageError.exit_code
    said = capsys.readouterr().err.strip()
    assert "--data DIR" in said and "kit4_dev.npz" in said and "\n" not in said
    with pytest.raises(UsageError, match=r"has no kit4_dev\.npz"):
        folder_of(tmp_path)


def test_the_tank_is_that_of_the_example():
    skin, protocol = tank()
    example, scan = load_skin(EXAMPLE)
    assert (skin, protocol.hash) == (example, scan.hash)


def test_kinds_of_data_agree_for_small_changes():
    reference = np.array([2.0, -1.0, 0.5])
    frame = reference * (1 + 1e-6 * np.array([[1.0, -2.0, 3.0]]))
    plain_v = datum("difference", frame, reference)
    assert datum("normalised", frame, reference) * reference == pytest.approx(plain_v, rel=1e-9)
    assert datum("log-ratio", frame, reference) == pytest.approx(plain_v, rel=1e-5)


def test_atoms_are_discs():
    grid = grid_for(tank()[0].outline, 32)
    assert np.array_equal(disc_kernel(grid, 0), np.eye(grid.n_pixels))
    kernel = disc_kernel(grid, 2.0)
    middle = int(np.argmin((grid.centres_mm() ** 2).sum(axis=1)))
    assert kernel[middle, middle] == 1.0
    assert kernel[:, middle].sum() == pytest.approx(np.pi * 4, rel=0.03)


def test_one_sign_is_judged_as_everywhere_and_a_wrong_sign_counts():
    generator = np.random.default_rng(3)
    shown, true = generator.random((2, 500)) < 0.3
    none = np.zeros(500, dtype=bool)
    assert signed_miou(shown, none, true, none) == pytest.approx(metrics.miou(shown, true))
    assert signed_miou(true, none, true, none) == 1.0
    assert signed_miou(none, true, true, none) < 0.51


def test_places_of_both_signs_share_a_threshold():
    grid = grid_for(tank()[0].outline, 32)
    centres = grid.centres_mm()
    at = np.array([[60.0, 0.0], [-60.0, 0.0]])
    near = np.exp(-((centres - at[:, None]) ** 2).sum(axis=2) / 200)
    image = near[0] - 0.4 * near[1]
    up, down = places(image, grid.index, centres, 0.3)
    assert np.hypot(*(up[0] - at[0])) < 3 and np.hypot(*(down[0] - at[1])) < 3
    assert [len(part) for part in places(image, grid.index, centres, 0.5)] == [1, 0]


def test_truth_that_is_further_off_scores_less():
    points = metrics.raster_inside(tank()[0].outline, 4.0).points_mm
    centres, radii = np.array([[30.0, 10.0]]), np.array([25.0])
    truth = metrics.disc_mask(points, centres, radii)
    scores = [jittered_truth(points, truth, centres, radii, off, 1, 10) for off in (0.0, 4.0, 8.0)]
    assert scores[0] == 1.0 and scores[0] > scores[1] > scores[2]
    assert jittered_truth(points, truth, centres, radii, 4.0, 1, 10) == scores[1]


def test_signs_turn_about_half_and_nothing_else():
    drawn = random_touches(tank()[0].outline, 1, 30, "tank mixed", RULES)
    turned = with_signs(drawn)
    before = [touch for scene in drawn.scenes for touch in scene.touches]
    after = [touch for scene in turned.scenes for touch in scene.touches]
    assert 0.3 < np.mean([touch.contrast < 1 for touch in after]) < 0.7
    alike = [[replace(one, contrast=1.0) for one in some] for some in (before, after)]
    assert alike[0] == alike[1]
    assert with_signs(drawn).scenes == turned.scenes


def test_simulated_noise_is_the_share_of_each_change(tmp_path):
    shop = workspace(tmp_path)
    raster = metrics.raster_inside(tank()[0].outline, 5.0)
    clean, noisy = (simulated(shop, 1, 4, True, raster, share) for share in (0.0, 0.05))
    change = clean.frames_v - clean.untouched_v
    noise = noisy.frames_v - clean.frames_v
    shares = np.sqrt((noise**2).mean(axis=1) / (change**2).mean(axis=1))
    assert shares == pytest.approx(np.full(4, 0.05), rel=0.2)
    assert not (clean.conductive & clean.resistive).any()
    assert sum(map(len, clean.conductive_mm)) + sum(map(len, clean.resistive_mm)) >= 4


def test_levers_are_named_by_what_differs():
    assert words_of(Levers()) == "defaults"
    assert words_of(Levers(regularisation=0.1, blur=1.0)) == "mu 0.1, blur of 1 pixels"
    assert len(set(one_by_one("difference"))) == len(one_by_one("difference"))
    assert Levers() in together("difference")
    other = Levers(regularisation=0.1)
    found = {Levers(): {"tuned": 0.8, "macs": 9}, other: {"tuned": 0.8001, "macs": 5}}
    assert chosen(found) == other


def with_few_values(patch: pytest.MonkeyPatch) -> None:
    for name, values in (
        ("REGULARISATIONS", (0.01,)),
        ("ITERATIONS", (60,)),
        ("LAMBDAS", (0.03,)),
        ("PAINTS", ((0.0, 0.0), (2.0, 0.0))),
    ):
        patch.setattr(f"eitskin_studies.experiments.tank.levers.{name}", values)
    for name, tried in (("RATIOS", (1e-3,)), ("STRENGTHS", (1e-3,)), ("STEPS", (20,))):
        patch.setattr(f"eitskin_studies.compare.methods.{name}", tried)
    patch.setattr("eitskin_studies.experiments.tank.discs.VARIANTS", VARIANTS[:2])
    patch.setattr("eitskin_studies.experiments.tank.imagers.CHANGE_RATIOS", (2.0,))


@pytest.fixture(scope="module")
def outcome(shared_data, tmp_path_factory) -> tuple[Workspace, ExperimentOutcome]:
    shop = workspace(tmp_path_factory.mktemp("tank"), 0.05, data=shared_data)
    with pytest.MonkeyPatch.context() as patch:
        with_few_values(patch)
        return shop, study.run(shop)


def test_every_method_every_kind_every_frame(outcome):
    results = outcome[1].data["results"]
    kinds = {(one["name"], one["kind"]) for one in results}
    names = {name for name, _ in kinds} - {CHOSEN, TUNED_DISCS}
    assert len(names) >= 9 and all((name, kind) in kinds for name in names for kind in KINDS)
    for one in results:
        assert len(one["touch_like"]) == len(TOUCH_LIKE) and len(one.get("nine", range(9))) == 9
        assert all(0 <= score <= 1 for score in one["touch_like"])
    tables = {table.name: table for table in outcome[1].tables}
    assert set(tables) == {"touch_like", "kinds", "nine", "rods", "levers", "discs", "ceiling"}


def test_discs_on_ratios_find_every_metal_object_and_reach_the_target(outcome):
    of_kind = {(one["name"], one["kind"]): one for one in outcome[1].data["results"]}
    discs = of_kind[DISCS, "log-ratio"]
    assert (discs["touch_like_places"]["found"], discs["touch_like_places"]["false"]) == (8, 0)
    assert np.mean(discs["touch_like"]) >= 0.85


def test_atoms_show_large_objects_better_than_pixels(outcome):
    means = {str(one["levers"]): np.mean(one["touch_like"]) for one in outcome[1].data["levers"]}
    assert means[str(vars(Levers(atom=2.0)))] > means[str(vars(Levers()))] + 0.03


def test_a_run_that_goes_on_computes_nothing_again(outcome, monkeypatch):
    shop, first = outcome
    with_few_values(monkeypatch)
    again = workspace_in(shop.folder, shop.settings, silent)
    goes_on(lambda: study.run(again), first, solves=True)


def test_it_fills_its_page(outcome, tmp_path):
    assert set(outcome[1].pictures) == {"touch_like.png", "all_frames.png", "curves.png"}
    # all frames: the same function as touch-like ones, in half a minute
    fills_its_page(outcome[1], "tank", tmp_path, but=("all_frames.png",))


def test_measured_frames_as_they_are_said_to_be(shared_data):
    frames = phantoms(shared_data)
    assert set(TOUCH_LIKE) <= set(frames.frame_name)
    assert 0.02 < np.median(reciprocal_share(frames)) < 0.1
    one, two = rods(shared_data)
    found = len(one.metal_mm), len(one.plastic_mm), len(two.metal_mm), len(two.plastic_mm)
    assert found == (1, 0, 2, 2)
    assert one.metal_mm[0, 1] > 70 and abs(one.metal_mm[0, 0]) < 1
