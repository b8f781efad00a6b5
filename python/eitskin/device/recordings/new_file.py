"""The file of a recording or of a sink: begun whole, locked against other recorders, brought to the
disk every second."""

import os
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from eitskin.errors import FileError
from eitskin.fileio import followed, locked, replace_by, sync_folder

SYNC_S = 1.0


class RecordingFile:
    """A new file at ``path`` that begins with ``first``; ``overwrite`` replaces a recording that is
    there, but only once the new one has begun. What is no regular file is written into."""

    def __init__(self, path: Path, first: bytes, *, overwrite: bool) -> None:
        self._path = path
        target = followed(path)
        try:
            if target.exists() and not target.is_file():
                self._file: IO[bytes] = target.open("wb", buffering=0)
                self.write(first)
            elif overwrite and target.exists():
                self._replace(target, first)
            else:
                self._file = target.open("xb", buffering=0)
                locked(self._file)
                self.write(first)
                sync_folder(target)
        except FileExistsError:
            raise FileError(f"{path}: exists already; name another file, or remove it") from None
        except OSError as error:
            raise FileError(f"{path}: cannot write it ({error.strerror})") from None
        self._synced = time.monotonic()
        self._syncing: threading.Thread | None = None

    def _replace(self, target: Path, first: bytes) -> None:
        with target.open("rb") as old:
            if not locked(old):
                raise FileError(
                    f"{self._path}: another process records to it; stop that, or name another file"
                )
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        self._file = os.fdopen(handle, "wb", buffering=0)
        try:
            locked(self._file)
            self.write(first)
            replace_by(Path(name), target)
        except BaseException:
            self._file.close()
            Path(name).unlink(missing_ok=True)
            raise

    def write(self, data: bytes) -> None:
        try:
            written = self._file.write(data)
        except (OSError, ValueError) as error:
            raise FileError(
                f"{self._path}: cannot go on recording ({error}); what was recorded can be read"
            ) from None
        if written != len(data):
            raise FileError(
                f"{self._path}: cannot go on recording (the disk is full); what was recorded can be"
                " read"
            )

    def tell(self) -> int:
        """How many bytes are written."""
        return self._file.tell()

    def flush(self) -> None:
        """Nothing is held back; for writers that want to be sure."""

    def sync_now_and_then(self) -> None:
        """Once a second, begin to bring what was written to the disk; the caller does not wait."""
        if time.monotonic() - self._synced < SYNC_S:
            return
        self._synced = time.monotonic()
        if self._syncing is None or not self._syncing.is_alive():
            self._syncing = threading.Thread(target=self._sync, daemon=True)
            self._syncing.start()

    def _sync(self) -> None:
        with suppress(OSError, ValueError):  # what is no regular file has no disk
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Bring everything to the disk; may be called twice."""
        if self._file.closed:
            return
        if self._syncing is not None:
            self._syncing.join()
        self._sync()
        self._file.close()
