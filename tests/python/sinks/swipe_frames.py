"""Frames of a swipe on a simulated skin, and reports after its drives, for every sink."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from eitskin.device.wire.link_table import Stream
from eitskin.session.frame import DriveReport, Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.sinks.sink import TouchSource
from eitskin.truth import observe_scene

os.environ.setdefault("LSLAPICFG", str(Path(__file__).with_name("lsl_local.cfg")))


FRAMES_OF_DRIVES = 8


@dataclass(frozen=True)
class Swipe:
    """The messages of a swipe, and the skin that they are of."""

    items: list[Frame | DriveReport]
    source: TouchSource

    @property
    def frames(self) -> list[Frame]:
        return [item for item in self.items if isinstance(item, Frame)]

    @property
    def reports(self) -> list[DriveReport]:
        return [item for item in self.items if isinstance(item, DriveReport)]

    @property
    def touches(self) -> list[list[Any]]:
        return [list(frame.touches) for frame in self.frames]


def seen(session: Session, frames: int) -> Iterator[Frame | DriveReport]:
    """The first ``frames`` of a session, and its reports."""
    for item in session.messages():
        if isinstance(item, Frame | DriveReport):
            yield item
        frames -= isinstance(item, Frame)
        if frames == 0:
            return


@pytest.fixture(scope="session")
def swipe() -> Swipe:
    settings = SessionSettings(mode=Stream.TOUCHES | Stream.IMAGE)
    with Session("sim:swipe", settings, observe=observe_scene) as session:
        items = list(seen(session, 40))
        assert session.known is not None
        return Swipe(items, TouchSource(session.url, "simulated", session.known.model))


@pytest.fixture(scope="session")
def drives(swipe) -> Swipe:
    """The swipe's first frames, and reports, of ``--report drive``."""
    settings = SessionSettings(mode=Stream.TOUCHES, report="drive")
    with Session("sim:swipe", settings, observe=observe_scene) as session:
        found = Swipe(list(seen(session, FRAMES_OF_DRIVES)), swipe.source)
    assert sum(bool(report.touches) for report in found.reports) > 40
    return found
