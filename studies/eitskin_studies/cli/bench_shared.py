"""Shared by the files of ``eitskin bench``: a page to fill, limits of numbers, a bar."""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin_studies.harness.sections import existing_page

if TYPE_CHECKING:
    from eitskin_studies.harness.sections import Filling


def add_page_option(parser: argparse.ArgumentParser, page: str = "benchmarks") -> None:
    """``--page`` and ``--json``."""
    option(
        parser,
        "--page FILE.md",
        f"fill the marked places of this page, studies/results/{page}.md",
        existing_page,
    )
    option(parser, "--json")


def show(
    options: argparse.Namespace,
    result: Any,
    text: str,
    filling: "Filling | None" = None,
    page: str = "benchmarks",
) -> int:
    """Fill the page that ``options.page`` names, if any, then print ``result`` as text or JSON."""
    from eitskin_studies.harness.sections import fill_marks

    if filling is not None and options.page is not None:
        fill_marks(options.page, page, filling)
    print(json.dumps(result.as_dict(), indent=2) if options.json else text)
    return 0


def check_within(name: str, value: int, low: int, high: int) -> None:
    """
    Raises:
        UsageError: ``value`` is not from ``low`` to ``high``.
    """
    if not low <= value <= high:
        raise UsageError(f"bench: {name} {value} is out of range; use {low} to {high}")


def progress_bar(items: Sequence[Any]) -> Iterable[Any]:
    """A bar on stderr where that is a terminal; nothing otherwise."""
    from tqdm import tqdm

    shown: Iterable[Any] = tqdm(items, unit="", leave=False, disable=not sys.stderr.isatty())
    return shown
