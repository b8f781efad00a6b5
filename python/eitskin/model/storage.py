"""Storage of the reduced Jacobian as f32, f16, or i16 and i8 with a scale per column."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray, FloatArray
from eitskin.errors import UsageError

STORAGES = ("f32", "f16", "i16", "i8")
DTYPES: dict[str, np.dtype[Any]] = {
    "f32": np.dtype("<f4"),
    "f16": np.dtype("<f2"),
    "i16": np.dtype("<i2"),
    "i8": np.dtype("i1"),
}


def stride_for(rank: int) -> int:
    """Return the count of numbers from one column to the next: the rank rounded up to a multiple of
    8."""
    return (rank + 7) // 8 * 8


@dataclass(frozen=True, eq=False)
class StoredMatrix:
    """Columns (n, stride) in the type of the storage, padded with zeros. ``scale`` (n,) float32
    exists for integer types only."""

    storage: str
    columns: AnyArray
    scale: npt.NDArray[np.float32] | None

    def decode(self, rank: int) -> FloatArray:
        """Return the matrix (rank, n) that the stored numbers represent."""
        wide = self.columns[:, :rank].astype(np.float64)
        if self.scale is not None:
            wide *= self.scale[:, None].astype(np.float64)
        return np.ascontiguousarray(wide.T)


def store(matrix: npt.ArrayLike, storage: str) -> StoredMatrix:
    """Store ``matrix`` (r, n) as ``storage``; integers are rounded to the nearest step of their
    column.

    Raises:
        UsageError: a value does not fit the storage.
    """
    wide = np.asarray(matrix, dtype=np.float64)
    rank, n = wide.shape
    padded = np.zeros((n, stride_for(rank)))
    padded[:, :rank] = wide.T
    dtype = DTYPES[storage]
    most = float(np.finfo(dtype if dtype.kind == "f" else np.float32).max)
    greatest = float(np.abs(padded).max(initial=0.0))
    if not greatest <= most:
        raise UsageError(
            f"model: a sensitivity of {greatest:.3g} does not fit {storage}; use another storage"
        )
    if dtype.kind == "f":
        return StoredMatrix(storage, padded.astype(dtype), None)
    top = float(np.iinfo(dtype).max)
    peak = np.abs(padded).max(axis=1)
    # a column whose step would be subnormal gets a scale of 1, so it is stored as zeros
    scale = np.where(peak / top >= np.finfo(np.float32).tiny, peak / top, 1.0).astype("<f4")
    levels = np.clip(np.rint(padded / scale[:, None].astype(np.float64)), -top, top)
    return StoredMatrix(storage, levels.astype(dtype), scale)
