"""The prebuilt model of the paper's skin that ships with the package, so that reconstruction needs
neither scipy nor netgen.

It was made by ``eitskin model build --paper -o python/eitskin/model/paper.eitm``; a test builds it
again and compares.
"""

from importlib import resources
from pathlib import Path

from eitskin.errors import FileError
from eitskin.model.eitm import decode_model, load_model
from eitskin.model.model import Model

NAME = "paper.eitm"


def load_prebuilt() -> tuple[Model, bytes]:
    """Return the model of the paper's skin, and its bytes."""
    try:
        blob = resources.files("eitskin.model").joinpath(NAME).read_bytes()
    except OSError:
        raise FileError(
            f"the prebuilt model {NAME} is missing from this installation; install eitskin again"
        ) from None
    return decode_model(blob, f"the prebuilt model {NAME}"), blob


def load_or_prebuilt(path: Path | None) -> tuple[Model, bytes, str]:
    """Return the model in the file ``path``, or the prebuilt model if ``path`` is None; with its
    bytes and its name for messages."""
    if path is None:
        return *load_prebuilt(), "prebuilt paper skin"
    return *load_model(path), str(path)
