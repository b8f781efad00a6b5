"""What a stream tells beside its frames, in lines: faults, events of the link, what is found in
frames once it rises and goes.

A board tells most of what it finds as faults, and all of it in the head of each frame. What both
tell is said once.
"""

from eitskin.core.diagnostics import names, words
from eitskin.device.link import LinkEvent
from eitskin.device.live_frames import Item, LiveDrive
from eitskin.device.wire.explain import fault_text
from eitskin.device.wire.link_table import FAULT_CLEAR_FRAMES, FAULT_RAISE_FRAMES, FaultCode
from eitskin.device.wire.packets import DOUBTFUL_FAULTS, FOUND_FAULTS, Fault, Solved

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
_DOUBTFUL = frozenset(_NAMES[code] for code in DOUBTFUL_FAULTS)
_OF_ELECTRODES = {
    "electrode open": "open",
    "electrodes bridged": "bridged",
    "electrode noisy": "noisy",
}


class Events:
    """Turns what a stream gives into lines, as it comes."""

    def __init__(self) -> None:
        # what has been said to be there: frames in a row without it
        self._clean: dict[Key, int] = {}
        self._shown: dict[Key, int] = {}  # what the last frame showed: how many in a row

    def lines(self, item: Item) -> list[str]:
        """What is new with ``item``; of a frame only what it shows and those before it did not, or
        what has gone."""
        if isinstance(item, LinkEvent):
            return [link_text(item)]
        if isinstance(item, Fault):
            return self._fault(item)
        if isinstance(item, LiveDrive):
            return []
        return [] if item.solved is None else self._found(item.solved)

    def _fault(self, fault: Fault) -> list[str]:
        if fault.code not in FOUND_FAULTS:
            return [fault_text(fault)]
        keys = _keys(fault)
        new = keys[0] not in self._clean if fault.raised else keys[0] in self._clean
        for key in keys:
            if fault.raised:
                self._clean.setdefault(key, 0)
            elif key == keys[0]:
                self._clean.pop(key, None)
        return [fault_text(fault)] if new else []

    def _found(self, solved: Solved) -> list[str]:
        now, said = _found(solved), []
        self._shown = {key: self._shown.get(key, 0) + 1 for key in now}
        for key, text in now.items():
            if key not in self._clean and self._shown[key] >= (
                FAULT_RAISE_FRAMES if key[0] in _DOUBTFUL else 1
            ):
                said.append(f"{text}, frame {solved.frame}")
                self._clean[key] = 0
        for key in list(self._clean):
            self._clean[key] = 0 if key in now else self._clean[key] + 1
            if self._clean[key] >= FAULT_CLEAR_FRAMES:
                del self._clean[key]
                said.append(f"{_plain(key)}: over, frame {solved.frame}")
        return said


def link_text(event: LinkEvent) -> str:
    """An event of the link in a line."""
    if event.kind == "skipped":
        return f"lines: {event.text}"
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
    """What the head names, each with its text."""
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
