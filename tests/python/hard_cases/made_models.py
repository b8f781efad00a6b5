"""Models whose stored matrix is whatever a case asks for, on a protocol of 8 electrodes: 40 rows,
20 after the fold."""

from functools import cache

import numpy as np

from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin.model.eitm import encode_model
from eitskin.model.model import Defaults, Golden, Model
from eitskin.model.options import default_options
from eitskin.model.storage import store
from eitskin.skin.protocol import Protocol, adjacent

ELECTRODES = 8
ROWS, FOLDED = 40, 20
SIDE = 8


@cache
def protocol() -> Protocol:
    """The adjacent one."""
    return adjacent(ELECTRODES)


def grid_of(columns: int) -> Grid:
    """The first ``columns`` cells of 8 x 8 pixels of 10 mm."""
    places = [(k % SIDE, k // SIDE) for k in range(columns)]
    return Grid(SIDE, SIDE, 10.0, (-40.0, -40.0), np.array(places, dtype=np.int64))


def lipschitz_of(s: np.ndarray) -> float:
    """The greatest eigenvalue of S S', a little above."""
    return float(np.linalg.norm(np.asarray(s, dtype=np.float64), 2) ** 2) * (1 + 1e-4)


def made_model(
    s: np.ndarray,
    *,
    storage: str = "f32",
    data_kind: str = "difference",
    lipschitz: float | None = None,
    projection_scale: float = 1.0,
    v_ref_scale: float = 1.0,
    column_weight: np.ndarray | None = None,
) -> Model:
    """A model that stores ``s`` (r, n), r up to 20, n up to 64. Its P takes the first r folded
    rows, times ``projection_scale``; the reference is near ``v_ref_scale`` volts. ``lipschitz``
    None: that of what is stored."""
    rank, columns = s.shape
    fold = protocol().reciprocal_pairs()
    stored = store(s, storage)
    v_ref = v_ref_scale * (1 + 0.05 * np.cos(np.arange(FOLDED)))
    frame = np.zeros(ROWS)
    for k in range(FOLDED):
        frame[fold.first[k]], frame[fold.second[k]] = v_ref[k], fold.sign[k] * v_ref[k]
    reference = frame.astype(np.float32)
    return Model(
        protocol=protocol(),
        fold=fold,
        grid=grid_of(columns),
        data_kind=data_kind,
        rank=rank,
        v_ref_v=v_ref.astype(np.float32),
        projection=(projection_scale * np.eye(rank, FOLDED)).astype(np.float32),
        stored=stored,
        column_weight=(
            np.ones(columns, dtype=np.float32)
            if column_weight is None
            else column_weight.astype(np.float32)
        ),
        lipschitz=lipschitz_of(stored.decode(rank)) if lipschitz is None else lipschitz,
        noise_gain=1.0,
        defaults=Defaults(),
        golden=Golden(reference, reference, np.zeros(columns, dtype=np.float32)),
    )


def made_blob(s: np.ndarray, **changes: object) -> bytes:
    """The bytes of ``made_model``."""
    return encode_model(made_model(s, **changes))


def plain_options(s: np.ndarray, **changes: object) -> Options:
    """Without gate and without a guess of the noise, so that lambda is what is asked for."""
    from dataclasses import replace

    base = default_options(made_model(s))
    return replace(
        base,
        **{
            "detection_factor": 0.0,
            "lambda_noise_factor": 0.0,
            "project_reference": False,
            **changes,
        },
    )
