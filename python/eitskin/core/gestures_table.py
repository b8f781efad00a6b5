"""Events from touches in time. Written by tables/make_tables.py from tables/gestures.toml."""

from enum import IntEnum


class EventKind(IntEnum):
    """eits_event_kind: Kinds of events."""

    DOWN = 1  # a finger landed
    MOVE = 2  # a finger moved by move_mm or more since it was last reported
    UP = 3  # a finger lifted
    TAP = 4  # a finger landed and lifted at one place within a short time
    # a second tap at the same place, soon after the first; reported in place of its TAP
    DOUBLE_TAP = 5
    HOLD = 6  # a finger has stayed at one place for a long time
    SWIPE = 7  # a finger moved straight, and lifted while it moved
    PINCH = 8  # two fingers approach each other
    SPREAD = 9  # two fingers move apart
    ROTATE = 10  # two fingers turn around each other
    PRESS = 11  # a finger is in a named zone; in a ring, the event also reports where
    RELEASE = 12  # no finger is in the zone any more


class EventPhase(IntEnum):
    """eits_event_phase: The phase of a gesture that an event reports."""

    ONCE = 0  # the whole gesture, in one event
    BEGIN = 1  # the gesture was recognised, and continues
    CHANGE = 2  # it continues, with another value
    END = 3  # it ended: one of its fingers lifted
