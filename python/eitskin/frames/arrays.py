"""Named arrays of .npz, .npy and .mat files, and picking one with an error that lists what is
there."""

import io
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray
from eitskin.errors import EitskinError, FileError, FrameError
from eitskin.fileio import read_bytes, read_mat

MAX_ARRAYS = 10_000
MAX_UNPACKED_BYTES = 4_000_000_000
INNOCENT_BYTES = 100_000_000  # so much may be packed as tightly as it likes
MAX_RATIO = 300  # unpacked to packed: masks of a truth reach 100, zeros 1000
LISTED = 40
MAX_BYTES = 1_000_000_000


def read_npz(
    path: str | Path,
    what: str,
    wanted: Collection[str] | None = None,
    most_bytes: int = MAX_UNPACKED_BYTES,
) -> dict[str, AnyArray]:
    """All arrays of an .npz, without pickle; ``what`` names its kind in errors. Arrays of objects
    are left out; those that are not ``wanted`` (None: all are) are not unpacked and come out empty.
    At most ``most_bytes`` are unpacked."""
    try:
        with Path(path).open("rb") as stream:
            archive = np.load(stream, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise FileError(f"{path}: one bare array (.npy), not an .npz with named arrays")
            _refuse_inflating(archive, str(path), most_bytes)
            arrays = {}
            for name in archive.files:
                if wanted is not None and name not in wanted:
                    arrays[name] = np.zeros(0)
                    continue
                try:
                    arrays[name] = np.asarray(archive[name])
                except ValueError as error:
                    if "allow_pickle" not in str(error):
                        raise
            return arrays
    except EitskinError:
        raise
    except FileNotFoundError:
        raise FileError(f"{path}: no such {what}; check the path") from None
    except OSError as error:
        raise FileError(f"{path}: cannot read this {what} ({error.strerror or error})") from None
    except Exception:  # of a damaged file numpy and zipfile raise whatever their parsers meet
        raise FileError(
            f"{path}: not a readable .npz {what}: damaged, cut short, or another kind of file"
        ) from None


def _refuse_inflating(archive: Any, where: str, most_bytes: int) -> None:
    members = archive.zip.infolist()
    packed = sum(one.compress_size for one in members)
    unpacked = sum(one.file_size for one in members)
    if len(members) > MAX_ARRAYS:
        raise FileError(f"{where}: {len(members)} arrays, over {MAX_ARRAYS}; keep those needed")
    if unpacked > most_bytes or (unpacked > INNOCENT_BYTES and unpacked > MAX_RATIO * packed):
        raise FileError(
            f"{where}: {packed} bytes would unpack to {unpacked}; split it into smaller files"
        )


def read_arrays(path: str | Path) -> dict[str, AnyArray]:
    """All arrays of a file by name: of an .npz, of an .npy its one array as "array", of a .mat a
    struct's fields as "struct.field"."""
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        return read_npz(path, "file of arrays")
    return {"array": _read_npy(path)} if suffix == ".npy" else _read_mat(path)


def pick(arrays: Mapping[str, AnyArray], key: str, option: str, where: str) -> AnyArray:
    """The array ``key``; ``option`` is the option that named it."""
    if key not in arrays:
        raise FrameError(f"{where}: no array {key!r} for {option}; it holds {listing(arrays)}")
    return arrays[key]


def listing(arrays: Mapping[str, AnyArray]) -> str:
    """Names and shapes on one line."""
    shown = [f"{name} {array.shape}" for name, array in sorted(arrays.items())][:LISTED]
    return ", ".join(shown) + (" ..." if len(arrays) > LISTED else "") if shown else "no arrays"


def _read_npy(path: str | Path) -> AnyArray:
    content = read_bytes(path, "array", MAX_BYTES)
    try:
        return np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False))
    except Exception:  # of a damaged file numpy raises whatever its parser meets
        raise FileError(
            f"{path}: not a readable .npy file of numbers: damaged, cut short, or of objects; save"
            " it with numpy.save"
        ) from None


def _read_mat(path: str | Path) -> dict[str, AnyArray]:
    arrays: dict[str, AnyArray] = {}
    _flatten(read_mat(path), "", arrays)
    return arrays


def _flatten(content: Mapping[str, Any], prefix: str, arrays: dict[str, AnyArray]) -> None:
    for name, value in content.items():
        if isinstance(value, Mapping):
            _flatten(value, f"{prefix}{name}.", arrays)
            continue
        array = np.asarray(value)
        if array.dtype != object:
            arrays[f"{prefix}{name}"] = array
