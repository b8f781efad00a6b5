"""Reading and writing files so that nothing is lost: written beside, then renamed."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from eitskin.errors import FileError


def refuse_unwritable(*paths: str | Path | None) -> None:
    """Refuse before long work the outputs that ``write_beside`` would refuse after it; None stands
    for no output.

    Raises:
        FileError: a path's folder does not exist, or the path is a folder itself.
    """
    for path in (Path(given) for given in paths if given is not None):
        if not path.parent.is_dir():
            raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
        if path.is_dir():
            raise FileError(f"{path}: this is a folder; name a file in it")


@contextmanager
def write_beside(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``; rename it to ``path`` if the block
    succeeds, else remove it.

    Raises:
        FileError: the folder does not exist or cannot be written.
    """
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(
            prefix=f".{target.name}.", suffix=target.suffix, dir=target.parent
        )
        os.close(handle)
    except OSError as error:
        raise FileError(
            f"{target}: cannot write there ({error.strerror}); name a file in an existing folder"
        ) from error
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(target)
    except OSError as error:
        raise FileError(f"{target}: cannot write it ({error.strerror})") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write ``content`` to ``path`` whole or not at all.

    Raises:
        FileError: the folder does not exist or cannot be written.
    """
    with write_beside(path) as temporary:
        temporary.write_bytes(content)


def read_bytes(path: str | Path, what: str) -> bytes:
    """The content of ``path``; ``what`` names its kind in the error ("model", "frames file").

    Raises:
        FileError: it does not exist or cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise FileError(f"{path}: no such {what}; check the path") from None
    except (OSError, ValueError) as error:  # a ValueError: zero bytes in the path
        raise FileError(
            f"{path}: cannot read this {what} ({getattr(error, 'strerror', error)})"
        ) from error


def parse_json(text: str | bytes) -> Any:
    """The values of a JSON ``text``.

    Raises:
        ValueError: it is no JSON, not UTF-8, or nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
