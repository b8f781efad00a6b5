"""FISTA (Beck and Teboulle, SIAM J. Imaging Sci. 2 (2009) 183, doi 10.1137/080716542), on every
column or on a working set."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.results import Options
from eitskin_reference.constants_table import (
    LOOK_GROWTH,
    MAX_RISE,
    MAX_STEP_HALVINGS,
    PRUNE_EVERY,
)
from eitskin_reference.problem import (
    Certificate,
    SolveResult,
    check_gap,
    project,
    shrink,
)


def fista(
    s: FloatArray,
    y: FloatArray,
    lam: float,
    lipschitz: float,
    options: Options,
    basis: FloatArray,
    start: FloatArray | None = None,
) -> SolveResult:
    """FISTA on S (r, n), y (r,), with the span of ``basis`` (k, r) left out of the model_mismatch.

    With the solver "working-set", columns outside the working set see no gradient until it is
    chosen again.
    """
    sign, step, t, halvings = options.sign, 1.0 / lipschitz, 1.0, 0
    x = np.zeros(s.shape[1]) if start is None else start.copy()
    sx = s @ x
    z, sz = x.copy(), sx.copy()
    scale = 0.5 * float(y @ y)
    working, next_look, interval = np.ones(s.shape[1], dtype=np.bool_), 1, options.gap_every
    stop, certificate, k = "iterations", Certificate(0.0, scale, float(np.linalg.norm(y))), 0
    for k in range(1, options.iterations + 1):
        gradient = s.T @ project(y - sz, basis)
        if options.solver == "working-set":
            moving = (x != 0) | (z != 0) | (shrink(gradient, lam, sign) != 0)
            if k >= next_look:
                working, next_look = moving, k + interval
                interval *= 1 if options.gap_rel > 0 else LOOK_GROWTH
            elif k % PRUNE_EVERY == 1:
                working = working & moving
            gradient = np.where(working, gradient, 0.0)
        x_next = shrink(z + step * gradient, step * lam, sign)
        t_next = 0.5 * (1 + np.sqrt(1 + 4 * t * t))
        beta = (t - 1) / t_next
        sx_next = s @ x_next
        z, sz = x_next + beta * (x_next - x), sx_next + beta * (sx_next - sx)
        x, sx, t = x_next, sx_next, t_next
        last = k == options.iterations
        if not last and k % options.gap_every:
            continue
        none = not x.any()
        if not last and options.gap_rel == 0 and not none and float(sx @ sx) <= 8 * scale:
            continue
        certificate = check_gap(s, y, x, sx, lam, sign, basis)
        if not certificate.objective <= scale * (1 + MAX_RISE) or (
            none and certificate.gap > MAX_RISE * scale
        ):
            if halvings == MAX_STEP_HALVINGS or last:
                stop = "diverged"
                break
            halvings, step, t = halvings + 1, step / 2, 1.0
            x, sx = np.zeros_like(x), np.zeros_like(sx)
            z, sz = x.copy(), sx.copy()
            next_look, interval = k + 1, options.gap_every
            continue
        if options.gap_rel > 0 and certificate.gap <= options.gap_rel * scale:
            stop = "gap"
            break
    return SolveResult(x, k, stop, certificate, halvings)
