"""Notices as lines: faults, events of the link, and diagnostics of frames when they rise and when
they go.

A board reports most diagnostics as faults, and all of them in the head of each frame. What both
report makes one notice.
"""

from eitskin.core.diagnostics import names, words
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.explain import fault_text
from eitskin.device.wire.link_table import FAULT_CLEAR_FRAMES, FAULT_RAISE_FRAMES, FaultCode
from eitskin.device.wire.packets import DOUBTFUL_FAULTS, FOUND_FAULTS, Fault, Solved
from eitskin.session.frame import DriveReport, Frame, Message, Notice

Key = tuple[str, int]  # a name of core.diagnostics.DIAGNOSTICS, and which electrode; -1: none

_NAMES = {
    FaultCode.ELECTRODE_OPEN: "electrode open",
    FaultCode.SATURATED: "saturated",
    FaultCode.BRIDGED: "electrodes bridged",
    FaultCode.ELECTRODE_NOISY: "electrode noisy",
    FaultCode.MODEL_MISMATCH: "model mismatch",
    FaultCode.STALE_REFERENCE: "stale reference",
    FaultCode.UNLIKE_MODEL: "unlike the model",
}
# A touch that lands, moves or lifts within a scan gives single frames of these.
_DOUBTFUL = frozenset(_NAMES[code] for code in DOUBTFUL_FAULTS) | {"outlier", "crowded"}
_OF_ELECTRODES = {
    "electrode open": "open",
    "electrodes bridged": "bridged",
    "electrode noisy": "noisy",
}


class Novelty:
    """Picks those faults, events and diagnostics that are new, as they come."""

    def __init__(self) -> None:
        # what was reported to be there: frames in a row without it
        self._clean: dict[Key, int] = {}
        self._shown: dict[Key, int] = {}  # what the last frame showed: how many in a row

    def lines(self, message: Message) -> list[str]:
        """Return the lines for what is new in ``message``. In a frame, these are the diagnostics
        that the frames before it did not have, and those that have gone."""
        if isinstance(message, Frame):
            info = message.info
            return [] if info is None or info.unsolved else self._found(info)
        if isinstance(message, DriveReport):
            return []
        fault = message.cause if isinstance(message.cause, Fault) else None
        known = fault is not None and fault.code in FOUND_FAULTS and not self._is_new(fault)
        return [] if known else [message.text]

    def _is_new(self, fault: Fault) -> bool:
        keys = _keys(fault)
        new = keys[0] not in self._clean if fault.raised else keys[0] in self._clean
        for key in keys:
            if fault.raised:
                self._clean.setdefault(key, 0)
            elif key == keys[0]:
                self._clean.pop(key, None)
        return new

    def _found(self, solved: Solved) -> list[str]:
        now, lines = _found(solved), list[str]()
        self._shown = {key: self._shown.get(key, 0) + 1 for key in now}
        for key, text in now.items():
            if key not in self._clean and self._shown[key] >= (
                FAULT_RAISE_FRAMES if key[0] in _DOUBTFUL else 1
            ):
                lines.append(f"{text}, frame {solved.frame}")
                self._clean[key] = 0
        for key in list(self._clean):
            self._clean[key] = 0 if key in now else self._clean[key] + 1
            if self._clean[key] >= FAULT_CLEAR_FRAMES:
                del self._clean[key]
                lines.append(f"{_plain(key)}: over, frame {solved.frame}")
        return lines


def notice_of(cause: Fault | LinkEvent) -> Notice:
    """A fault or an event of the link as a message."""
    if isinstance(cause, LinkEvent):
        return Notice("link", link_text(cause), None, cause=cause)
    return Notice("fault", fault_text(cause), None, cause=cause)


def link_text(event: LinkEvent) -> str:
    """An event of the link in a line."""
    if event.kind == "skipped":
        return f"lines: {event.text}"
    if event.kind == "rows":
        return f"tare: {event.text}"
    counted = f" ({event.missing} packets)" if event.missing else ""
    return f"link: {event.kind}{counted}" + (f": {event.text}" if event.text else "")


def _keys(fault: Fault) -> list[Key]:
    name = _NAMES[FaultCode(fault.code)]
    if name not in _OF_ELECTRODES:
        return [(name, -1)]
    keys = [(name, fault.index)]
    if fault.code == FaultCode.BRIDGED and fault.raised and fault.value >= 0:
        keys.append((name, fault.value))
    return keys


def _plain(key: Key) -> str:
    name, electrode = key
    return f"electrode {electrode} {_OF_ELECTRODES[name]}" if electrode >= 0 else name


def _found(solved: Solved) -> dict[Key, str]:
    """Return the diagnostics that the head names, each with its text."""
    electrodes = {
        "electrode open": solved.open_electrodes,
        "electrodes bridged": solved.bridged_electrodes,
        "electrode noisy": solved.noisy_electrodes,
    }
    found: dict[Key, str] = {}
    for name, text in zip(names(solved.diagnostics), words(solved), strict=True):
        which = electrodes.get(name, ())
        found |= {(name, e): _plain((name, e)) for e in which} if which else {(name, -1): text}
    return found
