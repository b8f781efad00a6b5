"""pyEIT's own solvers as methods to compare, each with pyEIT's own sensitivity: ``JAC`` (a
Gauss-Newton step), ``SVD`` (truncated), ``GREIT`` and ``BP`` (back projection).

pyEIT makes images on the triangles, the nodes or a grid of its own: a pixel has the value of the
triangle in which its middle lies, or of the nearest node or point.
"""

import importlib
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin_studies.benchmarks.jacobian import pyeit_case
from eitskin_studies.compare.baselines import LinearMethod
from eitskin_studies.compare.families import Family, Setup

ELEMENTS = 3000
NAME = "pyEIT Gauss-Newton"
LAMBDAS = tuple(10.0**power for power in range(-9, 5))  # of JAC.setup, in units of its own J
DIRECTIONS = (10.0, 15.0, 20.0, 25.0, 35.0, 50.0, 70.0)  # that SVD keeps
GREIT_GRID = 32


class _Case:
    """pyEIT's mesh, protocol and solvers for the mesh of a setup."""

    def __init__(self, setup: Setup) -> None:
        mesh = mesh_for_elements(setup.skin, ELEMENTS)
        self.mesh, self.pattern, order = pyeit_case(mesh, setup.skin, setup.protocol)
        self.back = np.argsort(order, kind="stable")
        self.centres_mm = setup.grid.centres_mm()
        self.triangle = _triangle_of(mesh, self.centres_mm)

    def solver(self, module: str, name: str) -> Any:
        """A solver that has still to be set up."""
        kind = getattr(importlib.import_module(f"pyeit.eit.{module}"), name)
        return kind(self.mesh, self.pattern)

    def nearest(self, points_mm: FloatArray) -> IntArray:
        """The number of the point (k, 2) that is nearest to each pixel."""
        away = self.centres_mm[:, None] - points_mm[None, :, :2]
        return np.asarray(np.argmin((away**2).sum(axis=2), axis=1))

    def method(self, name: str, matrix: FloatArray, of_pixel: IntArray) -> LinearMethod:
        """pyEIT's images are ``-matrix`` times a difference; of its values, those of pixels."""
        return LinearMethod(name, np.ascontiguousarray(-matrix[of_pixel][:, self.back]))


def pyeit_method(setup: Setup) -> Family:
    """Its Gauss-Newton step: the family of :data:`LAMBDAS`, with exponent .5 of the prior.

    Raises:
        ModuleNotFoundError: pyEIT is not installed.
    """
    return _gauss_newton(_Case(setup))


def pyeit_methods(setup: Setup) -> tuple[Family, ...]:
    """All of its solvers of difference images that are a matrix.

    Raises:
        ModuleNotFoundError: pyEIT is not installed.
    """
    case = _Case(setup)
    made = (_gauss_newton, _truncated, _greit, _back_projection)
    return tuple(make(case) for make in made)


def _gauss_newton(case: _Case) -> Family:
    solver = case.solver("jac", "JAC")

    def make(lamb: float) -> LinearMethod:
        solver.setup(p=0.5, lamb=lamb, method="kotre")
        return case.method(NAME, solver.H, case.triangle)

    return Family("lambda", LAMBDAS, make)


def _truncated(case: _Case) -> Family:
    jacobian, _ = case.solver("svd", "SVD").fwd.compute_jac()
    left, sizes, right = np.linalg.svd(jacobian, full_matrices=False)

    def make(kept: float) -> LinearMethod:
        # the matrix that its setup(n=kept) makes by an eigendecomposition of J'J
        k = int(kept)
        matrix = (right[:k].T / sizes[:k]) @ left[:, :k].T
        return case.method("pyEIT truncated SVD", matrix, case.triangle)

    return Family("directions", DIRECTIONS, make)


def _greit(case: _Case) -> Family:
    solver = case.solver("greit", "GREIT")

    def make(lamb: float) -> LinearMethod:
        solver.setup(p=0.5, lamb=lamb, n=GREIT_GRID)
        points_mm = np.column_stack([solver.xg.ravel(), solver.yg.ravel()])
        return case.method("pyEIT GREIT", solver.H, case.nearest(points_mm))

    return Family("lambda", LAMBDAS, make)


def _back_projection(case: _Case) -> Family:
    solver = case.solver("bp", "BP")
    nearest = case.nearest(np.asarray(case.mesh.node))
    signs = np.sign(solver.fwd.solve_eit().real).reshape(-1)  # its normalisation of a frame
    weights: dict[float, str] = {0.0: "none", 1.0: "simple"}

    def make(weighted: float) -> LinearMethod:
        solver.setup(weight=weights[weighted])
        return case.method("pyEIT back projection", solver.H / signs, nearest)

    return Family("weighted by the radius", tuple(weights), make)


def _triangle_of(mesh: Mesh, points_mm: FloatArray) -> IntArray:
    """The number of the triangle around each point (k, 2); the nearest where none is."""
    corners = mesh.nodes_mm[mesh.triangles]
    edges = corners[:, 1:] - corners[:, :1]
    away = points_mm[:, None] - corners[None, :, 0]
    u, v = np.moveaxis(np.einsum("kti,tij->ktj", away, np.linalg.inv(edges)), -1, 0)
    return np.asarray(np.argmax(np.minimum(np.minimum(u, v), 1 - u - v), axis=1))
