"""pyEIT's Gauss-Newton step (its ``JAC``, with its own sensitivity) as a method to compare.

pyEIT makes images on the triangles of a mesh: a pixel has the value of the triangle in which its
middle lies.
"""

import importlib

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin_studies.benchmarks.jacobian import pyeit_case
from eitskin_studies.compare.baselines import LinearMethod
from eitskin_studies.compare.families import Family, Setup

ELEMENTS = 3000
NAME = "pyEIT Gauss-Newton"
LAMBDAS = tuple(10.0**power for power in range(-9, 5))  # of JAC.setup, in units of its own J


def pyeit_method(setup: Setup) -> Family:
    """The family of :data:`LAMBDAS`, with pyEIT's exponent .5 of the prior.

    Raises:
        ModuleNotFoundError: pyEIT is not installed.
    """
    mesh = mesh_for_elements(setup.skin, ELEMENTS)
    theirs, pattern, order = pyeit_case(mesh, setup.skin, setup.protocol)
    back = np.argsort(order, kind="stable")
    triangle = _triangle_of(mesh, setup.grid.centres_mm())
    solver = importlib.import_module("pyeit.eit.jac").JAC(theirs, pattern)

    def make(lamb: float) -> LinearMethod:
        solver.setup(p=0.5, lamb=lamb, method="kotre")
        return LinearMethod(NAME, np.ascontiguousarray(-solver.H[triangle][:, back]))

    return Family("lambda", LAMBDAS, make)


def _triangle_of(mesh: Mesh, points_mm: FloatArray) -> IntArray:
    """The number of the triangle around each point (k, 2); the nearest where none is."""
    corners = mesh.nodes_mm[mesh.triangles]
    edges = corners[:, 1:] - corners[:, :1]
    away = points_mm[:, None] - corners[None, :, 0]
    u, v = np.moveaxis(np.einsum("kti,tij->ktj", away, np.linalg.inv(edges)), -1, 0)
    return np.asarray(np.argmax(np.minimum(np.minimum(u, v), 1 - u - v), axis=1))
