"""Packages that only some studies need."""

from eitskin.errors import MissingExtraError


def missing_studies_extra(extra: str, package: str) -> MissingExtraError:
    """The error for an absent ``package``, of the studies' extra named ``extra``."""
    return MissingExtraError(
        f"this needs {package}, which is not installed: run in the checkout "
        f" pip install './studies[{extra}]'"
    )
