"""A page turner: swipe to the left for the next page, to the right for the one before.

python examples/python/page_turner.py        plays a scene of the library
python examples/python/page_turner.py auto   your board
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import eitskin

STEP = {"left": 1, "right": -1}


def pages(url: str, page: int = 1) -> Iterator[int]:
    """The page after each turn."""
    for frame in eitskin.stream(url):
        for event in frame.events:
            if event.side in STEP:
                page = max(page + STEP[event.side], 1)
                yield page


if __name__ == "__main__":
    for number in pages(sys.argv[1] if len(sys.argv) > 1 else "sim:page_turns"):
        print(f"page {number}")
