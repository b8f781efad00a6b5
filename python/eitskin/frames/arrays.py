"""Named arrays of .npz, .npy and .mat files, and picking one with an error that lists what is
there."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitskin.errors import FileError, FrameError
from eitskin.fileio import read_bytes, read_mat
from eitskin.frames.frames import read_npz

LISTED = 40
MAX_BYTES = 1_000_000_000


def read_arrays(path: str | Path) -> dict[str, NDArray[Any]]:
    """All arrays of a file by name: of an .npz, of an .npy its one array as "array", of a .mat a
    struct's fields as "struct.field".

    Raises:
        FileError: it cannot be read.
        MissingExtraError: a .mat file without scipy.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        return read_npz(path, "file of arrays")
    return {"array": _read_npy(path)} if suffix == ".npy" else _read_mat(path)


def pick(arrays: Mapping[str, NDArray[Any]], key: str, option: str, where: str) -> NDArray[Any]:
    """The array ``key``; ``option`` is the option that named it.

    Raises:
        FrameError: it is not there; the text lists the arrays that are.
    """
    if key not in arrays:
        raise FrameError(f"{where}: no array {key!r} for {option}; it holds {listing(arrays)}")
    return arrays[key]


def listing(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Names and shapes on one line."""
    shown = [f"{name} {array.shape}" for name, array in sorted(arrays.items())][:LISTED]
    return ", ".join(shown) + (" ..." if len(arrays) > LISTED else "") if shown else "no arrays"


def _read_npy(path: str | Path) -> NDArray[Any]:
    content = read_bytes(path, "array", MAX_BYTES)
    try:
        return np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False))
    except Exception:  # of a damaged file numpy raises whatever its parser meets
        raise FileError(
            f"{path}: not a readable .npy file of numbers: damaged, cut short, or of objects; save"
            " it with numpy.save"
        ) from None


def _read_mat(path: str | Path) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {}
    _flatten(read_mat(path), "", arrays)
    return arrays


def _flatten(content: Mapping[str, Any], prefix: str, arrays: dict[str, NDArray[Any]]) -> None:
    for name, value in content.items():
        if isinstance(value, Mapping):
            _flatten(value, f"{prefix}{name}.", arrays)
            continue
        array = np.asarray(value)
        if array.dtype != object:
            arrays[f"{prefix}{name}"] = array
