"""Show the progress of long work by wrapping the items that it processes."""

from collections.abc import Callable, Iterable
from typing import Any

# called with the items, and with their number or a title if the step has one
Progress = Callable[..., Iterable[Any]]


def silent(items: Iterable[Any], *_: Any) -> Iterable[Any]:
    """Return the items and show nothing."""
    return items
