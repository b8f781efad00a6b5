"""The errors that eitskin raises, one class per kind, each with the exit code that the command line
returns.

An error's text is one line that says what was wrong, where, and what to do about it.
docs/reference/error-codes.md lists the codes.
"""

import json
import shlex
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, distribution, metadata
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

LONGEST, ENDING = 3000, 1000  # characters of a line, and of the end that is kept of longer ones


def printable(text: str) -> str:
    """Return ``text`` in one line, with escapes in place of control characters, because names come
    from boards and files."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else repr(one)[1:-1] for one in text)


class EitskinError(Exception):
    """Base of all errors that a user can cause or repair.

    ``exit_code`` is the status of the command line. The text is always one line, whatever names and
    values from files it contains.
    """

    exit_code = 1

    def __str__(self) -> str:
        text = super().__str__()
        if len(text) > LONGEST:
            # A very long word of the user is in the middle; the remedy is at the end.
            text = f"{text[: LONGEST - ENDING - 5]} ... {text[-ENDING:]}"
        return printable(text)


class UsageError(EitskinError):
    """An option or argument is out of range or contradicts another."""

    exit_code = 2


class FileError(EitskinError):
    """A file is missing, unreadable, or cannot be written."""

    exit_code = 3


class ConfigError(EitskinError):
    """A TOML description has an unknown key, a wrong type or a value out of range."""

    exit_code = 4


class GeometryError(EitskinError):
    """An outline or its electrodes are impossible (self-intersecting, overlapping, too small), or
    meshing failed."""

    exit_code = 5


class ModelError(EitskinError):
    """An .eitm model is truncated, corrupted, newer, foreign, or fails its self-test."""

    exit_code = 6


class ProtocolError(EitskinError):
    """A protocol table is invalid, or frames and model were made with different protocols."""

    exit_code = 7


class FrameError(EitskinError):
    """Boundary voltages cannot be used: wrong length, not finite, all zero, saturated."""

    exit_code = 8


class MissingExtraError(EitskinError):
    """An optional dependency is not installed; the text gives the pip command."""

    exit_code = 9


class VerificationError(EitskinError):
    """A self-check ran and its result is outside the stated bound."""

    exit_code = 10


class DeviceError(EitskinError):
    """A board or its link cannot be used: there is no port or no answer, the version or the model
    is another, or a command was refused."""

    exit_code = 12  # 11 is the doctor's


class SkinTouchedError(DeviceError):
    """A board's reference was not taken, because something touches the skin or moves on it. The
    reference before it stays."""


class SinkError(EitskinError):
    """An output for touches cannot be opened: its port is taken, or nobody answers."""

    exit_code = 13


EXTRAS = {  # the packages of each extra, and the module by which each is found
    "model": {"scipy": "scipy", "netgen-mesher": "netgen"},
    "plot": {"matplotlib": "matplotlib"},
    "drawing": {"svgelements": "svgelements", "ezdxf": "ezdxf"},
    "surface": {"trimesh": "trimesh", "fast-simplification": "fast_simplification"},
    "view": {"starlette": "starlette", "uvicorn": "uvicorn", "websockets": "websockets"},
    "completion": {"shtab": "shtab"},
    "osc": {"python-osc": "pythonosc"},
    "tuio": {"python-osc": "pythonosc"},
    "ws": {"websockets": "websockets"},
    "mqtt": {"paho-mqtt": "paho"},
    "lsl": {"pylsl": "pylsl"},
    "mcap": {"mcap-ros2-support": "mcap_ros2"},
    "ros2": {"cyclonedds": "cyclonedds"},
    "foxglove": {"foxglove-sdk": "foxglove"},
}


def missing_checkout(what: str, *folders: str) -> MissingExtraError:
    """Return the error for ``what``, which is in ``folders`` of a checkout and not in the wheel."""
    here = checkout()
    if here is not None:
        names = " ".join(shlex.quote(str(here / folder)) for folder in folders)
        return MissingExtraError(f"{what} is not installed yet: run  pip install {names}")
    names = " ".join(f"./{folder}" for folder in folders)
    return MissingExtraError(
        f"{what} comes with eitskin's sources, not with the wheel: run  git clone {sources_url()} "
        f" and in its folder  pip install {names}"
    )


def checkout() -> Path | None:
    """Return the folder of the sources from which this package was installed; None: it came as a
    wheel, or the folder is gone."""
    try:
        noted = distribution("eitskin").read_text("direct_url.json")
    except PackageNotFoundError:  # run from the sources themselves
        noted = None
    url = urlsplit(json.loads(noted).get("url", "") if noted else "")
    path = Path(url2pathname(url.path))
    return path if url.scheme == "file" and (path / "firmware" / "emulator").is_dir() else None


def sources_url() -> str:
    """Return the address of the sources, which pyproject.toml states."""
    try:
        urls = metadata("eitskin").get_all("Project-URL") or []
    except PackageNotFoundError:  # run from the sources themselves
        urls = []
    return next((url.partition(", ")[2] for url in urls if url.startswith("Source, ")), "URL")


def missing_extra(extra: str, package: str) -> MissingExtraError:
    """Return the error for an optional ``package`` that is not installed; the extra ``extra``
    brings it."""
    return MissingExtraError(
        f"this needs {package}, which is not installed: run  pip install 'eitskin[{extra}]'"
    )


def need_extras(extras: Iterable[str]) -> None:
    """Check that the packages of all these ``extras`` are installed, without importing them.

    Raises:
        MissingExtraError: some are not; the text names all of them, and one pip command.
    """
    absent = {
        extra: [package for package, module in EXTRAS[extra].items() if find_spec(module) is None]
        for extra in extras
    }
    lacking = sorted(extra for extra, packages in absent.items() if packages)
    if lacking:
        packages = sorted({package for extra in lacking for package in absent[extra]})
        *others, last = packages
        named = f"{', '.join(others)} and {last}, which are" if others else f"{last}, which is"
        raise MissingExtraError(
            f"this needs {named} not installed: run  pip install 'eitskin[{','.join(lacking)}]'"
        )
