"""The problems on which ``eitskin bench solve`` times solvers: whitened data of random scenes, and
the optimum in float64.

Each is  minimise |y - S x|^2 / 2 + lambda sum(x)  over x >= 0, S (r, n) as the model stores it
(float32), without directions that the misfit ignores, so that every solver gets the same plain
problem.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.core.results import Options
from eitskin.errors import FrameError
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.random_touches import random_touches
from eitskin.scene.simulate import Simulated, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin

LAMBDA_REL = 0.03
SURE = 1e-10


@dataclass(frozen=True, eq=False)
class Problems:
    """``s`` (r, n), ``y`` (k, r), ``lam`` (k,); ``best`` (k,) the least objective and
    ``best_signed`` that without x >= 0."""

    name: str
    model: Model
    blob: bytes
    s: FloatArray
    y: FloatArray
    lam: FloatArray
    best: FloatArray
    best_signed: FloatArray
    nonzeros: float

    def __len__(self) -> int:
        return len(self.y)

    def objective(self, k: int, x: npt.NDArray[np.floating]) -> float:
        """Return the objective of problem ``k`` at ``x`` (n,), in float64."""
        wide = np.asarray(x, dtype=np.float64)
        residual = self.y[k] - self.s @ wide
        return float(0.5 * residual @ residual + self.lam[k] * np.abs(wide).sum())

    def suboptimality(self, k: int, x: npt.NDArray[np.floating], *, signed: bool = False) -> float:
        """(F(x) - F*) / F*; values below zero count as zero unless ``signed``."""
        best = (self.best_signed if signed else self.best)[k]
        return float((self.objective(k, x if signed else np.maximum(x, 0)) - best) / best)


def bench_options(model: Model, **changes: Any) -> Options:
    """The model's defaults with the plain problem's lambda and no ignored direction."""
    plain = replace(default_options(model), project_reference=False, lambda_rel=LAMBDA_REL)
    return replace(plain, lambda_noise_factor=0.0, detection_factor=0.0, **changes)


def sessions(scenes: int, seed: int, role: str = "test") -> Simulated:
    """Random touches at 60 dB on the paper's skin."""
    skin = paper_skin()
    return simulate(skin, adjacent(16), random_touches(skin.outline, seed, scenes, role))


def models() -> list[tuple[str, Model, bytes]]:
    """The prebuilt model, rank 64; and one of full rank, 104."""
    model, blob = load_prebuilt()
    full = build_model(paper_skin(), adjacent(16), BuildSettings(rank=104, samples=0))
    return [("rank 64", model, blob), ("rank 104", full, encode_model(full))]


def make_problems(name: str, model: Model, blob: bytes, session: Simulated) -> Problems:
    """Data, lambda and optimum of each scene of ``session``.

    Raises:
        FrameError: an optimum is not certain to 1e-10.
    """
    engine = CoreEngine(blob, "float64")
    s = model.sensitivity.astype(np.float64)
    rows: list[tuple[FloatArray, float, float, float, int]] = []
    for frame in session.frames_v:
        bests = []
        for sign in ("both", "increase"):
            engine.set_options(
                bench_options(model, solver="active-set", sign=sign, iterations=1000)
            )
            engine.set_reference(session.untouched_v)
            result = engine.reconstruct(frame, touches=False)
            y, lam = engine.reduced_data()[: model.rank].astype(np.float64), result.info.lambda_
            if sign == "both":
                signed_lam = lam
            residual = y - s @ result.coefficients
            value = float(0.5 * residual @ residual + lam * np.abs(result.coefficients).sum())
            correlation = s.T @ residual
            reach = float(np.abs(correlation).max() if sign == "both" else correlation.max())
            dual = min(1.0, lam / reach) * residual
            gap = value - float(0.5 * y @ y - 0.5 * (y - dual) @ (y - dual))
            if not gap <= SURE * value:
                raise FrameError(
                    f"bench solve: an optimum is certain to {gap / value:.1e} only; take another"
                    " seed"
                )
            bests.append(value)
        if not np.isclose(signed_lam, lam):
            engine.set_options(
                bench_options(
                    model, solver="active-set", sign="both", iterations=1000, lambda_abs=lam
                )
            )
            result = engine.reconstruct(frame, touches=False)
            residual = y - s @ result.coefficients
            bests[0] = float(0.5 * residual @ residual + lam * np.abs(result.coefficients).sum())
        rows.append((y, lam, bests[1], bests[0], result.info.nonzeros))
    return Problems(
        name, model, blob, s, np.array([r[0] for r in rows]), np.array([r[1] for r in rows]),
        np.array([r[2] for r in rows]),
        np.array([r[3] for r in rows]), float(np.mean([r[4] for r in rows])),
    )  # fmt: skip
