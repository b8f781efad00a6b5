"""Sources of several files: a folder, a pattern, or a list, in natural order."""

import re
from collections.abc import Sequence
from glob import glob, has_magic
from pathlib import Path

from eitskin.errors import FileError

MAX_FILES = 100_000


def source_files(
    given: str | Path | Sequence[str | Path],
    suffixes: Sequence[str],
    left_out: Sequence[str | Path] = (),
) -> list[Path]:
    """Return the files that ``given`` names. A folder stands for its files with one of
    ``suffixes``, a pattern such as "run/frame*.csv" for those that match; both in natural order,
    in which 2 comes before 10. Of several files those in ``left_out`` are not returned.

    Raises:
        FileError: a folder or pattern names no file.
    """
    files: list[Path] = []
    for one in [given] if isinstance(given, (str, Path)) else given:
        path = Path(one)
        if path.is_dir():
            found = [file for file in path.iterdir() if _is_source(file, suffixes)]
            missing = f"{path}: the folder has no file that ends in {', '.join(suffixes)}"
        elif has_magic(str(path)) and not path.exists():
            found = [Path(name) for name in glob(str(path))]  # noqa: PTH207 (an absolute pattern)
            found = [file for file in found if file.is_file()]
            missing = f"{path}: no file has a name of this pattern; check the path"
        else:
            files.append(path)
            continue
        if not found or len(found) > MAX_FILES:
            raise FileError(missing if not found else f"{path}: over {MAX_FILES} files")
        files += sorted(found, key=lambda file: natural(str(file)))
    kept = [file for file in files if not _any_same(file, left_out)]
    return kept if len(files) > 1 and kept else files


def natural(name: str) -> list[tuple[int, int, str]]:
    """Return a key that sorts names by the numbers in them."""
    pieces = re.split(r"(\d+)", name)
    return [(0, int(piece), "") if piece.isdecimal() else (1, 0, piece) for piece in pieces]


def _is_source(file: Path, suffixes: Sequence[str]) -> bool:
    return file.is_file() and file.suffix.lower() in suffixes and not file.name.startswith(".")


def _any_same(file: Path, others: Sequence[str | Path]) -> bool:
    return file.exists() and any(Path(o).exists() and file.samefile(o) for o in others)
