"""Name all extras that a command lacks before it starts, and not one after another."""

import argparse
from collections.abc import Iterator

from eitskin.errors import EXTRAS, need_extras

DRAWINGS = ("picture", "film")  # options that name a drawing


def refuse_missing_extras(options: argparse.Namespace) -> None:
    """Raise a MissingExtraError that names every extra which the command with these ``options``
    needs and which is not installed. A command adds its own by ``set_defaults(extras=...)``: their
    names, or a function of the options that returns them."""
    need_extras(set(_needed(options)))


def _needed(options: argparse.Namespace) -> Iterator[str]:
    own = getattr(options, "extras", ())
    yield from own(options) if callable(own) else own
    if str(getattr(options, "device", None)).startswith("sim:"):
        yield "model"  # a scene is simulated by finite elements
    if any(getattr(options, name, None) is not None for name in DRAWINGS):
        yield "plot"
    for url in getattr(options, "to", None) or ():
        if url.partition(":")[0] in EXTRAS:
            yield url.partition(":")[0]
