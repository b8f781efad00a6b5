"""Accuracy that the prebuilt model must reach on random touches that were not used to choose it:
one to three, 6 to 12 mm, contrast 3 to 10, 60 dB.

Frames are simulated nonlinearly on a mesh four times finer than the model's, with contact
impedances spread by 20 %, white noise and a 12-bit converter. The threshold of the image's mask is
the model's own; nothing here is fitted to these scenes.
"""

import numpy as np
import pytest

from eitskin.scene.simulate import Simulated
from eitskin.scoring.score import FrameScore, scorer_for
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt, session

SEED = 2024


@pytest.fixture(scope="module", params=[60, pytest.param(200, marks=pytest.mark.long("60 scenes"))])
def simulated(request) -> Simulated:
    """scripts/test has 60 scenes, scripts/test --all 200."""
    return session("acceptance", request.param, SEED)


@pytest.fixture(scope="module")
def scores(simulated) -> list[FrameScore]:
    """Each scene by itself, by the float32 core."""
    model, blob = prebuilt()
    frames = simulated.as_frames()
    reconstructor, scorer = Reconstructor(model, blob=blob), scorer_for(model)
    reconstructor.tare(frames.reference_voltage_v)
    found = []
    for number, frame_v in enumerate(frames.voltage_v):
        reconstructor.forget()
        result = reconstructor.reconstruct(frame_v)
        assert result.info.iterations <= 60 and result.info.stop == "iterations"
        found.append(scorer.score(frames, number, result, "increase"))
    return found


def test_the_scenes_are_what_they_should_be(simulated):
    counts = [len(scene.touches) for scene in simulated.touches.scenes]
    assert set(counts) == {1, 2, 3} and min(counts.count(k) for k in (1, 2, 3)) > 0.22 * len(counts)
    assert simulated.mesh_elements > 3 * prebuilt()[0].meta["mesh_elements"]
    rms_v = np.sqrt(np.mean(simulated.exact_untouched_v**2))
    assert 20 * np.log10(rms_v / simulated.noise_v) == pytest.approx(60)


@pytest.mark.parametrize(
    ("of", "mean", "worst_tenth"), [("image", 0.84, 0.72), ("touches", 0.88, 0.80)]
)
def test_miou(scores, of, mean, worst_tenth):
    values = np.array([getattr(score, f"miou_{of}") for score in scores])
    assert values.mean() >= mean and np.quantile(values, 0.1) >= worst_tenth


def test_positions(scores):
    errors = [distance for score in scores for distance in score.matching.distances_mm]
    assert np.median(errors) <= 1.5 and np.quantile(errors, 0.95) <= 4.0


def test_counts(scores):
    assert np.mean([score.matching.exact for score in scores]) >= 0.9
    assert sum(score.matching.false_touches for score in scores) <= 0.05 * len(scores)
    assert sum(score.matching.misses for score in scores) <= 0.05 * len(scores)
