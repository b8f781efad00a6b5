"""Total variation, as a method of `eitskin compare`: few edges, and no pixel below 0."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from eitskin.fem.grid import Grid
from eitskin_studies.compare.families import Family, Setup

ITERATIONS = 200
PENALTY = 50.0  # of ADMM's constraints, over the weight


def neighbours(grid: Grid) -> csr_matrix:
    """The differences (edges, pixels) between kept pixels that share an edge."""
    number = grid.number
    sides = ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
    pairs = np.concatenate([np.stack(side, axis=-1).reshape(-1, 2) for side in sides])
    pairs = pairs[(pairs >= 0).all(axis=1)]
    edge = np.arange(len(pairs))
    signs = np.repeat([-1.0, 1.0], len(pairs))
    where = (np.tile(edge, 2), pairs.T.ravel())
    return csr_matrix((signs, where), shape=(len(pairs), grid.n_pixels))


@dataclass(frozen=True, eq=False)
class TotalVariation:
    """x >= 0 of the least |A x - d|^2 / 2 + weight sum |differences of x|, where A = J / s_1 and d
    is dv / s_1, scaled so that max |A'd| is 1, by ADMM (S. Boyd et al., Found. Trends Mach. Learn.
    3 (2011) 1-122) on x, its differences z and a copy w of x that is not negative."""

    jacobian: np.ndarray
    edges: csr_matrix
    weight: float
    name: str = "total variation, non-negative"

    def reconstruct(self, dv: np.ndarray) -> np.ndarray:
        """Images (k, n) of difference frames (k, m) in V."""
        a = self.jacobian / np.linalg.norm(self.jacobian, 2)
        pull = dv @ a
        size = np.maximum(np.abs(pull).max(axis=1, keepdims=True), np.finfo(float).tiny)
        pull, rho, d = pull / size, PENALTY * self.weight, self.edges
        inverse = np.linalg.inv(a.T @ a + rho * ((d.T @ d).toarray() + np.eye(a.shape[1])))
        w, off_w = np.zeros_like(pull), np.zeros_like(pull)
        z, off_z = np.zeros((len(pull), d.shape[0])), np.zeros((len(pull), d.shape[0]))
        for _ in range(ITERATIONS):
            x = (pull + rho * ((d.T @ (z - off_z).T).T + w - off_w)) @ inverse
            steps = (d @ x.T).T + off_z
            z = np.sign(steps) * np.maximum(np.abs(steps) - self.weight / rho, 0.0)
            off_z = steps - z
            w = np.maximum(x + off_w, 0.0)
            off_w += x - w
        return w * size


def family(setup: Setup) -> Family:
    """The method at each weight that is tried on the training scenes."""
    edges = neighbours(setup.grid)
    weights = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4)
    return Family("weight", weights, lambda weight: TotalVariation(setup.jacobian, edges, weight))
