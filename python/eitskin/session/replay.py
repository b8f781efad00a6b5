"""A recording as a live stream would have shown it."""

from dataclasses import replace

from eitskin.device.client import Device
from eitskin.device.wire.link_table import Stream
from eitskin.session.assemble import read_frames
from eitskin.session.frame import DriveReport, Frame, Message

FRAME_KINDS = Stream.RAW | Stream.IMAGE | Stream.TOUCHES


class Replay:
    """Takes the messages of a recording in their order: leaves out the untouched frames of tares,
    times the others from the first of them plus ``offset_us``, and keeps every ``every``-th frame.
    """

    def __init__(self, every: int = 1, offset_us: int = 0) -> None:
        self._every, self._offset_us = every, offset_us
        self._start_us: int | None = None
        self._step_us = 0
        self.frames = 0
        """The number of frames since its beginning, with those between the shown ones."""
        self.last_us = offset_us
        """The time of the last frame that was shown."""

    def take(self, message: Message) -> Message | None:
        """Return ``message`` as it is shown; None if it is not shown."""
        if isinstance(message, DriveReport):
            return replace(message, time_us=self._shown_us(message.time_us))
        if not isinstance(message, Frame):
            return message
        if message.untouched:
            return None
        time_us = self._shown_us(message.time_us)
        self.frames += 1
        if (self.frames - 1) % self._every:
            return None
        self._step_us, self.last_us = time_us - self.last_us, time_us
        return replace(message, time_us=time_us)

    def _shown_us(self, time_us: int) -> int:
        if self._start_us is None:
            self._start_us = time_us
        return time_us - self._start_us + self._offset_us

    def again(self) -> "Replay | None":
        """The recording once more, as if it went on; None if it showed no time that passes."""
        if self.last_us <= self._offset_us:
            return None
        return Replay(self._every, self.last_us + self._step_us)


def recording_length_s(recording: Device) -> float:
    """The time of the last frame of a ``recording``, as a replay counts it. It reads all of it."""
    replay = Replay()
    for message in read_frames(recording, FRAME_KINDS):
        replay.take(message)
    return replay.last_us / 1e6
