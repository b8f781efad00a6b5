"""Frames of a swipe on a simulated skin, for every sink."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from eitskin.device.wire.link_table import Stream
from eitskin.live.frame import Frame
from eitskin.live.session import Session, SessionSettings
from eitskin.sinks.sink import Source

os.environ.setdefault("LSLAPICFG", str(Path(__file__).with_name("lsl_local.cfg")))


@dataclass(frozen=True)
class Swipe:
    """What was seen, and on which skin."""

    frames: list[Frame]
    source: Source

    @property
    def touches(self) -> list[list[Any]]:
        return [list(frame.touches) for frame in self.frames]


@pytest.fixture(scope="session")
def swipe() -> Swipe:
    settings = SessionSettings(mode=Stream.TOUCHES | Stream.IMAGE)
    with Session("sim:swipe", settings) as session:
        frames = [item for item in session.frames() if isinstance(item, Frame)]
        assert session.known is not None
        return Swipe(frames, Source(session.url, "simulated", session.known.model))
