"""Faults of a simulated board, told as the firmware tells them: what frames show rises, and goes
after frames without it."""

from __future__ import annotations

from collections.abc import Callable

from eitskin.core.findings import FINDINGS
from eitskin.core.results import Info
from eitskin.device.wire.packets import (
    CLEAN_FRAMES,
    DOUBTFUL_FAULTS,
    ELECTRODE_FAULTS,
    FOUND_FAULTS,
    SHOWN_FRAMES,
    Fault,
    FaultCode,
    PacketType,
)
from eitskin.device.wire.payloads import build_fault

Send = Callable[[PacketType, bytes], None]
Key = tuple[FaultCode, int]


class SimFaults:
    """What is raised; ``send`` gets each change."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._there: set[Key] = set()
        self._run: dict[Key, int] = {}  # frames in a row without what is there, or with what is not

    @property
    def raised(self) -> int:
        """Bit k: fault number k."""
        return sum(1 << code for code in {code for code, _ in self._there})

    def set(self, fault: Fault) -> None:
        """It is there, or is not."""
        key = _key(fault)
        self._run.pop(key, None)
        if fault.raised == (key in self._there):
            return
        (self._there.add if fault.raised else self._there.remove)(key)
        self._send(PacketType.FAULT, build_fault(fault))

    def clear(self, frame: int) -> None:
        """All are taken to be gone; those that are still there will rise anew."""
        for code, index in sorted(self._there):
            self.set(Fault(code, False, frame, index, 0))

    def found(self, frame: int, info: Info, *, solved: bool) -> None:
        """What the core found in a frame; only ``solved`` ones tell of the reference."""
        now = {_key(fault): fault for fault in _faults(frame, info)}
        for key in sorted(self._there | set(self._run) | set(now)):
            code, index = key
            there = key in self._there
            if code not in FOUND_FAULTS or (code == FaultCode.STALE_REFERENCE and not solved):
                continue
            if (key in now) == there:
                self._run.pop(key, None)
                continue
            self._run[key] = self._run.get(key, 0) + 1
            if self._run[key] >= (
                CLEAN_FRAMES if there else SHOWN_FRAMES if code in DOUBTFUL_FAULTS else 1
            ):
                self.set(now.get(key, Fault(code, False, frame, index, 0)))


def _key(fault: Fault) -> Key:
    return FaultCode(fault.code), fault.index if fault.code in ELECTRODE_FAULTS else 0


def _faults(frame: int, info: Info) -> list[Fault]:
    found = [Fault(FaultCode.ELECTRODE_OPEN, True, frame, e, 0) for e in info.open_electrodes]
    bridged = info.bridged_electrodes
    bits = sum(1 << e for e in bridged)
    for e in bridged:
        other = next(f for f in bridged if f != e) if len(bridged) == 2 else -1
        found.append(
            Fault(FaultCode.BRIDGED, True, frame, e, other, (bits % 2**32, bits >> 32, 0, 0, 0))
        )
    found += [Fault(FaultCode.ELECTRODE_NOISY, True, frame, e, 0) for e in info.noisy_electrodes]
    if info.findings >> FINDINGS.index("misfit") & 1:
        found.append(Fault(FaultCode.MISFIT, True, frame, 0, int(1000 * info.misfit + 0.5)))
    if info.findings >> FINDINGS.index("stale reference") & 1:
        found.append(Fault(FaultCode.STALE_REFERENCE, True, frame, 0, 0))
    return found
