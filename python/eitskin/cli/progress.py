"""How far long work is, and how long it still takes: bars on stderr where that is a terminal, a
line every ten seconds elsewhere."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from typing import Any

from tqdm import tqdm

LINE_S = 10.0


def bar(what: str) -> Callable[..., Iterable[Any]]:
    """Wraps items, and where they have no length their number, with a bar of ``what``."""

    def shown(items: Iterable[Any], total: int | None = None) -> Iterable[Any]:
        number = len(items) if total is None and isinstance(items, Sized) else total
        if not sys.stderr.isatty():
            return lines(items, what, number)
        wrapped: Iterable[Any] = tqdm(items, desc=what, total=number, unit="", leave=False)
        return wrapped

    return shown


def named_bar(items: Iterable[Any], what: str) -> Iterable[Any]:
    """``items`` with a bar of ``what``."""
    return bar(what)(items)


def lines(
    items: Iterable[Any],
    what: str,
    total: int | None,
    clock: Callable[[], float] = time.monotonic,
    weight: Callable[[Any], int] = lambda item: 1,
) -> Iterator[Any]:
    """``items``; every ten seconds a line on stderr says how many are done, of ``total``, and how
    long the rest takes. ``weight``: how many an item counts for."""
    start = said = clock()
    done = 0
    for item in items:
        yield item
        done += weight(item)
        now = clock()
        if now - said < LINE_S:
            continue
        said = now
        rest = "" if total is None else f" of {total}"
        if total is not None and 0 < done <= total:
            left = tqdm.format_interval((now - start) * (total - done) / done)
            rest += f", {left} left"
        print(f"eitskin: {what}: {done}{rest}", file=sys.stderr, flush=True)
