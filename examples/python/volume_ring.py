"""A volume ring: a finger that goes round turns the volume, from where it landed.

python examples/python/volume_ring.py        plays a scene of the library
python examples/python/volume_ring.py auto   your board
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import eitskin

ZONES = Path(__file__).resolve().parents[1] / "volume_ring.zones.toml"


def volumes(url: str, volume: float = 0.0) -> Iterator[float]:
    """The volume, 0 to 1, whenever it changes; a whole turn is all of it."""
    last: float | None = None
    for frame in eitskin.stream(url, zones=ZONES):
        for event in frame.events:
            if event.name == "press" and last is not None:
                step = (event.value - last + 0.5) % 1.0 - 0.5  # the shorter way round
                volume = min(max(volume + step, 0.0), 1.0)
                yield volume
            if event.zone_name is not None:
                last = event.value if event.name == "press" else None


if __name__ == "__main__":
    for level in volumes(sys.argv[1] if len(sys.argv) > 1 else "sim:ring_turn"):
        print(f"{100 * level:3.0f} %  " + "#" * round(40 * level))
