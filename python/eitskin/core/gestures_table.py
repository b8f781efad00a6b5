"""Events from touches in time. Written by tables/make_tables.py from tables/gestures.toml."""

from enum import IntEnum


class EventKind(IntEnum):
    """eits_event_kind: Kinds of events."""

    DOWN = 1  # a finger landed
    MOVE = 2  # it moved by move_mm or more since it was last reported
    UP = 3  # it lifted
    TAP = 4  # down and up at one place within a short time
    DOUBLE_TAP = 5  # a second tap at the same place soon after the first, in place of its TAP
    HOLD = 6  # it has been down at one place for a long time
    SWIPE = 7  # it moved straight and lifted while it moved
    PINCH = 8  # two fingers come near one another
    SPREAD = 9  # two fingers go apart
    ROTATE = 10  # two fingers turn about one another
    PRESS = 11  # a finger is in a named zone; of a ring it also says where
    RELEASE = 12  # no finger is in the zone any more


class EventPhase(IntEnum):
    """eits_event_phase: The phase of a gesture that an event reports."""

    ONCE = 0  # all of it
    BEGIN = 1  # it was recognised and goes on
    CHANGE = 2  # it goes on with another value
    END = 3  # a finger of it lifted
