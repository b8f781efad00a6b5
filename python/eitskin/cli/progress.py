"""Progress of long work: bars on stderr if that is a terminal, otherwise a line every ten
seconds."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from typing import Any

from tqdm import tqdm

LINE_S = 10.0


def bar(what: str) -> Callable[..., Iterable[Any]]:
    """Return a function that wraps items with a progress bar labelled ``what``; if the items have
    no length, it takes their number too."""

    def shown(items: Iterable[Any], total: int | None = None) -> Iterable[Any]:
        number = len(items) if total is None and isinstance(items, Sized) else total
        if not sys.stderr.isatty():
            return lines(items, what, number)
        wrapped: Iterable[Any] = tqdm(items, desc=what, total=number, unit="", leave=False)
        return wrapped

    return shown


def named_bar(items: Iterable[Any], what: str) -> Iterable[Any]:
    """Wrap ``items`` with a progress bar labelled ``what``."""
    return bar(what)(items)


def lines(
    items: Iterable[Any],
    what: str,
    total: int | None,
    clock: Callable[[], float] = time.monotonic,
    weight: Callable[[Any], int] = lambda item: 1,
) -> Iterator[Any]:
    """Yield ``items``, and every ten seconds print a line on stderr with how many are done, of
    ``total``, and the remaining time. ``weight`` gives how many an item counts for."""
    start = printed = clock()
    done = 0
    for item in items:
        yield item
        done += weight(item)
        now = clock()
        if now - printed < LINE_S:
            continue
        printed = now
        rest = "" if total is None else f" of {total}"
        if total is not None and 0 < done <= total:
            left = tqdm.format_interval((now - start) * (total - done) / done)
            rest += f", {left} left"
        print(f"eitskin: {what}: {done}{rest}", file=sys.stderr, flush=True)
