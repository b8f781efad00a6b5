"""Reading and writing files so that nothing is lost: written beside, then renamed.

Links are followed; devices and FIFOs are written into.
"""

import errno
import fcntl
import json
import os
import shutil
import stat
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from eitskin.errors import FileError, missing_extra

MOST_BYTES = 100_000_000


def refuse_unwritable(*paths: str | Path | None) -> None:
    """Refuse before long work the outputs that ``write_beside`` would refuse after it; None stands
    for no output."""
    for path in (Path(given) for given in paths if given is not None):
        if not path.parent.is_dir():
            raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
        target = followed(path)
        if target.is_dir():
            raise FileError(f"{path}: this is a folder; name a file in it")
        if not os.access(
            target if target.exists() and not target.is_file() else target.parent, os.W_OK
        ):
            raise FileError(f"{path}: cannot write there (Permission denied); name another folder")


@contextmanager
def write_beside(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path; if the block succeeds, what it wrote becomes the content of ``path``,
    whole and on the disk, else ``path`` stays as it was.

    A regular file is replaced by rename and keeps its mode; a link is followed. What is no regular
    file (a device, a FIFO) is never replaced: the content is written into it.
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
    """Where links lead from ``path``; the file at the end need not exist."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            return path  # a device, or the pipe behind /dev/stdout, which has no other name
        return path.resolve() if path.is_symlink() else path
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise FileError(f"{path}: cannot write there ({error.strerror})") from None
    except RuntimeError:  # how Python up to 3.12 names a circle
        pass
    raise FileError(f"{path}: its links go in a circle; remove them")


def replace_by(temporary: Path, target: Path) -> None:
    """Rename ``temporary`` to ``target`` with the mode that ``target`` has or a new file would get,
    and wait until file and folder are on the disk.

    Raises:
        OSError: it cannot be done; ``target`` is as it was.
    """
    temporary.chmod(_mode(target))
    with temporary.open("rb") as stream:
        os.fsync(stream.fileno())
    temporary.replace(target)
    sync_folder(target)


def sync_folder(path: Path) -> None:
    """Wait until the name ``path`` is on the disk, where the system can do that."""
    with suppress(OSError):  # some systems do not open folders
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def locked(stream: IO[bytes]) -> bool:
    """Lock ``stream`` as who records to it; False where another recorder has it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _mode(path: Path) -> int:
    try:
        return stat.S_IMODE(path.stat().st_mode)
    except FileNotFoundError:
        umask = os.umask(0)
        os.umask(umask)
        return 0o666 & ~umask


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write ``content`` to ``path`` whole or not at all.

    Raises:
        FileError: the folder does not exist or cannot be written.
    """
    with write_beside(path) as temporary:
        temporary.write_bytes(content)


def read_bytes(path: str | Path, what: str, most: int = MOST_BYTES) -> bytes:
    """The content of ``path``; ``what`` names its kind in the error ("model", "frames file")."""
    try:
        with Path(path).open("rb") as stream:
            content = stream.read(most + 1)
    except FileNotFoundError:
        raise FileError(f"{path}: no such {what}; check the path") from None
    except (OSError, ValueError) as error:  # a ValueError: zero bytes in the path
        raise FileError(
            f"{path}: cannot read this {what} ({getattr(error, 'strerror', error)})"
        ) from error
    if len(content) > most:
        raise FileError(
            f"{path}: over {most / 1e6:g} MB, more than a {what} may have; check the path"
        )
    return content


def read_mat(path: str | Path) -> dict[str, Any]:
    """The variables of a .mat file (MATLAB 5 to 7, Octave's -v7): structs as dicts."""
    try:
        from scipy.io import loadmat
    except ImportError:
        raise missing_extra("model", "scipy") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of names that stand twice
            content = loadmat(str(path), simplify_cells=True, appendmat=False)
    except FileNotFoundError:
        raise FileError(f"{path}: no such MAT file; check the path") from None
    except NotImplementedError:
        raise FileError(
            f"{path}: a MATLAB 7.3 file (HDF5); save it with  save('-v7', ...)"
        ) from None
    except OSError as error:
        raise FileError(f"{path}: cannot read this MAT file ({error.strerror or error})") from None
    except Exception:  # of a damaged file scipy raises whatever its parser meets
        raise FileError(
            f"{path}: not a readable MAT file: damaged, cut short, or another kind of file"
        ) from None
    return {name: value for name, value in content.items() if not name.startswith("__")}


def parse_json(text: str | bytes) -> Any:
    """The values of a JSON ``text``."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
