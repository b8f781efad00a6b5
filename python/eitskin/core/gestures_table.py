"""Events from touches in time. Written by tables/make_tables.py from tables/gestures.toml."""

from __future__ import annotations

from enum import IntEnum


class EventKind(IntEnum):
    """eits_event_kind: What happened."""

    # a finger landed
    DOWN = 1
    # it moved by move_mm or more since it was last reported
    MOVE = 2
    # it lifted
    UP = 3
    # down and up at one place within a short time
    TAP = 4
    # a second tap at the same place soon after the first, in place of its TAP
    DOUBLE_TAP = 5
    # it has been down at one place for a long time
    HOLD = 6
    # it moved straight and lifted while it moved
    SWIPE = 7
    # two fingers come near one another
    PINCH = 8
    # two fingers go apart
    SPREAD = 9
    # two fingers turn about one another
    ROTATE = 10
    # a finger is in a named zone; of a ring it also says where
    PRESS = 11
    # no finger is in the zone any more
    RELEASE = 12


class EventPhase(IntEnum):
    """eits_event_phase: Where an event lies in what it tells of."""

    # all of it
    ONCE = 0
    # it was recognised and goes on
    BEGIN = 1
    # it goes on with another value
    CHANGE = 2
    # a finger of it lifted
    END = 3
