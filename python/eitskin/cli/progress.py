"""Bars on stderr where that is a terminal; nothing otherwise."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from typing import Any


def bar(what: str) -> Callable[..., Iterable[Any]]:
    """Wraps items, and where they have no length their number, with a bar of ``what``."""

    def shown(items: Iterable[Any], total: int | None = None) -> Iterable[Any]:
        from tqdm import tqdm

        hidden = not sys.stderr.isatty()
        wrapped: Iterable[Any] = tqdm(
            items, desc=what, total=total, unit="", leave=False, disable=hidden
        )
        return wrapped

    return shown
