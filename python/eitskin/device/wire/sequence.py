"""Sequence numbers: find the next packet, missing ones, and duplicates.

Numbers count every packet of a direction, modulo 2^32, and a packet that the sender dropped keeps
its number. A board's numbers begin again when it restarts, which it says by an INFO with request 0;
since that INFO may itself be a duplicate, the packet after it decides.
"""

from collections import OrderedDict
from dataclasses import asdict, dataclass

WRAP = 2**32
AHEAD = 2**31
REMEMBERED = 256
LATE_IN_A_ROW = 8


@dataclass
class LinkCounters:
    """Counters of the packets over a link since it was opened.

    ``skipped_bytes`` came before the first delimiter, ``malformed`` had a right checksum but a
    payload that is not of its type, ``missing`` packets lie in ``gaps`` gaps (as far as numbers
    tell), ``duplicates`` and ``stale`` (late) packets were refused, ``dropped`` were left out by
    the host's own queue because nobody fetched them, ``lines_skipped`` of another instrument were
    no frames.
    """

    bytes: int = 0
    skipped_bytes: int = 0
    packets: int = 0
    crc_errors: int = 0
    framing_errors: int = 0
    overruns: int = 0
    version_errors: int = 0
    malformed: int = 0
    gaps: int = 0
    missing: int = 0
    duplicates: int = 0
    stale: int = 0
    restarts: int = 0
    reconnects: int = 0
    dropped: int = 0
    lines_skipped: int = 0

    def as_dict(self) -> dict[str, int]:
        return asdict(self)


class SequenceCheck:
    """Judges each packet's number against those before. One for each direction of a link.

    ``was_late``: the last one judged was refused as late. ``revived``: so many of those just before
    the last one judged were of a new life after all.
    """

    def __init__(self, counters: LinkCounters) -> None:
        self._counters = counters
        self._next: int | None = None
        # the next number, if the last INFO with request 0 was no duplicate
        self._after_restart: int | None = None
        self._cut = False
        self._seen: OrderedDict[int, int] = OrderedDict()
        self._late_run, self._late_next = 0, 0
        self.revived, self.was_late = 0, False

    def link_lost(self) -> None:
        """The line was cut: whatever comes next is taken and counts as one gap."""
        self._cut = self._next is not None

    def admit(self, sequence: int, fingerprint: int, *, restart: bool = False) -> int | None:
        """Return the number of packets that are missing just before this one; None if it must be
        rejected.

        ``fingerprint`` tells a packet that came twice from another one with its number;
        ``restart``: an INFO with request 0.
        """
        self.revived, self.was_late = 0, False
        if self._next is None:
            return self._accept(sequence, fingerprint, 0)
        ahead = (sequence - self._next) % WRAP
        if self._cut:
            return self._accept_after_cut(sequence, fingerprint, ahead)
        if self._after_restart is not None and not restart:
            if self._is_repeated(sequence, fingerprint, ahead):
                return None
            ahead = (sequence - self._next) % WRAP
        if ahead == 0:
            return self._accept(sequence, fingerprint, 0)
        if restart and ahead >= AHEAD:
            if (
                self._late_run and sequence == self._late_next
            ):  # faults of its start, reported before
                return self._revive(sequence, fingerprint)
            self._after_restart = (sequence + 1) % WRAP
            return 0
        if ahead < AHEAD:
            self._counters.gaps += 1
            self._counters.missing += ahead
            return self._accept(sequence, fingerprint, ahead)
        if self._seen.get(sequence) == fingerprint:
            self._counters.duplicates += 1
            return None
        return self._late(sequence, fingerprint)

    def _accept_after_cut(self, sequence: int, fingerprint: int, ahead: int) -> int:
        self._cut, self._after_restart = False, None
        if ahead == 0:
            return self._accept(sequence, fingerprint, 0)
        self._counters.gaps += 1
        if ahead < AHEAD:
            self._counters.missing += ahead
            return self._accept(sequence, fingerprint, ahead)
        self._counters.restarts += 1
        self._seen.clear()
        return self._accept(sequence, fingerprint, 1)  # how many, nobody knows

    def _is_repeated(self, sequence: int, fingerprint: int, ahead: int) -> bool:
        """After an INFO with request 0: whether this packet came before already. If not, decide
        whether the board restarted: then this packet follows that INFO more closely than it follows
        what came before."""
        begun = self._after_restart
        assert begun is not None
        if ahead >= AHEAD and self._seen.get(sequence) == fingerprint:
            self._counters.duplicates += 1
            if sequence == begun:
                self._after_restart = (begun + 1) % WRAP
            return True
        self._after_restart = None
        if ahead < AHEAD and (sequence - begun) % WRAP >= ahead:
            self._counters.duplicates += 1  # that INFO
            return False
        self._counters.restarts += 1
        self._seen.clear()
        self._next = begun
        return False

    def _late(self, sequence: int, fingerprint: int) -> int | None:
        """A number from before that was not seen: late. Many in a row, one after another, are a
        board that restarted and whose INFO was lost: then none of them was late."""
        self._late_run = self._late_run + 1 if self._late_run and sequence == self._late_next else 1
        self._late_next = (sequence + 1) % WRAP
        if self._late_run < LATE_IN_A_ROW:
            self._counters.stale += 1
            self.was_late = True
            return None
        self._late_run -= 1  # those before this one
        return self._revive(sequence, fingerprint)

    def _revive(self, sequence: int, fingerprint: int) -> int:
        self.revived = self._late_run
        self._counters.stale -= self.revived
        self._counters.restarts += 1
        self._seen.clear()
        return self._accept(sequence, fingerprint, 0)

    def _accept(self, sequence: int, fingerprint: int, lost: int) -> int:
        self._next = (sequence + 1) % WRAP
        self._late_run = 0
        self._seen[sequence] = fingerprint
        if len(self._seen) > REMEMBERED:
            self._seen.popitem(last=False)
        return lost
