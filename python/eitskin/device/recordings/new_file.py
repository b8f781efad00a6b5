"""The file of a recording or of a sink: begun whole, locked against other recorders, brought to the
disk every second."""

import os
import tempfile
import threading
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import IO

from eitskin.errors import FileError
from eitskin.fileio import Claim, followed, replace_by, sync_folder

SYNC_S = 1.0
MAX_WAITING = 8 << 20  # bytes that wait for room on a full disk
ENDED = "the disk was full for too long; the file ends there, and can be read"


class RecordingFile:
    """A new file at ``path`` that begins with ``first``. ``overwrite`` replaces an existing
    recording, but only after the new one has begun. A path that is not a regular file is written to
    directly."""

    def __init__(self, path: Path, first: bytes, *, overwrite: bool) -> None:
        self._path = path
        self._claim: Claim | None = None
        target = followed(path)
        try:
            if target.exists() and not target.is_file():
                self._file: IO[bytes] = target.open("wb", buffering=0)
                self.write(first)
            elif overwrite and target.exists():
                self._claim = Claim(path)
                self._file = self._replaced(target, first)
            else:
                self._file = target.open("xb", buffering=0)
                self._claim = Claim(path)
                self.write(first)
                sync_folder(target)
        except FileExistsError:
            raise FileError(f"{path}: exists already; name another file, or remove it") from None
        except OSError as error:
            self._release()
            raise FileError(f"{path}: cannot write it ({error.strerror})") from None
        except FileError:
            self._release()
            raise
        self._synced = time.monotonic()
        self._syncing: threading.Thread | None = None

    def _replaced(self, target: Path, first: bytes) -> IO[bytes]:
        """Put a file that begins with ``first`` in the place of ``target``, and open it at its end.
        It is closed meanwhile, since Windows renames no open file."""
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        self._file = os.fdopen(handle, "wb", buffering=0)
        try:
            self.write(first)
            self._file.close()
            replace_by(Path(name), target)
        except BaseException:
            self._file.close()
            Path(name).unlink(missing_ok=True)
            raise
        file = target.open("r+b", buffering=0)
        file.seek(0, os.SEEK_END)
        return file

    def _release(self) -> None:
        if self._claim is not None:
            self._claim.release()

    def write(self, data: bytes) -> None:
        """Append ``data`` whole, or nothing of it."""
        try:
            written = self._file.write(data)
        except (OSError, ValueError) as error:
            raise FileError(
                f"{self._path}: cannot continue the recording ({error});"
                " the part so far can be read"
            ) from None
        if written != len(data):
            with suppress(OSError):  # only a regular file has an end to cut
                self._file.truncate(self._file.seek(-written, os.SEEK_CUR))
            raise FileError(
                f"{self._path}: cannot continue the recording (No space left on device);"
                " the part so far can be read"
            )

    @property
    def path(self) -> Path:
        return self._path

    def tell_or_zero(self) -> int:
        """Return the number of bytes written, or 0 if the file cannot report it."""
        with suppress(OSError):
            return self._file.tell()
        return 0

    def sync_now_and_then(self) -> None:
        """Once per second, begin to write buffered bytes to the disk; the caller does not wait."""
        if time.monotonic() - self._synced < SYNC_S:
            return
        self._synced = time.monotonic()
        if self._syncing is None or not self._syncing.is_alive():
            self._syncing = threading.Thread(target=self._sync, daemon=True)
            self._syncing.start()

    def _sync(self) -> None:
        with suppress(OSError, ValueError):  # only a regular file is on a disk
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Bring everything to the disk; may be called twice."""
        if self._file.closed:
            return
        if self._syncing is not None:
            self._syncing.join()
        self._sync()
        self._file.close()
        self._release()


class WaitingFile:
    """Writes into ``file``; what finds no room waits in memory, ``MAX_WAITING`` bytes at most, and
    is written in its order as soon as there is room. Each ``write`` is there whole or not at all,
    and raises nothing, so that no writer of records is cut in the middle of one. When too much
    waits, the file ends there.
    """

    def __init__(self, file: RecordingFile) -> None:
        self._file, self._waiting = file, deque[bytes]()
        self._error: FileError | None = None
        self._told = self._over = False
        self._size = file.tell_or_zero()

    def write(self, data: bytes) -> int:
        if self._over:
            return len(data)
        self._waiting.append(bytes(data))
        self._size += len(data)
        try:
            self.flush()
        except FileError as error:
            self._error = error
            if sum(map(len, self._waiting)) > MAX_WAITING:
                self._over = True
                self._waiting.clear()
        return len(data)

    def check(self) -> None:
        """Raise the FileError of a full disk once per time that it is full, or, when the file has
        ended, each time."""
        if self._over:
            raise FileError(f"{self._file.path}: {ENDED}")
        if self._error is not None and not self._told:
            self._told = True
            raise self._error

    def flush(self) -> None:
        """Write what waits."""
        while self._waiting:
            self._file.write(self._waiting[0])
            self._waiting.popleft()
        self._error, self._told = None, False

    def tell(self) -> int:
        """Return the number of bytes given so far."""
        return self._size

    def sync_now_and_then(self) -> None:
        self._file.sync_now_and_then()

    def close(self) -> None:
        """Write what waits, if there is room, and bring everything to the disk."""
        try:
            self.flush()
        finally:
            self._file.close()
