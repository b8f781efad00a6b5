"""Turn what was learned into an ordinary model."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin import __version__
from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.core.options_table import ALL_TOUCH_FIT
from eitskin.fem.grid import Grid
from eitskin.model.build import LIPSCHITZ_MARGIN
from eitskin.model.eitm import encode_model
from eitskin.model.model import GAIN_DRIFT_KEPT, TRACKS_REFERENCE, Defaults, Golden, Model
from eitskin.model.reduction import noise_gain, spectral_norm_squared
from eitskin.model.storage import store
from eitskin.skin.protocol import Protocol, Reciprocity
from eitskin.teaching.fit import Learned

RANK = 64
LAMBDA_REL = 0.2  # only for the image, since touches are found in the data
# candidates for the fraction of |y|^2 that each touch must explain in addition to the others
LEAST_SHARES = (0.01, 0.013, 0.016, 0.02, 0.025, 0.03, 0.04, 0.05, 0.06, 0.08, 0.12)


def taught_defaults(grid: Grid, least_share: float) -> Defaults:
    """Return defaults for a taught model: exact solutions, and discs of one pixel that are found in
    the data."""
    return Defaults(
        iterations=200,
        lambda_rel=LAMBDA_REL,
        touch_threshold=0.05,
        touch_min_fraction=least_share,
        touch_min_radius_mm=grid.pixel_mm,
        touch_max_radius_mm=grid.pixel_mm,
        touch_seed_radius_mm=grid.pixel_mm,
        touch_change_s_per_m=0.0,
        follow_mm=0.12 * grid.pixel_mm * max(grid.nx, grid.ny),
        solver="active-set",
        touch_fit_left_out=ALL_TOUCH_FIT | GAIN_DRIFT_KEPT | TRACKS_REFERENCE,
    )


def _precision(learned: Learned, s1: float) -> npt.NDArray[np.float32]:
    """Return the lower triangle of R = W'W over s_1^2, row by row."""
    white = learned.noise.whitening / learned.unit / s1
    return np.asarray((white.T @ white)[np.tril_indices(white.shape[0])], dtype=np.float32)


def taught_model(
    learned: Learned,
    protocol: Protocol,
    grid: Grid,
    untouched: FloatArray,
    least_share: float,
    meta: dict[str, Any] | None = None,
    rank: int = RANK,
) -> Model:
    """Return the model of ``learned`` on ``grid``: P = U'W / s_1 and S = diag(s / s_1) V' from S_w
    D = U s V', with S_w = W s(grid) and D = 1 / |column|. ``untouched`` (n, m) in V gives the
    reference."""
    rows = protocol.n_rows
    answer = learned.noise.whitening @ learned.process.mean(grid.centres_mm()).T
    norm = np.linalg.norm(answer, axis=0)
    weight = 1 / np.maximum(norm, 1e-3 * norm.max())
    u, s, vt = np.linalg.svd(answer * weight, full_matrices=False)
    rank = min(rank, rows, grid.n_pixels)
    projection = (u[:, :rank].T @ learned.noise.whitening / learned.unit / s[0]).astype(np.float32)
    stored = store((s[:rank] / s[0])[:, None] * vt[:rank], "f32")
    decoded = stored.decode(rank)
    reference = untouched.mean(axis=0).astype(np.float32)
    k = int(np.argmin(np.linalg.norm(grid.centres_mm() - grid.centres_mm().mean(axis=0), axis=1)))
    pressed = reference + learned.process.mean(grid.centres_mm()[[k]])[0] * learned.unit
    model = Model(
        protocol=protocol,
        fold=Reciprocity(np.arange(rows), np.full(rows, -1), np.ones(rows, dtype=np.int64)),
        grid=grid,
        data_kind="difference",
        rank=rank,
        v_ref_v=reference,
        projection=projection,
        stored=stored,
        column_weight=weight.astype(np.float32),
        precision=_precision(learned, float(s[0])),
        lipschitz=float(np.float32(spectral_norm_squared(decoded) * (1 + LIPSCHITZ_MARGIN))),
        noise_gain=float(np.float32(noise_gain(projection, decoded))),
        defaults=taught_defaults(grid, least_share),
        golden=Golden(
            reference, pressed.astype(np.float32), np.zeros(grid.n_pixels, dtype=np.float32)
        ),
        meta={"made_by": f"eitskin {__version__}", **(meta or {})},
    )
    core = CoreEngine(encode_model(model), "float32")
    core.set_reference(model.golden.reference_v[None].astype(np.float64))
    image = core.reconstruct(model.golden.frame_v, touches=False).solver_image
    return replace(model, golden=replace(model.golden, image=np.asarray(image, dtype=np.float32)))
