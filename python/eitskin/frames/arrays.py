"""Read named arrays from .npz, .npy and .mat files, and pick one with an error that lists the
arrays of the file."""

import io
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray
from eitskin.config import first_few
from eitskin.errors import EitskinError, FileError, FrameError
from eitskin.fileio import read_bytes, read_mat

MAX_ARRAYS = 10_000
MAX_UNPACKED_BYTES = 4_000_000_000
INNOCENT_BYTES = 100_000_000  # up to this size any compression ratio is accepted
MAX_RATIO = 300  # unpacked over packed size; masks of a truth reach 100, zeros reach 1000
LISTED = 40
PICKLED = "an array of pickled Python objects; save it as numbers:  np.savez(..., v=np.stack(v))"
CELL = "a cell array; save it as numbers:  v = cell2mat(v); save('-v7', ...)"
STRUCTS = "an array of structs; save it as numbers:  v = [v.meas]; save('-v7', ...)"
MAX_BYTES = 1_000_000_000


class NamedArrays(dict[str, AnyArray]):
    """The arrays of a file by name. ``others`` are the names of everything else in it, with what
    it is and what to do about it."""

    def __init__(self) -> None:
        super().__init__()
        self.others: dict[str, str] = {}


def read_npz(
    path: str | Path,
    what: str,
    wanted: Collection[str] | None = None,
    most_bytes: int = MAX_UNPACKED_BYTES,
) -> NamedArrays:
    """Return the arrays of an .npz by name, without pickle; ``what`` names the kind of file in
    errors.

    Arrays of objects are named in ``others``. Only ``wanted`` arrays are unpacked (None: all); the
    rest come out empty. At most ``most_bytes`` are unpacked.

    Raises:
        FileError: the file cannot be read, is damaged, or would unpack to too much.
    """
    try:
        with Path(path).open("rb") as stream:
            archive = np.load(stream, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise FileError(f"{path}: one bare array (.npy), not an .npz with named arrays")
            _refuse_inflating(archive, str(path), most_bytes)
            arrays = NamedArrays()
            for name in archive.files:
                if wanted is not None and name not in wanted:
                    arrays[name] = np.zeros(0)
                    continue
                try:
                    arrays[name] = np.asarray(archive[name])
                except ValueError as error:
                    if "allow_pickle" not in str(error):
                        raise
                    arrays.others[name] = PICKLED
            return arrays
    except EitskinError:
        raise
    except FileNotFoundError:
        raise FileError(f"{path}: no such {what}; check the path") from None
    except OSError as error:
        raise FileError(f"{path}: cannot read this {what} ({error.strerror or error})") from None
    except Exception:  # numpy and zipfile raise many kinds of errors for a damaged file
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


def read_arrays(path: str | Path) -> NamedArrays:
    """Return all arrays of a file by name. The array of an .npy is called "array"; the fields of a
    struct in a .mat are called "struct.field"."""
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        return read_npz(path, "file of arrays")
    if suffix != ".npy":
        return _read_mat(path)
    arrays = NamedArrays()
    arrays["array"] = _read_npy(path)
    return arrays


def pick(arrays: Mapping[str, AnyArray], key: str, option: str, where: str) -> AnyArray:
    """Return the array ``key``, which ``option`` asked for.

    Raises:
        FrameError: there is no such array.
    """
    others = arrays.others if isinstance(arrays, NamedArrays) else {}
    if key in others:
        raise FrameError(f"{where}: {key!r} for {option} is {others[key]}")
    inside = [name for name in (*arrays, *others) if name.startswith(f"{key}.")]
    if inside:
        raise FrameError(
            f"{where}: {key!r} for {option} is a struct; name one of its fields:"
            f" {first_few(inside, LISTED)}"
        )
    if key not in arrays:
        kinds = ", ".join(f"{name} ({kind.partition(';')[0]})" for name, kind in others.items())
        raise FrameError(
            f"{where}: no array {key!r} for {option}; it holds {listing(arrays)}"
            + (f"; not as numbers: {kinds}" if kinds else "")
        )
    return arrays[key]


def listing(arrays: Mapping[str, AnyArray]) -> str:
    """Return names and shapes on one line."""
    shown = [f"{name} {array.shape}" for name, array in sorted(arrays.items())][:LISTED]
    return ", ".join(shown) + (" ..." if len(arrays) > LISTED else "") if shown else "no arrays"


def _read_npy(path: str | Path) -> AnyArray:
    content = read_bytes(path, "array", MAX_BYTES)
    try:
        return np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False))
    except Exception:  # numpy raises many kinds of errors for a damaged file
        raise FileError(
            f"{path}: not a readable .npy file of numbers: damaged, cut short, or of objects; save"
            " it with numpy.save"
        ) from None


def _read_mat(path: str | Path) -> NamedArrays:
    arrays = NamedArrays()
    _flatten(read_mat(path), "", arrays)
    return arrays


def _flatten(content: Mapping[str, Any], prefix: str, arrays: NamedArrays) -> None:
    for name, value in content.items():
        if isinstance(value, Mapping):
            _flatten(value, f"{prefix}{name}.", arrays)
            continue
        if hasattr(value, "toarray"):
            value = value.toarray()  # a sparse matrix
        try:
            array = np.asarray(value)
        except ValueError:  # cells of unlike sizes
            array = np.asarray(None)
        if array.dtype != object:
            arrays[f"{prefix}{name}"] = array
        else:
            items = value if isinstance(value, (list, np.ndarray)) else []
            structs = len(items) > 0 and all(isinstance(one, Mapping) for one in np.ravel(items))
            arrays.others[f"{prefix}{name}"] = STRUCTS if structs else CELL
