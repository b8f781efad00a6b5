"""The compared methods: baselines, the C core, and methods of other packages."""

from collections.abc import Sequence
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.fem.grid import Grid
from eitskin_studies.compare import baselines
from eitskin_studies.compare.core_method import core_methods
from eitskin_studies.compare.families import Family, Setup
from eitskin_studies.compare.greit import train_greit
from eitskin_studies.compare.learned import learned_family
from eitskin_studies.compare.pyeit_method import pyeit_methods
from eitskin_studies.datasets.exchange import returned_family

ENTRY_POINT_GROUP = "eitskin.methods"
STRENGTHS = (1e-7, 3e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 1e-3, 1e-2)
STEPS = (5, 10, 20, 30, 50, 80, 120, 200)
RATIOS = (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
# 3,000 iterations take ten times as long as 300, so fewer are tried; the best is often the least
CONVERGED_RATIOS = (1e-5, 1e-4, 1e-3, 3e-3)
# of total variation; 3e-7 was worse than 1e-6 at 40, 60 and 80 dB
WEIGHTS = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)


def methods(
    setup: Setup, threads: int = 1, dataset: Path | None = None, images: Sequence[Path] = ()
) -> tuple[Family, ...]:
    """All that ``eitskin compare`` compares, in the order of its table; the C core's frames over
    ``threads``. pyEIT is among them where it is installed, a learned method where there is a
    ``dataset`` to train it on, and a method for each file of ``images`` that another program made.

    Raises:
        UsageError: the C core is not built, or a method of another package cannot be made.
        FileError, FrameError: a file of ``images`` cannot be read or does not fit.
    """
    returned = tuple(returned_family(setup, path) for path in images)
    classic = baseline_methods(setup.jacobian, setup.grid)
    converged = plain_fista(setup.jacobian, 3000, signed=False, ratios=CONVERGED_RATIOS)
    theirs = pyeit_methods(setup) if find_spec("pyeit") else ()
    learned = () if dataset is None else (learned_family(setup, dataset),)
    variation = total_variation(setup.jacobian, setup.grid)
    others = (*classic, converged, variation, *theirs, *learned, *returned, *own_methods(setup))
    return (*others, *core_methods(setup, threads))


def own_methods(setup: Setup) -> tuple[Family, ...]:
    """The families of other packages, by the names of their entry points
    (docs/guide/own-method.md).

    Raises:
        UsageError: one cannot be loaded or made, or is no family.
    """
    families = []
    for entry in sorted(entry_points(group=ENTRY_POINT_GROUP), key=lambda one: one.name):
        try:
            family = entry.load()(setup)
        except Exception as error:
            raise UsageError(f"method {entry.name!r} ({entry.value}): {error}") from error
        if not isinstance(family, Family):
            raise UsageError(f"method {entry.name!r} ({entry.value}): returned no Family")
        families.append(family)
    return tuple(families)


def baseline_methods(jacobian: FloatArray, grid: Grid) -> tuple[Family, ...]:
    """The methods of ``baselines`` and ``greit`` with the parameter values that are tried for
    each."""
    greit = train_greit(jacobian, grid)
    return (
        Family("norm", (1.0, 2.0), lambda norm: baselines.back_projection(jacobian, norm)),
        Family("strength", STRENGTHS, lambda strength: baselines.gauss_newton(jacobian, strength)),
        Family("strength", STRENGTHS, lambda strength: baselines.noser(jacobian, strength)),
        Family("noise weight", STRENGTHS, greit.method),
        Family(
            "steps",
            tuple(map(float, STEPS)),
            lambda k: baselines.ConjugateGradient(jacobian, int(k)),
        ),
        plain_fista(jacobian, 30, True),
        plain_fista(jacobian, 300, True),
        plain_fista(jacobian, 30, False),
        plain_fista(jacobian, 300, False),
    )


def plain_fista(
    jacobian: FloatArray, iterations: int, signed: bool, ratios: tuple[float, ...] = RATIOS
) -> Family:
    """The family of ``baselines.PlainFista`` over ``ratios``."""
    return Family(
        "lambda / lambda_max",
        ratios,
        lambda ratio: baselines.PlainFista(jacobian, iterations, ratio, signed),
    )


def total_variation(jacobian: FloatArray, grid: Grid) -> Family:
    """The family of ``baselines.TotalVariation`` over ``WEIGHTS``."""
    edges = baselines.neighbours(grid.number)
    return Family(
        "weight", WEIGHTS, lambda weight: baselines.TotalVariation(jacobian, edges, weight)
    )
