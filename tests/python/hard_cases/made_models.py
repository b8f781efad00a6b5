"""Models whose stored matrix is whatever a case asks for, on a protocol of 8 electrodes: 40 rows,
20 after the fold."""

from dataclasses import replace

import numpy as np

from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin.model.eitm import encode_model
from eitskin.model.model import Defaults, Golden, Model
from eitskin.model.options import default_options
from eitskin.model.storage import store
from eitskin.skin.protocol import adjacent

ROWS, FOLDED = 40, 20
SIDE = 8


PROTOCOL = adjacent(8)


def grid_of(columns: int) -> Grid:
    """The first ``columns`` cells of 8 x 8 pixels of 10 mm."""
    places = [(k % SIDE, k // SIDE) for k in range(columns)]
    return Grid(SIDE, SIDE, 10.0, (-40.0, -40.0), np.array(places, dtype=np.int64))


def lipschitz_of(s: np.ndarray) -> float:
    """The greatest eigenvalue of S S', a little above."""
    return float(np.linalg.norm(np.asarray(s, dtype=np.float64), 2) ** 2) * (1 + 1e-4)


def made_model(s: np.ndarray, storage: str = "f32", lipschitz: float | None = None) -> Model:
    """Return a model that stores ``s`` (r, n), with r up to 20 and n up to 64. Its P takes the
    first r folded rows, and its reference is near 1 V. ``lipschitz`` None: that of the stored
    matrix."""
    rank, columns = s.shape
    fold, stored = PROTOCOL.reciprocal_pairs(), store(s, storage)
    v_ref = 1 + 0.05 * np.cos(np.arange(FOLDED))
    reference = np.zeros(ROWS, dtype=np.float32)
    reference[fold.first], reference[fold.second] = v_ref, fold.sign * v_ref
    return Model(
        protocol=PROTOCOL,
        fold=fold,
        grid=grid_of(columns),
        data_kind="difference",
        rank=rank,
        v_ref_v=v_ref.astype(np.float32),
        projection=np.eye(rank, FOLDED, dtype=np.float32),
        stored=stored,
        column_weight=np.ones(columns, dtype=np.float32),
        lipschitz=lipschitz_of(stored.decode(rank)) if lipschitz is None else lipschitz,
        noise_gain=1.0,
        defaults=Defaults(),
        golden=Golden(reference, reference, np.zeros(columns, dtype=np.float32)),
    )


def made_blob(s: np.ndarray, **changes: object) -> bytes:
    return encode_model(made_model(s, **changes))


def plain_options(s: np.ndarray, **changes: object) -> Options:
    """Without gate and without a guess of the noise, so that lambda is what is asked for."""
    own = {"detection_factor": 0.0, "lambda_noise_factor": 0.0, "project_reference": False}
    return replace(default_options(made_model(s)), **(own | changes))
