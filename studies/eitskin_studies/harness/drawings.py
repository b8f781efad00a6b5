"""Pictures with the numbers that they show, stored, so that a picture can be drawn again, in
another style or format, without the study that measured them.

``studies/results/numbers/pictures/PAGE.json`` has, for each picture of a page, the function of
``eitskin_studies.pictures`` that draws it, its numbers, and the commit that measured them.
"""

import importlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eitskin.errors import ConfigError, FileError
from eitskin.fileio import parse_json, read_bytes, write_beside, write_bytes
from eitskin_studies.harness.commit import last_commit
from eitskin_studies.harness.numbers import FOLDER, MEASURED

PICTURES = "pictures"  # a folder beside the numbers, and one beside the pages
FORMAT = "eitskin-drawings"
PACKAGE = "eitskin_studies.pictures"


@dataclass(frozen=True)
class Drawing:
    """A picture: ``draw``, a function of a module of ``eitskin_studies.pictures`` that takes the
    path and the numbers, and the numbers, which JSON can hold."""

    draw: Callable[[Path, Any], None]
    data: Any

    def __call__(self, path: Path) -> None:
        """Draw it, with the numbers as a stored file gives them back."""
        self.draw(path, json.loads(json.dumps(self.data)))


def file_of(page: Path) -> Path:
    """The file of the numbers behind the pictures of ``page``."""
    return page.parent / FOLDER / PICTURES / f"{page.stem}.json"


def keep_drawings(page: Path, drawings: Mapping[str, Drawing]) -> None:
    """Store the numbers of pictures, by their files relative to the folder of ``page``; other
    pictures of the page keep their numbers.

    Raises:
        FileError: it cannot be written.
        ConfigError: the file that is there does not hold numbers of pictures.
    """
    if not drawings:
        return
    path, commit = file_of(page), last_commit(MEASURED)
    kept = _read(path) if path.exists() else {}
    for file, one in drawings.items():
        module = one.draw.__module__.removeprefix(f"{PACKAGE}.")
        kept[file] = {
            "commit": commit,
            "draw": f"{module}:{one.draw.__qualname__}",
            "data": one.data,
        }
    path.parent.mkdir(parents=True, exist_ok=True)
    # a line a picture, so that differences can be read
    lines = ",\n".join(f"{json.dumps(file)}: {json.dumps(kept[file])}" for file in sorted(kept))
    head = json.dumps({"format": FORMAT})[:-1]
    write_bytes(path, f'{head}, "pictures": {{\n{lines}\n}}}}\n'.encode())


def draw_again(page: Path) -> list[Path]:
    """Draw the pictures of ``page`` from their stored numbers, and return their files.

    Raises:
        FileError: there are no stored numbers, or a picture cannot be written.
        ConfigError: the file does not hold numbers of pictures.
        MissingExtraError: matplotlib is not installed.
    """
    path, drawn = file_of(page), []
    if not path.exists():
        raise FileError(f"{path}: no such file; the study stores it when it fills its page")
    for file, one in _read(path).items():
        module, _, name = one["draw"].partition(":")
        try:
            draw = getattr(importlib.import_module(f"{PACKAGE}.{module}"), name)
        except (ImportError, AttributeError):
            raise ConfigError(
                f"{path}: {file}: {one['draw']} draws nothing any more; run its study again"
            ) from None
        target = page.parent / file
        target.parent.mkdir(parents=True, exist_ok=True)
        with write_beside(target) as temporary:
            draw(temporary, one["data"])
        drawn.append(target)
    return drawn


def _read(path: Path) -> dict[str, Any]:
    try:
        values = parse_json(read_bytes(path, "numbers of pictures"))
        if values["format"] == FORMAT:
            return dict(values["pictures"])
    except (ValueError, KeyError, TypeError):
        pass
    raise ConfigError(f"{path}: does not hold numbers of pictures; remove it and run its study")
