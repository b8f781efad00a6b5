"""Read and write files so that nothing is lost: content is written to a temporary file, which is
then renamed.

Links are followed. Devices and FIFOs are written to directly.
"""

import errno
import json
import os
import shutil
import stat
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from eitskin.errors import FileError, missing_extra

MOST_BYTES = 100_000_000


def refuse_unwritable(*paths: str | Path | None) -> None:
    """Raise a FileError before long work for outputs that ``write_beside`` would refuse after it.
    None means no output."""
    for path in (Path(given) for given in paths if given is not None):
        if not path.parent.is_dir():
            raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
        target = followed(path)
        if target.is_dir():
            raise FileError(f"{path}: this is a folder; name a file in it")
        special = target.exists() and not target.is_file()
        if not os.access(target if special else target.parent, os.W_OK):
            raise FileError(f"{path}: cannot write there (Permission denied); name another folder")


@contextmanager
def write_beside(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path. If the block succeeds, its content becomes that of ``path``,
    completely and on the disk; otherwise ``path`` stays as it was.

    A regular file is replaced by renaming and keeps its mode; a link is followed. A device or FIFO
    is never replaced: the content is written to it.

    Raises:
        FileError: the file cannot be written.
    """
    target = followed(path)
    special = target.exists() and not target.is_file()
    try:
        handle, name = tempfile.mkstemp(
            prefix=f".{target.name[:40]}.",
            suffix=target.suffix,
            dir=None if special else target.parent,
        )
        os.close(handle)
    except OSError as error:
        raise FileError(
            f"{target}: cannot write there ({error.strerror}); name a file in an existing folder"
        ) from error
    temporary = Path(name)
    try:
        yield temporary
        if special:
            with temporary.open("rb") as content, target.open("wb") as out:
                shutil.copyfileobj(content, out)
            return
        replace_by(temporary, target)
    except OSError as error:
        raise FileError(f"{target}: cannot write it ({error.strerror})") from error
    finally:
        temporary.unlink(missing_ok=True)


def followed(path: str | Path) -> Path:
    """Return the path that the links of ``path`` lead to; the file itself need not exist.

    Raises:
        FileError: the links form a circle, or cannot be read.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            return path  # a device, or the pipe of /dev/stdout, which has no other name
        return path.resolve() if path.is_symlink() else path
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise FileError(f"{path}: cannot write there ({error.strerror})") from None
    except RuntimeError:  # raised for a circle by Python up to 3.12
        pass
    raise FileError(f"{path}: its links form a circle; remove them")


def replace_by(temporary: Path, target: Path) -> None:
    """Rename ``temporary`` to ``target`` with the mode that ``target`` has or a new file would get,
    and wait until file and folder are on the disk.

    Raises:
        OSError: this failed; ``target`` is as it was.
    """
    with temporary.open("r+b") as stream:  # Windows brings only what can be written to the disk
        os.fsync(stream.fileno())
    temporary.chmod(_mode(target))
    temporary.replace(target)
    sync_folder(target)


def sync_folder(path: Path) -> None:
    """Wait until the name ``path`` is on the disk, if the system supports that."""
    with suppress(OSError):  # some systems cannot open folders
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


class Claim:
    """The right to write the file ``path``, which one program has at a time: a locked file beside
    it, which the system unlocks when the program ends. Readers are not kept out.

    Raises:
        FileError: another program, or another claim of this one, has it.
    """

    def __init__(self, path: Path) -> None:
        target = followed(path)
        beside = target.with_name(f".{target.name[-100:]}.lock")
        self._lock = FileLock(beside, timeout=0, thread_local=False)
        try:
            self._lock.acquire()
        except Timeout:
            raise FileError(
                f"{path}: another process records to it; stop that, or name another file"
            ) from None
        except (OSError, NotImplementedError):  # a file system without locks
            pass

    def release(self) -> None:
        """Let others write. It may be called twice."""
        if self._lock.is_locked:
            with suppress(OSError):
                Path(self._lock.lock_file).unlink()
            self._lock.release()


def _mode(path: Path) -> int:
    try:
        return stat.S_IMODE(path.stat().st_mode)
    except FileNotFoundError:
        umask = os.umask(0)
        os.umask(umask)
        return 0o666 & ~umask


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write ``content`` to ``path`` completely or not at all.

    Raises:
        FileError: the folder does not exist or cannot be written.
    """
    with write_beside(path) as temporary:
        temporary.write_bytes(content)


def read_bytes(path: str | Path, what: str, most: int = MOST_BYTES) -> bytes:
    """Return the content of ``path``; ``what`` names its kind in errors ("model", "frames file").

    Raises:
        FileError: the file is missing, cannot be read, or has more than ``most`` bytes.
    """
    try:
        with Path(path).open("rb") as stream:
            content = stream.read(most + 1)
    except FileNotFoundError:
        raise FileError(f"{path}: no such {what}; check the path") from None
    except (OSError, ValueError) as error:  # ValueError: the path has zero bytes
        raise FileError(
            f"{path}: cannot read this {what} ({getattr(error, 'strerror', error)})"
        ) from error
    if len(content) > most:
        raise FileError(
            f"{path}: over {most / 1e6:g} MB, more than a {what} may have; check the path"
        )
    return content


def read_mat(path: str | Path) -> dict[str, Any]:
    """Return the variables of a .mat file (MATLAB 5 to 7, Octave's -v7), with structs as dicts.

    Raises:
        FileError: the file is missing, or is not such a file.
        MissingExtraError: scipy is not installed.
    """
    try:
        from scipy.io import loadmat
    except ImportError:
        raise missing_extra("model", "scipy") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about duplicate names
            content = loadmat(str(path), simplify_cells=True, appendmat=False)
    except FileNotFoundError:
        raise FileError(f"{path}: no such MAT file; check the path") from None
    except NotImplementedError:
        raise FileError(
            f"{path}: a MATLAB 7.3 file (HDF5); save it with  save('-v7', ...)"
        ) from None
    except OSError as error:
        raise FileError(f"{path}: cannot read this MAT file ({error.strerror or error})") from None
    except Exception:  # for damaged files scipy raises many kinds
        raise FileError(
            f"{path}: not a readable MAT file: damaged, cut short, or another kind of file"
        ) from None
    return {name: value for name, value in content.items() if not name.startswith("__")}


def parse_json(text: str | bytes) -> Any:
    """Return the values of a JSON ``text``.

    Raises:
        ValueError: the text is not JSON, or is nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
