"""Results, one JSON line each, written as soon as they are computed: an interrupted run, even after
kill -9, continues from its last complete line."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from eitskin.errors import FileError
from eitskin.fileio import parse_json


def key_of(facts: dict[str, Any]) -> str:
    """A name for what ``facts`` say; equal facts have equal names."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:24]


class Store:
    """The lines of ``path``, by key. Lines that are cut or of another kind are passed over.

    Raises:
        FileError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._values: dict[str, Any] = {}
        try:
            text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        except OSError as error:
            raise FileError(
                f"{path}: cannot read it ({error.strerror}); name another folder with -o"
            ) from None
        self._torn = bool(text) and not text.endswith("\n")
        for line in text.splitlines():
            try:
                entry = parse_json(line)
                self._values[entry["key"]] = entry["values"]
            except (ValueError, KeyError, TypeError):
                continue

    def get(self, facts: dict[str, Any]) -> Any:
        """Return the value that was kept for ``facts``, or None."""
        return self._values.get(key_of(facts))

    def put(self, facts: dict[str, Any], values: Any) -> Any:
        """Keep ``values``, at once and for good; returns them as a later run would read them.

        Raises:
            FileError: it cannot be written.
        """
        key = key_of(facts)
        line = json.dumps({"key": key, "facts": facts, "values": values})
        try:
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write(("\n" if self._torn else "") + line + "\n")
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise FileError(
                f"{self.path}: cannot write it ({error.strerror}); name another folder with -o"
            ) from None
        self._torn = False
        self._values[key] = json.loads(line)["values"]
        return self._values[key]
