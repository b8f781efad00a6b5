"""Whether this process is eitskin's own, as on the command line, or a program of the user's, whose
settings are left alone."""

import logging
import os
import warnings


class _Process:
    own = False


def take_over() -> None:
    """This process is eitskin's own: what the user set for other programs is ignored, here and in
    the processes that are started from here."""
    _Process.own = True
    os.environ["MPLBACKEND"] = "agg"
    os.environ.pop("PYTHONWARNINGS", None)
    warnings.resetwarnings()
    warnings.simplefilter("ignore")
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # such as of a HOME that is read-only


def is_own() -> bool:
    """Whether ``take_over`` was called."""
    return _Process.own
