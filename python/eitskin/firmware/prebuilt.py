"""The prebuilt image of the NUCLEO-F767ZI, and its manifest: compiler, hash of the sources, size
and hash of the image."""

import hashlib
import json
from dataclasses import asdict, dataclass
from importlib import resources
from pathlib import Path

from eitskin.errors import FileError
from eitskin.fileio import read_bytes, write_bytes

BOARD = "nucleo_f767zi"
IMAGE, MANIFEST = f"{BOARD}.bin", f"{BOARD}.json"
SOURCES = ("csrc", "firmware", "cmake", "CMakeLists.txt", "CMakePresets.json")
EMULATOR = Path("firmware", "emulator")  # Python, and no part of the image


@dataclass(frozen=True)
class Manifest:
    """The origin of an image: the compiler's version line, SHA-256 of the sources and of the image,
    and its size in bytes."""

    compiler: str
    sources_sha256: str
    image_sha256: str
    image_bytes: int


def load_image() -> tuple[bytes, Manifest]:
    """The shipped image and its manifest."""
    folder = resources.files("eitskin.firmware")
    try:
        image = folder.joinpath(IMAGE).read_bytes()
        manifest = Manifest(**json.loads(folder.joinpath(MANIFEST).read_text(encoding="utf-8")))
    except (OSError, TypeError, ValueError):
        raise FileError(
            f"the prebuilt firmware {IMAGE} is missing from this installation; install eitskin"
            " again"
        ) from None
    if hashlib.sha256(image).hexdigest() != manifest.image_sha256:
        raise FileError(
            f"the prebuilt firmware {IMAGE} is not the one that its manifest states; install"
            " eitskin again"
        )
    return image, manifest


def hash_of_sources(root: Path) -> str:
    """SHA-256 over names and contents of everything that the image is built from, in a checkout at
    ``root``."""
    total = hashlib.sha256()
    for name in SOURCES:
        top = root / name
        for path in sorted(top.rglob("*")) if top.is_dir() else [top]:
            file = path.relative_to(root)
            if path.is_file() and EMULATOR not in file.parents:
                content = hashlib.sha256(path.read_bytes()).hexdigest()
                total.update(f"{file.as_posix()} {content}\n".encode())
    return total.hexdigest()


def describe(root: Path, image: bytes, compiler: str) -> Manifest:
    """The manifest of ``image``, just built from the checkout at ``root`` by ``compiler``."""
    return Manifest(compiler, hash_of_sources(root), hashlib.sha256(image).hexdigest(), len(image))


def ship(root: Path, built: Path, compiler: str) -> Manifest:
    """Copy the image ``built`` and its manifest into the package of the checkout at ``root``."""
    image = read_bytes(built, "firmware image")
    manifest = describe(root, image, compiler)
    folder = root / "python" / "eitskin" / "firmware"
    write_bytes(folder / IMAGE, image)
    write_bytes(folder / MANIFEST, (json.dumps(asdict(manifest), indent=2) + "\n").encode())
    return manifest


def main(root: str, built: str, compiler: str) -> None:
    """``python -m eitskin.firmware.prebuilt ROOT IMAGE COMPILER``: what ``scripts/firmware
    --prebuilt`` calls."""
    manifest = ship(Path(root), Path(built), compiler)
    print(f"{IMAGE}: {manifest.image_bytes} bytes, {manifest.compiler}")


if __name__ == "__main__":
    import sys

    main(*sys.argv[1:])
