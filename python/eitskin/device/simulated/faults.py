"""Faults of a simulated board, told as the firmware tells them: what is found rises at once and goes after frames without it."""

from __future__ import annotations

from collections.abc import Callable

from eitskin.core.results import FINDINGS, Info
from eitskin.device.wire.packets import CLEAN_FRAMES, Fault, FaultCode, PacketType
from eitskin.device.wire.payloads import build_fault

Send = Callable[[PacketType, bytes], None]


class SimFaults:
    """What is raised; ``send`` gets each change."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._clean: dict[tuple[FaultCode, int], int] = {}  # what is there: frames in a row without it

    @property
    def raised(self) -> int:
        """Bit k: fault number k."""
        return sum(1 << code for code in {code for code, _ in self._clean})

    def set(self, fault: Fault) -> None:
        """It is there, or is not."""
        key = FaultCode(fault.code), fault.index if fault.code in _OF_ELECTRODES else 0
        if fault.raised == (key in self._clean):
            return
        if fault.raised:
            self._clean[key] = 0
        else:
            del self._clean[key]
        self._send(PacketType.FAULT, build_fault(fault))

    def clear(self, frame: int) -> None:
        """All are taken to be gone; those that are still there will rise anew."""
        for code, index in sorted(self._clean):
            self.set(Fault(code, False, frame, index, 0))

    def found(self, frame: int, info: Info, *, solved: bool) -> None:
        """What the core found in a frame; only ``solved`` ones tell of the reference."""
        now = {(fault.code, fault.index): fault for fault in _faults(frame, info)}
        for key, fault in now.items():
            self.set(fault)
            self._clean[FaultCode(key[0]), key[1]] = 0
        for code, index in sorted(self._clean):
            judged = code in _OF_ELECTRODES or code == FaultCode.MISFIT or (code == FaultCode.STALE_REFERENCE and solved)
            if not judged or (code, index) in now:
                continue
            self._clean[code, index] += 1
            if self._clean[code, index] >= CLEAN_FRAMES:
                self.set(Fault(code, False, frame, index, 0))


_OF_ELECTRODES = (FaultCode.ELECTRODE_OPEN, FaultCode.BRIDGED, FaultCode.ELECTRODE_NOISY)


def _faults(frame: int, info: Info) -> list[Fault]:
    found = [Fault(FaultCode.ELECTRODE_OPEN, True, frame, e, 0) for e in info.open_electrodes]
    bridged = info.bridged_electrodes
    bits = sum(1 << e for e in bridged)
    for e in bridged:
        other = next(f for f in bridged if f != e) if len(bridged) == 2 else -1
        found.append(Fault(FaultCode.BRIDGED, True, frame, e, other, (bits % 2**32, bits >> 32, 0, 0, 0)))
    found += [Fault(FaultCode.ELECTRODE_NOISY, True, frame, e, 0) for e in info.noisy_electrodes]
    if info.findings >> FINDINGS.index("misfit") & 1:
        found.append(Fault(FaultCode.MISFIT, True, frame, 0, int(1000 * info.misfit + 0.5)))
    if info.findings >> FINDINGS.index("stale reference") & 1:
        found.append(Fault(FaultCode.STALE_REFERENCE, True, frame, 0, 0))
    return found
