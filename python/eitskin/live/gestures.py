"""A stream's gestures: the board's own where it sends them, else what its touches give here, by the
same C code; named zones always here."""

from collections.abc import Sequence

from eitskin.core.gestures import GestureEvent, Gestures, Zone
from eitskin.device.live_frames import LiveFrame


class GestureTeller:
    """Takes the frames of a stream in their order."""

    def __init__(self, zones: Sequence[Zone] = ()) -> None:
        self._gestures = Gestures(zones)

    def take(self, frame: LiveFrame) -> tuple[GestureEvent, ...]:
        """What happened in ``frame``; nothing where its touches are not known."""
        if frame.events is not None:
            events = frame.events.events
            return events + tuple(self._gestures.press_zones(events))
        if frame.touches is None or frame.refused is not None:
            return ()
        return tuple(self._gestures.update(frame.touches.touches, frame.board_us))
