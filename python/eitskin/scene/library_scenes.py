"""The scenes that ship with the package, found by name."""

from importlib.resources import files
from pathlib import Path

from eitskin.config import load_toml, nearest
from eitskin.errors import FileError
from eitskin.scene.description import Scene, load_scene


def library() -> dict[str, Path]:
    """Return the file of each library scene by its name."""
    folder = Path(str(files("eitskin.scene"))) / "library"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def descriptions() -> dict[str, str]:
    """Return the description of each library scene by its name."""
    return {
        name: str(load_toml(path, "scene")["scene"]["description"])
        for name, path in library().items()
    }


def scene_path(name: str) -> Path:
    """Return the file of ``name``: a path as given, or a library scene with or without ".toml".

    Raises:
        FileError: there is no such scene.
    """
    path, known = Path(name), library()
    if path.exists():
        return path
    if path.suffix == ".toml":
        return known.get(path.stem, path) if str(path.parent) == "." else path
    if name not in known:
        raise FileError(
            f"{name}: no such scene file, nor a scene of the library; {nearest(name, known)}"
        )
    return known[name]


def find_scene(name: str) -> Scene:
    """Return the scene ``name``: a file, or one of the library. Errors are those of ``scene_path``
    and ``load_scene``."""
    return load_scene(scene_path(name))
