"""Frames of a comparison for another program, and its images back: scored as if it were ours."""

import shutil
import subprocess
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from eitskin.errors import FrameError, UsageError
from eitskin.frames.arrays import read_arrays
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare import baselines
from eitskin_studies.compare.families import Family, Setup, setup_for
from eitskin_studies.compare.run import CompareSettings, Scenes, compare, simulated_scenes
from eitskin_studies.compare.table import to_json, to_text
from eitskin_studies.datasets.exchange import give_frames, returned_family

SKIN, PROTOCOL = paper_skin(), adjacent(16)
SMALL = CompareSettings(scenes=3, train_scenes=3, seed=5, elements=900, simulated_elements=1500)
STRENGTHS = (1e-6, 1e-3)


@pytest.fixture(scope="module")
def setup() -> Setup:
    return setup_for(SKIN, PROTOCOL, elements=SMALL.elements)


@pytest.fixture(scope="module")
def scenes() -> Scenes:
    return simulated_scenes(SKIN, PROTOCOL, SMALL)


def given(path: Path, setup: Setup, scenes: Scenes) -> dict[str, np.ndarray]:
    count = give_frames(path, setup, scenes.train, scenes.test, scenes.targets)
    arrays = dict(read_arrays(path))
    assert arrays["dv"].shape == (count, 208)
    return arrays


def elsewhere(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """Return images (K, n, V) by Tikhonov's method, as another program might make them."""
    jacobian, made = np.asarray(arrays["J"]), []
    for strength in STRENGTHS:
        weight = strength * np.linalg.norm(jacobian, 2) ** 2 * np.eye(len(jacobian))
        made.append(np.linalg.solve(jacobian @ jacobian.T + weight, arrays["dv"].T).T @ jacobian)
    return np.stack(made, axis=-1)


def ours(setup: Setup) -> Family:
    return Family("strength", STRENGTHS, lambda a: baselines.gauss_newton(setup.jacobian, a))


@pytest.mark.parametrize("suffix", [".mat", ".npz"])
def test_images_from_elsewhere_get_the_scores_of_the_same_method(suffix, tmp_path, setup, scenes):
    arrays = given(tmp_path / f"frames{suffix}", setup, scenes)
    returned = {"dv": arrays["dv"], "images": elsewhere(arrays)}
    path = tmp_path / f"theirs{suffix}"
    savemat(path, returned) if suffix == ".mat" else np.savez(path, **returned)
    families = (ours, partial(returned_family, path=path))
    done = compare(SKIN, PROTOCOL, SMALL, families=lambda at: tuple(make(at) for make in families))
    mine, theirs = done.results
    assert theirs.name == "theirs" and theirs.parameter == "setting"
    assert STRENGTHS[int(theirs.value)] == mine.value
    assert theirs.miou == pytest.approx(mine.miou, abs=1e-9)
    assert theirs.figures.resolution == pytest.approx(mine.figures.resolution, abs=1e-9)
    assert to_json(done)["methods"][1]["frame_ms"] is None
    [line] = [text for text in to_text(done).splitlines() if text.startswith("theirs  ")][:1]
    assert [cell.strip() for cell in line.split("|")][6:8] == ["-", "-"]


def test_the_file_has_the_touches_of_training_scenes_alone(tmp_path, setup, scenes):
    arrays = given(tmp_path / "frames.npz", setup, scenes)
    drawn = scenes.train.touches.scenes
    assert list(arrays["set"]).count("train") == len(drawn)
    frames = [k for k, scene in enumerate(drawn) for _ in scene.touches]
    assert arrays["train_touch_frame"].tolist() == frames
    assert np.array_equal(
        arrays["train_touch_xy_mm"], np.concatenate([one.centres_mm() for one in drawn])
    )
    lengths = {len(value) for name, value in arrays.items() if "touch" in name and "un" not in name}
    assert lengths == {len(frames)}


@pytest.mark.long("the other tests of the file, by numpy; Octave takes a minute to install")
def test_the_script_of_the_page_runs_in_octave(tmp_path, setup, scenes):
    octave = shutil.which("octave-cli")
    assert octave, "octave-cli is not installed: apt-get install octave"
    arrays = given(tmp_path / "frames.mat", setup, scenes)
    page = Path(__file__).parents[2] / "docs" / "guide" / "own-method.md"
    script = page.read_text(encoding="utf-8").split("```matlab\n")[1].split("```")[0]
    (tmp_path / "script.m").write_text(script)
    words = [octave, "--norc", "script.m"]
    subprocess.run(words, cwd=tmp_path, check=True, timeout=120, capture_output=True)
    theirs = returned_family(setup, tmp_path / "mine.mat")
    assert theirs.values == (0.0, 1.0, 2.0, 3.0)
    ours = baselines.gauss_newton(setup.jacobian, 1e-3).reconstruct(arrays["dv"])
    assert np.allclose(theirs.make(3.0).reconstruct(arrays["dv"]), ours, atol=1e-6 * ours.max())


def test_other_scenes_and_wrong_shapes_are_refused(tmp_path, setup, scenes):
    arrays = given(tmp_path / "frames.npz", setup, scenes)
    path, images = tmp_path / "theirs.npz", elsewhere(arrays)[:, :, 0]
    np.savez(path, dv=arrays["dv"], images=images.T)
    with pytest.raises(FrameError, match=r"have the shape .*one line"):
        returned_family(setup, path)
    np.savez(path, images=images)
    with pytest.raises(FrameError, match="no array 'dv'"):
        returned_family(setup, path)
    np.savez(path, dv=arrays["dv"], images=images)
    method = returned_family(setup, path).make(0.0)
    assert np.array_equal(method.reconstruct(arrays["dv"][2:4]), images[2:4])
    with pytest.raises(UsageError, match=r"has no image of frame 1 .*--seed"):
        method.reconstruct(arrays["dv"][2:4] * [[1.0], [1.01]])
    with pytest.raises(UsageError, match=r"\.mat or \.npz"):
        give_frames(tmp_path / "frames.csv", setup, scenes.train, scenes.test, scenes.targets)
