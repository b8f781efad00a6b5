"""The experiment on drive patterns: the noise of each row, the bound, and a small
run."""

from pathlib import Path

import numpy as np
import pytest

from eitskin.frames.front_end import Demand
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TouchScene, TrueTouch
from eitskin.skin.protocol import adjacent, pattern
from eitskin.skin.skin import paper_skin
from eitskin_studies.benchmarks.limit_bound import bounds_of, touch_slopes_v
from eitskin_studies.experiments import patterns
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.patterns import measuring, noise
from study_pages import coarse, fills_its_page, goes_on


@pytest.fixture(scope="module")
def disk() -> RoundSkin:
    return RoundSkin(paper_skin(), adjacent(16))


def test_the_bound_falls_with_the_noise_and_has_no_prior_of_the_place(disk):
    scene = TouchScene("one", (TrueTouch(30.0, 10.0, 9.0, 5.0),))
    slopes = touch_slopes_v(disk, scene.touches)
    noisy, quiet = (bounds_of(slopes / sigma, scene.touches)[0].median_mm for sigma in (4e-4, 1e-4))
    assert 3.5 < noisy / quiet <= 4.2
    assert bounds_of(1e-2 * slopes, scene.touches)[0].median_mm > 1e3


def test_each_noise_of_rows():
    v0_v = np.array([1.0, 0.3, 0.1, 0.5, 0.01, 0.2])
    rows = noise.Rows(v0_v, np.array([0, 0, 0, 1, 1, 1]), Demand(800.0, 9000.0))
    gains = noise.row_gain(rows)
    assert gains.tolist() == [1, 2, 8, 2, 64, 4] and (gains * v0_v <= 1).all()

    def of(name: str) -> np.ndarray:
        return noise.NOISES[name](rows, rows, 1e-3)

    assert of("volts") == pytest.approx(1e-3) == of("converter, one gain")
    assert of("converter, gain per drive") == pytest.approx([1e-3] * 3 + [5e-4] * 3)
    assert of("converter, gain per row") == pytest.approx(1e-3 / gains)
    assert of("both, one gain") == pytest.approx(1e-3)
    assert of("both, gain per row") == pytest.approx(1e-3 * np.sqrt(0.5 + 0.5 / gains**2))
    # 12 bits of 3.3 V, 1.2 codes of jitter and rounding, 80 samples, gain 3, half of 1 mA
    code_v = 3.3 / 4096 * np.hypot(1.2, 12**-0.5) * np.sqrt(2 / 80)
    assert of("front end as described") == pytest.approx(2 * code_v / 3, rel=5e-3)
    assert (of("front end, gain per row") <= of("front end as described")).all()


def test_every_drive_of_an_even_disk_has_the_same_greatest_voltage():
    for name in ("adjacent", "skip-3", "opposite"):
        protocol = pattern(16, name)
        v0_v = RoundSkin(paper_skin(), protocol).voltages([])
        rows = noise.rows_of(protocol, v0_v, Demand(1.0, 1.0))
        by_drive = noise.converter_by_drive(rows, rows, 1e-3)
        assert by_drive == pytest.approx(noise.converter(rows, rows, 1e-3))


def small(folder: Path) -> ExperimentOutcome:
    names = ("adjacent", "skip-3/adjacent")
    kinds = {name: noise.NOISES[name] for name in ("volts", "converter, gain per row")}
    with pytest.MonkeyPatch.context() as patch:
        for module in (patterns, measuring):
            patch.setattr(module, "PATTERNS", names)
            patch.setattr(module, "NOISES", kinds)
        patch.setattr(measuring, "MODEL_ELEMENTS", 900)
        return patterns.run(coarse(folder, 0.02))


@pytest.mark.long("the tests above, test_experiments.py")
def test_a_small_run_fills_the_page_and_goes_on(tmp_path):
    outcome = small(tmp_path)
    text = fills_its_page(outcome, "patterns", tmp_path)
    assert "the least bound has" in text
    assert len(outcome.data["cells"]) == 4
    goes_on(lambda: small(tmp_path), outcome, solves=True)
