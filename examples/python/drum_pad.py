"""A drum pad: each press of a pad is a beat.

python examples/python/drum_pad.py        plays a scene of the library
python examples/python/drum_pad.py auto   your board
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import eitskin

ZONES = Path(__file__).resolve().parents[1] / "drum_pad.zones.toml"


def beats(url: str) -> Iterator[tuple[float, str | None]]:
    """When each pad was hit, s, and its name."""
    for frame in eitskin.stream(url, zones=ZONES):
        for event in frame.events:
            if event.name == "press":
                yield frame.time_s, event.zone_name


if __name__ == "__main__":
    for time_s, pad in beats(sys.argv[1] if len(sys.argv) > 1 else "sim:drum_beat"):
        print(f"{time_s:6.2f} s  {pad}")
