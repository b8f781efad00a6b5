"""A stream's gestures: the board's own if it sends them, else those that the same C code finds here
in its touches. Named zones are always examined here."""

from collections.abc import Sequence

from eitskin.core.gestures import GestureEvent, Gestures, Zone
from eitskin.session.frame import Frame


class StreamGestures:
    """Takes the frames of a stream in their order."""

    def __init__(self, zones: Sequence[Zone] = ()) -> None:
        self._gestures = Gestures(zones)

    def take(self, frame: Frame) -> tuple[GestureEvent, ...]:
        """Return the events of ``frame``; none if its touches are not known."""
        if frame.board_events is not None:
            return frame.board_events + tuple(self._gestures.press_zones(frame.board_events))
        if not frame.has_touches or frame.refused is not None:
            return ()
        return tuple(self._gestures.update(frame.touches, frame.board_us))
