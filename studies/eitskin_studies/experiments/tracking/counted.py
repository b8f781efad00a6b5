"""A stream's touches against the truth: counts, places, ids, and how late starts and
ends are reported."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from eitskin.core.diagnostics_table import Touch
from eitskin.scoring.matching import match
from eitskin_studies.experiments.tracking.streams import TouchStream


@dataclass
class TrackCount:
    """The counts of one stream, or of several added up.

    Attributes:
        frames, exact: frames, and those with every true touch within 10 mm and nothing else.
        true, missed, false_touches: touches.
        switches: how often a finger that is found again has another id than when it was last found.
        fingers, never: true fingers, and those that were not found in any frame.
        late: frames from a finger's first until it is found, of those that are.
        ghost: frames after a finger's last in which its id is still reported, and not of another
            finger.
        errors_mm: position error of every touch that was found.
        macs: multiply-accumulates of all frames, touches included.
    """

    frames: int = 0
    exact: int = 0
    true: int = 0
    missed: int = 0
    false_touches: int = 0
    switches: int = 0
    fingers: int = 0
    never: int = 0
    late: list[int] = field(default_factory=list)
    ghost: list[int] = field(default_factory=list)
    errors_mm: list[float] = field(default_factory=list)
    macs: int = 0

    def __add__(self, other: "TrackCount") -> "TrackCount":
        return TrackCount(
            *(getattr(self, one.name) + getattr(other, one.name) for one in fields(TrackCount))
        )

    @property
    def mota(self) -> float:
        """1 - (missed + false + switches) / true (Bernardin and Stiefelhagen, EURASIP J. Image
        Video Process. 2008, 246309)."""
        return 1 - (self.missed + self.false_touches + self.switches) / max(self.true, 1)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def total(counts: Sequence[TrackCount]) -> TrackCount:
    """All added up."""
    return sum(counts, TrackCount())


def count_stream(stream: TouchStream, reported: Sequence[Sequence[Touch]], macs: int) -> TrackCount:
    """The touches ``reported`` in each frame of ``stream``.

    Raises:
        MissingExtraError: scipy is not installed.
    """
    count = TrackCount(frames=len(reported), macs=macs)
    first: dict[int, int] = {}
    last: dict[
        int, tuple[int, int]
    ] = {}  # finger: the frame in which it was last found, and its id there
    stray: list[set[int]] = []  # ids that are reported and are no finger's
    for frame, touches in enumerate(reported):
        there, true_mm, _ = stream.true_mm(frame)
        matching = match(true_mm, np.array([(t.x_mm, t.y_mm) for t in touches]))
        count.exact += matching.exact
        count.true += len(there)
        count.missed += matching.misses
        count.false_touches += matching.false_touches
        count.errors_mm += [round(error, 4) for error in matching.distances_mm]
        stray.append(
            {touch.id for touch in touches} - {touches[found].id for _, found in matching.pairs}
        )
        for true, found in matching.pairs:
            finger, number = there[true], touches[found].id
            first.setdefault(finger, frame)
            count.switches += finger in last and last[finger][1] != number
            last[finger] = frame, number
    for finger, one in enumerate(stream.samples):
        here = np.flatnonzero(one.there)
        count.fingers += 1
        if finger not in first:
            count.never += 1
            continue
        count.late.append(int(first[finger] - here[0]))
        count.ghost.append(_ghost(stray, int(here[-1]), *last[finger]))
    return count


def _ghost(stray: Sequence[set[int]], end: int, found: int, number: int) -> int:
    """In how many frames after ``end`` on end the id ``number`` is reported no finger, if it was
    found to the last."""
    frames = 0
    while found == end and end + 1 + frames < len(stray) and number in stray[end + 1 + frames]:
        frames += 1
    return frames
