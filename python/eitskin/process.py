"""Whether this process is eitskin's own, as on the command line, or a program of the user's, whose
settings are left alone."""

import logging
import os
import warnings


class _Process:
    own = False


def take_over() -> None:
    """Make this process eitskin's own: settings that the user made for other programs are ignored,
    here and in child processes."""
    _Process.own = True
    os.environ["MPLBACKEND"] = "agg"
    os.environ.pop("PYTHONWARNINGS", None)
    warnings.resetwarnings()
    warnings.simplefilter("ignore")
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # such as of a HOME that is read-only


def is_own() -> bool:
    """Return whether ``take_over`` was called."""
    return _Process.own
