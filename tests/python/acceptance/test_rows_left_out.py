"""An electrode that comes off, and rows that are lost, on random scenes that nothing was fitted to:
what that costs.

Scenes are made as those of test_random_scenes.py, one to three touches, with 60 dB noise and spread
contacts; in each an electrode detaches in the last frame (the effect `detached`), and its rows are
given as NaN. Whole and damaged frames share a reference.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import scene_from_table
from eitskin.scene.random_touches import TouchScene, TrueTouch, random_touches
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scoring import metrics
from eitskin.scoring.score import Scorer, scorer_for
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

SCENES = 160
# scripts/test has the first 48, scripts/test --all all of them
some_and_all = pytest.mark.parametrize(
    "count", [48, pytest.param(SCENES, marks=pytest.mark.long("48 scenes"))]
)
# what an electrode costs differs from set to set: .024 here, .028 on the training set, .031 on a
# third
SEED = 78
UNTOUCHED = 16
ELECTRODES = 16
MAX_LOSS = 0.03


@dataclass(frozen=True, eq=False)
class Case:
    """A scene and its frames: untouched (q, m), whole (m,) and with electrode ``electrode`` off
    (m,), volts."""

    scene: TouchScene
    electrode: int
    untouched_v: FloatArray
    whole_v: FloatArray
    detached_v: FloatArray


@cache
def cases(count: int) -> tuple[Case, ...]:
    """The first ``count`` scenes, simulated nonlinearly."""
    skin, mesh_cache, made = paper_skin(), MeshCache(), []
    scenes = random_touches(skin.outline, SEED, SCENES, "faults").scenes
    for k, scene in enumerate(scenes[:count]):
        electrode = k % ELECTRODES
        touches = [
            {name: float(getattr(t, name)) for name in ("x_mm", "y_mm", "radius_mm", "contrast")}
            for t in scene.touches
        ]
        session = {
            "name": "one", "skin": "paper", "seed": 1000 * SEED + k, "frames": 2, "rate_hz": 20.0,
            "quiet_frames": UNTOUCHED,
        }  # fmt: skip
        effects = {
            "detached": {"electrodes": [electrode], "from_s": 0.04},
            "noise": {"snr_db": 60.0},
            "contact_impedance": {"spread": 0.2},
        }
        table = {"scene": session, "touch": touches, "effects": effects}
        compiled = compile_scene(scene_from_table(table, "one", Path()), mesh_cache=mesh_cache)
        *untouched, whole, detached = simulate_frames(compiled).voltage_v
        made.append(Case(scene, electrode, np.array(untouched), whole, detached))
    return tuple(made)


def rows_of(*electrodes: int) -> BoolArray:
    return np.asarray(np.isin(prebuilt()[0].protocol.drive_measure, electrodes).any(axis=1))


class LeftOutRows:
    """Images and touches against what a scene holds."""

    def __init__(self) -> None:
        model, blob = prebuilt()
        self.threshold = model.defaults.mask_threshold
        self.scorer: Scorer = scorer_for(model)
        self.points_mm = self.scorer.image_scorer.raster.points_mm
        self.reconstructor = Reconstructor(model, blob=blob)
        self.reconstructor.set_options(max_masked=len(model.protocol.drive_measure))

    def mask(self, discs: Sequence[Touch | TrueTouch]) -> BoolArray:
        centres, radii = [(t.x_mm, t.y_mm) for t in discs], [t.radius_mm for t in discs]
        return metrics.disc_mask(
            self.points_mm, np.reshape(centres, (-1, 2)), np.asarray(radii, dtype=np.float64)
        )

    def score(self, case: Case, frame_v: FloatArray, out: BoolArray) -> tuple[float, float]:
        """MIoU of the image's mask and of the touches' discs, with the rows ``out`` (m,) lost;
        twice the same frame, since the first makes the map."""
        self.reconstructor.tare(case.untouched_v)
        frame_v = np.where(out, np.nan, frame_v)
        self.reconstructor.reconstruct(frame_v)
        self.reconstructor.forget()
        result = self.reconstructor.reconstruct(frame_v)
        assert np.isfinite(result.solver_image).all() and result.info.masked == out.sum()
        assert result.info.gap >= 0 and result.info.step_halvings == 0
        shown = self.scorer.image_scorer.lookup.show(result.solver_image.astype(np.float64))
        seen, truth = metrics.touch_mask(shown, self.threshold), self.mask(case.scene.touches)
        return metrics.miou(seen, truth), metrics.miou(self.mask(result.touches), truth)


@pytest.fixture(scope="module")
def left_out_rows() -> LeftOutRows:
    return LeftOutRows()


NONE_OUT = np.zeros(208, dtype=np.bool_)


def scores(left_out_rows: LeftOutRows, electrodes: int, count: int) -> FloatArray:
    """Mean scores of image and discs with so many electrodes out, the first of them truly off."""
    found = []
    for case in cases(count):
        off = [(case.electrode + 5 * k) % ELECTRODES for k in range(electrodes)]
        frame_v = case.detached_v if electrodes else case.whole_v
        found.append(left_out_rows.score(case, frame_v, rows_of(*off)))
    return np.asarray(np.mean(found, axis=0))


@some_and_all
def test_a_detached_electrode(left_out_rows, count):
    whole, damaged = scores(left_out_rows, 0, count), scores(left_out_rows, 1, count)
    loss = whole - damaged
    print(f"whole {whole}, an electrode off {damaged}, loss {loss}")
    slack = 0.0 if count == SCENES else 0.01  # a mean of fewer scenes says less
    assert whole[0] >= 0.84 - slack and whole[1] >= 0.88
    assert loss.max() <= MAX_LOSS + slack


@some_and_all
def test_each_further_electrode_costs_a_little(left_out_rows, count):
    found = np.array([scores(left_out_rows, electrodes, count) for electrodes in range(4)])
    print(found)
    steps = -np.diff(found, axis=0)
    assert (steps > -0.002).all() and (steps <= 0.06).all()
    assert (found[3] >= (0.70, 0.78)).all()


@some_and_all
def test_a_few_lost_rows_cost_next_to_nothing(left_out_rows, count):
    """Both of a reciprocal pair: one alone stands for both."""
    fold, generator = prebuilt()[0].fold, np.random.default_rng(SEED)
    whole = scores(left_out_rows, 0, count)
    for rows, most in ((1, 0.004), (10, 0.008), (20, 0.012)):
        found = []
        for case in cases(count):
            lost = generator.choice(len(fold.first), rows, replace=False)
            out = NONE_OUT.copy()
            out[fold.first[lost]] = out[fold.second[lost]] = True
            found.append(left_out_rows.score(case, case.whole_v, out))
        mean = np.mean(found, axis=0)
        loss = whole - mean
        print(rows, mean, loss)
        assert loss.max() <= most, rows


def test_no_touch_is_seen_where_there_is_none(left_out_rows):
    """Untouched frames after the reference, an electrode's rows lost: as few pass the gate as with
    all rows."""
    seen, core = {0: 0, 1: 0}, left_out_rows.reconstructor
    for case in cases(48):
        core.tare(case.untouched_v[: UNTOUCHED - 4])
        for electrodes in seen:
            out = rows_of(case.electrode) if electrodes else NONE_OUT
            for frame_v in case.untouched_v[UNTOUCHED - 4 :]:
                seen[electrodes] += bool(core.reconstruct(np.where(out, np.nan, frame_v)).touches)
    print(seen)
    assert seen[1] <= seen[0] + 3
