"""The truncated singular value decomposition, as a method of `eitskin compare`."""

import numpy as np

from eitskin_studies.compare.families import Family, Setup


class TruncatedSvd:
    """x = sum of the first `rank` terms v (u'dv) / s of J = U S V'."""

    def __init__(self, jacobian: np.ndarray, rank: int) -> None:
        u, s, vt = np.linalg.svd(jacobian, full_matrices=False)
        self.name = "truncated SVD"
        self.matrix = (vt[:rank].T / s[:rank]) @ u[:, :rank].T

    def reconstruct(self, dv: np.ndarray) -> np.ndarray:
        """Images (k, n) of difference frames (k, m) in V."""
        return dv @ self.matrix.T


def family(setup: Setup) -> Family:
    """The method at each rank that is tried on the training scenes."""
    return Family("rank", (20, 40, 60, 80), lambda rank: TruncatedSvd(setup.jacobian, int(rank)))
