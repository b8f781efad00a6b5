"""The kept inputs of a fuzz target: one archive each, ``corpus/TARGET.zip``, not compressed, which
replay.c reads as it is and git compresses. Inputs keep the names of their files and are sorted by
them, so the same inputs make the same archive.

    python tests/fuzz/corpus.py add TARGET FILE_OR_FOLDER...   put inputs into the archive
    python tests/fuzz/corpus.py unpack TARGET FOLDER           write its inputs as files
"""

import sys
from pathlib import Path
from zipfile import ZipFile, ZipInfo

CORPUS = Path(__file__).resolve().parent / "corpus"


def read(archive: Path) -> dict[str, bytes]:
    """The inputs by name; none where the archive does not exist yet."""
    if not archive.exists():
        return {}
    with ZipFile(archive) as kept:
        return {name: kept.read(name) for name in kept.namelist()}


def write(archive: Path, inputs: dict[str, bytes]) -> None:
    """Replace the archive: sorted by name, every time 1980-01-01, which is ZipInfo's own."""
    partial = archive.with_suffix(".partial")
    with ZipFile(partial, "w") as kept:
        for name in sorted(inputs):
            kept.writestr(ZipInfo(name), inputs[name])
    partial.replace(archive)


def files_of(path: Path) -> list[Path]:
    """The file itself, or those in the folder."""
    return sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]


def add(archive: Path, paths: list[Path]) -> int:
    """Put files, and the files of folders, into the archive; returns by how many it grew."""
    inputs = read(archive)
    before = len(inputs)
    for path in [file for given in paths for file in files_of(given)]:
        inputs[path.name] = path.read_bytes()
    write(archive, inputs)
    return len(inputs) - before


def unpack(archive: Path, folder: Path) -> None:
    """Write every input of the archive as a file of the folder, which is emptied first."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in files_of(folder):
        file.unlink()
    for name, data in read(archive).items():
        (folder / name).write_bytes(data)


def main(arguments: list[str]) -> int:
    match arguments:
        case ["add", target, _, *_]:
            archive = CORPUS / f"{target}.zip"
            print(f"{add(archive, list(map(Path, arguments[2:])))} new inputs in {archive}")
        case ["unpack", target, folder]:
            unpack(CORPUS / f"{target}.zip", Path(folder))
        case _:
            print(__doc__, file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
