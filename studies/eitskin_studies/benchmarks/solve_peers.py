"""Other solvers of the same problem, each with its best settings for it. One that is not installed
is named with how to get it.

A solver has a ladder of settings, from the least effort to the most; the benchmark times the first
that is exact enough.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.engine import CoreEngine
from eitskin_studies.benchmarks.solve_problems import Problems, bench_options
from eitskin_studies.harness.bare_core import bare_solve, bare_solves

Floats = npt.NDArray[np.floating[Any]]

COUNTS = (
    1,
    2,
    3,
    5,
    7,
    10,
    14,
    20,
    30,
    45,
    60,
    90,
    140,
    200,
    300,
    500,
    800,
    1300,
    2000,
    4000,
    8000,
    16000,
    32000,
)
BATCH = 240
LARS = {"lambda1": 1.0, "mode": 2, "pos": True, "numThreads": 1}
TOLERANCES = tuple(10.0 ** (-k / 2) for k in range(2, 29))


@dataclass(frozen=True)
class Candidate:
    """``prepare(k, setting)`` makes what is not timed and returns what is; ``read`` turns what that
    returns into x (n,), or for a ``batch`` of so many problems into those of the first (k, n).

    ``signed``: solves the problem without x >= 0, and is judged by its optimum.
    """

    name: str
    ladder: Sequence[Any]
    prepare: Callable[[int, Any], Callable[[], Any]]
    read: Callable[[Any], Floats]
    batch: int = 0
    signed: bool = False


def ours(problems: Problems) -> list[Candidate]:
    """The C core's solvers in both widths, cold, through cffi."""
    found = []
    for width in ("float32", "float64"):
        for solver in ("active-set", "working-set", "fista"):
            found.append(_ours(problems, solver, width))
        found.append(_ours_in_a_row(problems, width))
    return found


def _ours(problems: Problems, solver: str, width: str) -> Candidate:
    engine = CoreEngine(problems.blob, width)

    def prepare(k: int, count: int) -> Callable[[], Any]:
        engine.set_options(
            bench_options(
                problems.model, solver=solver, iterations=count, lambda_abs=float(problems.lam[k])
            )
        )
        return bare_solve(engine, problems.y[k])

    return Candidate(f"eitskin {solver}, {width}", COUNTS, prepare, lambda _: engine.coefficients())


def _ours_in_a_row(problems: Problems, width: str) -> Candidate:
    """The active set on as many problems as SPAMS gets at once, one call each: y / lambda and
    lambda 1, as there."""
    engine = CoreEngine(problems.blob, width)
    scaled = (problems.y / problems.lam[:, None]).astype(engine.dtype)
    many = np.tile(scaled, (-(-BATCH // len(problems)), 1))

    def prepare(_: int, count: int) -> Callable[[], Any]:
        options = bench_options(
            problems.model, solver="active-set", iterations=count, lambda_abs=1.0
        )

        def run() -> Floats:
            engine.set_options(options)
            return bare_solves(engine, many)

        return run

    def read(x: Floats) -> Floats:
        return np.asarray(x[: len(problems)] * problems.lam[:, None])

    return Candidate(
        f"eitskin active-set, {width}, batch of {len(many)}", (1000,), prepare, read, len(many)
    )


def numpy_fista(problems: Problems, dtype: Any) -> Candidate:
    """FISTA in numpy, plain: two products an iteration."""
    s: Floats = np.ascontiguousarray(problems.s, dtype=dtype)
    st: Floats = np.ascontiguousarray(s.T)
    step = dtype(1 / (np.linalg.norm(problems.s, 2) ** 2))

    def prepare(k: int, count: int) -> Callable[[], Any]:
        y, threshold = problems.y[k].astype(dtype), dtype(step * problems.lam[k])

        def run() -> Floats:
            x = np.zeros(s.shape[1], dtype=dtype)
            z, t = x, 1.0
            for _ in range(count):
                moved = np.maximum(z + step * (st @ (y - s @ z)) - threshold, 0)
                t_next = 0.5 * (1 + (1 + 4 * t * t) ** 0.5)
                z = moved + dtype((t - 1) / t_next) * (moved - x)
                x, t = moved, t_next
            return x

        return run

    return Candidate(
        f"numpy FISTA, {np.dtype(dtype).name}", COUNTS, prepare, lambda x: np.asarray(x)
    )


def spams(problems: Problems) -> list[Candidate]:
    """LARS; with lambda 1 and y / lambda for all, so that a batch can be solved at once. One
    thread."""
    import spams as package

    found = []
    for dtype in (np.float32, np.float64):
        s: Any = np.asfortranarray(problems.s, dtype=dtype)
        gram = np.asfortranarray(s.T @ s)
        scaled = np.asfortranarray((problems.y / problems.lam[:, None]).T, dtype=dtype)
        many = np.asfortranarray(np.tile(scaled, (1, -(-BATCH // len(problems)))))

        def alone(
            k: int, cholesky: bool, s: Any = s, scaled: Any = scaled, gram: Any = gram
        ) -> Callable[[], Any]:
            y, lam = np.asfortranarray(scaled[:, k : k + 1]), problems.lam[k]
            if cholesky:
                return lambda: lam * package.lasso(y, D=s, cholesky=True, **LARS).toarray()[:, 0]
            return lambda: (
                lam * package.lasso(y, Q=gram, q=np.asfortranarray(s.T @ y), **LARS).toarray()[:, 0]
            )

        def together(_: int, cholesky: bool, s: Any = s, many: Any = many) -> Callable[[], Any]:
            return lambda: package.lasso(many, D=s, cholesky=cholesky, **LARS)

        def spread(x: Any) -> Floats:
            return np.asarray(x[:, : len(problems)].toarray().T * problems.lam[:, None])

        width = np.dtype(dtype).name
        for cholesky, by in ((False, "Gram"), (True, "Cholesky")):
            found.append(Candidate(f"SPAMS, {width}, {by}", (cholesky,), alone, np.asarray))
            name, count = f"SPAMS, {width}, {by}, batch of {many.shape[1]}", int(many.shape[1])
            found.append(Candidate(name, (cholesky,), together, spread, count))
    return found


def daqp(problems: Problems) -> list[Candidate]:
    """Solve the dual: the point nearest to y with S'u <= lambda, strictly convex in r numbers; x
    are its multipliers."""
    import daqp as package

    rank, n = problems.s.shape
    rows = np.ascontiguousarray(problems.s.T)
    unit, low = np.eye(rank), np.full(n, -1e30)

    def prepare(k: int, tolerance: float) -> Callable[[], Any]:
        high, minus = np.full(n, problems.lam[k]), -problems.y[k]
        settings = {"primal_tol": tolerance * problems.lam[k]}
        return lambda: package.solve(unit, minus, rows, high, low, **settings)[3]["lam"]

    return [
        Candidate(
            "DAQP, dual", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8), prepare, lambda x: np.maximum(x, 0)
        )
    ]


def celer(problems: Problems) -> list[Candidate]:
    """``celer_path`` for one lambda, without the estimator around it."""
    from celer import celer_path

    s = np.asfortranarray(problems.s)

    def prepare(k: int, tolerance: float) -> Callable[[], Any]:
        y, alpha = problems.y[k].copy(), [problems.lam[k] / len(s)]
        return lambda: celer_path(
            s, y, "lasso", alphas=alpha, positive=True, tol=tolerance, max_iter=200
        )[1]

    return [Candidate("celer, float64", TOLERANCES, prepare, lambda x: x[:, 0])]


def scikit_learn(problems: Problems) -> list[Candidate]:
    """``enet_path`` for one lambda, with and without the Gram matrix, which is not timed."""
    from sklearn.linear_model import enet_path

    s = np.asfortranarray(problems.s)
    gram = s.T @ s

    def prepare(k: int, setting: float, precompute: Any = False) -> Callable[[], Any]:
        y, alpha = problems.y[k].copy(), [problems.lam[k] / len(s)]
        how = {
            "l1_ratio": 1.0,
            "alphas": alpha,
            "positive": True,
            "tol": setting,
            "max_iter": 1_000_000,
            "check_input": False,
        }
        if precompute is False:
            return lambda: enet_path(s, y, precompute=False, **how)[1]
        return lambda: enet_path(s, y, precompute=gram, Xy=s.T @ y, **how)[1]

    def with_gram(k: int, setting: float) -> Callable[[], Any]:
        return prepare(k, setting, gram)

    return [
        Candidate("scikit-learn, float64, Gram", TOLERANCES, with_gram, lambda x: x[:, 0]),
        Candidate("scikit-learn, float64", TOLERANCES, prepare, lambda x: x[:, 0]),
    ]


def skglm(problems: Problems) -> list[Candidate]:
    """``Lasso`` of skglm: working sets with Anderson acceleration, compiled by numba beforehand."""
    from skglm import Lasso

    s = np.asfortranarray(problems.s)

    def prepare(k: int, tolerance: float) -> Callable[[], Any]:
        solver = Lasso(
            alpha=problems.lam[k] / len(s),
            positive=True,
            fit_intercept=False,
            tol=tolerance,
            max_iter=500,
        )
        return lambda: solver.fit(s, problems.y[k]).coef_

    return [Candidate("skglm, float64", TOLERANCES, prepare, np.asarray)]


def pylops(problems: Problems) -> list[Candidate]:
    """FISTA of pylops, which knows no x >= 0: the signed problem. Its eps is 2 lambda."""
    from pylops import MatrixMult
    from pylops.optimization.sparsity import fista

    operator = MatrixMult(np.ascontiguousarray(problems.s))
    step = 1 / np.linalg.norm(problems.s, 2) ** 2

    def prepare(k: int, count: int) -> Callable[[], Any]:
        x0, eps = np.zeros(problems.s.shape[1]), 2 * float(problems.lam[k])
        return lambda: fista(
            operator, problems.y[k], x0=x0, niter=count, eps=eps, alpha=step, tol=0.0
        )[0]

    return [Candidate("pylops FISTA, float64, signed", COUNTS, prepare, np.asarray, signed=True)]


PEERS: dict[str, tuple[str, Callable[[Problems], list[Candidate]]]] = {
    "spams-bin": ("spams-bin", spams),
    "daqp": ("daqp", daqp),
    "celer": ("celer", celer),
    "scikit-learn": ("scikit-learn", scikit_learn),
    "skglm": ("skglm", skglm),
    "pylops": ("pylops", pylops),
}


def versions() -> dict[str, str | None]:
    """Return the version of each peer; None if it is not installed."""
    found: dict[str, str | None] = {"numpy": np.__version__}
    for name in PEERS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found


def candidates(problems: Problems) -> list[Candidate]:
    """All that is installed, this project's first."""
    warnings.filterwarnings("ignore", module="(celer|sklearn|skglm|pylops)")
    found = [*ours(problems), numpy_fista(problems, np.float32), numpy_fista(problems, np.float64)]
    installed = versions()
    for name, (_, make) in PEERS.items():
        if installed[name] is not None:
            found.extend(make(problems))
    return found
