"""The experiment on electrodes and patterns: every pattern out of one solve, what time allows,
settings chosen elsewhere."""

from typing import Any

import numpy as np
import pytest

from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.model.build import BuildSettings, linearise, make_model
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import adjacent, skip
from eitskin.skin.skin import Skin
from eitskin_studies.experiments import electrodes
from eitskin_studies.experiments.electrodes import measuring, patterns, tables, tuning
from study_pages import coarse, fills_its_page, goes_on

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


@pytest.mark.parametrize("pattern", list(patterns.PATTERNS))
def test_every_pattern_comes_out_of_the_transfer_matrix(pattern):
    skin = Skin("disk", disk(194.0), Electrodes(16))
    mesh = mesh_for_elements(skin, 800)
    sigma = np.random.default_rng(3).uniform(0.005, 0.05, mesh.n_elements)
    whole = ForwardModel(mesh, skin, patterns.transfer(16)).voltages(sigma)
    protocol = patterns.PATTERNS[pattern](16)
    direct = ForwardModel(mesh, skin, protocol).voltages(sigma)
    np.testing.assert_allclose(
        patterns.from_transfer(whole, protocol), direct, rtol=1e-9, atol=1e-12
    )
    stacked = patterns.from_transfer(np.stack([whole, 2 * whole]), protocol)
    np.testing.assert_allclose(stacked, [direct, 2 * direct], rtol=1e-9, atol=1e-12)


def test_what_fits_into_a_frame():
    assert patterns.samples_within(208) == 80 and patterns.scan_ms(208, 80) == pytest.approx(20.8)
    assert patterns.samples_within(928) == 0
    scans = {count: patterns.within_time(adjacent(count)) for count in (16, 32, 64)}
    fits = [(scan.protocol.n_rows, scan.samples, scan.every) for scan in scans.values()]
    assert fits == [(104, 180, 1), (464, 20, 1), (460, 20, 8)]
    assert all(scan.ms <= 20.8 for scan in scans.values())
    assert patterns.scan_ms(adjacent(64).n_rows, 80) == pytest.approx(390.4)


def test_unique_rows_hold_each_voltage_once():
    scan = patterns.unique_rows(skip(16, 2))
    assert scan.n_rows == 104 and (scan.reciprocal_pairs().second == -1).all()
    thinned = patterns.unique_rows(adjacent(16), 4)
    drives = {tuple(row) for row in thinned.drive_measure[:, :2].tolist()}
    assert drives <= {(0, 1), (4, 5), (8, 9), (12, 13)}


def test_another_regularisation_is_the_model_built_with_it():
    skin = Skin("disk", disk(194.0), Electrodes(16))
    linear = linearise(skin, adjacent(16), pixels_across=12, elements=800)
    usual = make_model(skin, adjacent(16), linear, BuildSettings(rank=40))
    for regularisation in (0.1, 1e-3):
        built = make_model(
            skin, adjacent(16), linear, BuildSettings(rank=40, regularisation=regularisation)
        )
        moved = tuning.with_regularisation(usual, regularisation)
        product, wanted = (
            m.projection.T.astype(np.float64) @ m.sensitivity for m in (moved, built)
        )
        np.testing.assert_allclose(product, wanted, atol=1e-4 * np.abs(wanted).max())
        assert moved.lipschitz == pytest.approx(built.lipschitz, rel=1e-4)
        assert moved.row_form is not None and moved.row_form.fits(moved.projection)
        assert moved.noise_gain == pytest.approx(built.noise_gain, rel=1e-3)


def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "MODEL_ELEMENTS", 1500)
    monkeypatch.setattr(measuring, "PAIR_MM", (24.0, 36.0))
    for module in (electrodes, tables):
        monkeypatch.setattr(module, "COUNTS", (16, 32))
        monkeypatch.setattr(
            module, "PATTERNS", {name: patterns.PATTERNS[name] for name in ("adjacent", "skip 2")}
        )
    monkeypatch.setattr(electrodes, "PAIR_MM", (24.0, 36.0))
    monkeypatch.setattr(electrodes, "SWEEP", {16: (40,), 32: (100,)})
    monkeypatch.setattr(electrodes, "GRIDS", (24,))
    for name, values in (
        ("REGULARISATIONS", (0.01, 1e-3)),
        ("LAMBDAS", (0.03,)),
        ("ITERATIONS", (60,)),
    ):
        monkeypatch.setattr(tuning, name, values)


def test_a_run_and_one_that_goes_on(monkeypatch, tmp_path):
    _few(monkeypatch)
    first = electrodes.run(coarse(tmp_path, 0.03, 2000))
    by_name = {table.name: table for table in first.tables}
    found = {name: len(table.rows) for name, table in by_name.items()}
    assert found == {"noise": 4, "time": 4, "ranks": 6, "scans": 4}
    cases = {
        (of["electrodes"], of["pattern"], of["equal"]): one
        for one in first.data["cases"]
        for of in [one["case"]]
    }
    # a wider pair picks up more of the same current's voltage; more electrodes, nearer to each
    # other, less
    kinds = ((16, "skip 2"), (16, "adjacent"), (32, "adjacent"))
    wide, near, nearer = (cases[n, kind, "noise"]["rms_v0_mv"] for n, kind in kinds)
    assert wide > 3 * near > 3 * nearer
    sixteen = cases[16, "adjacent", "noise"]
    assert first.data["noise_v"] == pytest.approx(1e-6 * sixteen["rms_v0_mv"], rel=0.05)
    assert np.mean(sixteen["scores"]["random"]["image"]) > 0.7
    goes_on(lambda: electrodes.run(coarse(tmp_path, 0.03, 2000)), first)
    fills_its_page(first, "electrodes", tmp_path)


def test_scenes_are_solved_once_for_every_pattern(monkeypatch, tmp_path):
    _few(monkeypatch)
    solved = []
    whole = ForwardModel.voltages
    monkeypatch.setattr(
        ForwardModel,
        "voltages",
        lambda self, *a: solved.append(self.protocol.n_electrodes) or whole(self, *a),
    )
    shop = measuring.PatternWorkspace(coarse(tmp_path, 0.03, 2000), 16)
    for pattern in ("adjacent", "skip 2", "opposite"):
        for equal in ("noise", "time"):
            shop.frames("random", measuring.usual_case(16, pattern, equal), 1e-4)
    parts = len(shop.sets)  # an untouched frame each
    assert len(solved) == sum(len(drawn.scenes) for drawn in shop.sets.values()) + parts


def test_the_least_distance_that_is_told_apart():
    def exact(*shares: float) -> dict[str, Any]:
        counts = {
            mm: round(10 * share) for mm, share in zip(measuring.PAIR_MM, shares, strict=True)
        }
        return {f"pair {mm:g}": {"exact": [1] * k + [0] * (10 - k)} for mm, k in counts.items()}

    assert measuring.resolved_mm(exact(0, 1, 0.5, 0.9, 1, 1)) == 27
    assert measuring.resolved_mm(exact(1, 1, 1, 1, 1, 0.8)) == float("inf")
