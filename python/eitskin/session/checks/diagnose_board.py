"""A board before the doctor: frames that it measures now, and the faults and counts that it reports
itself."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from eitskin.device.client import Device
from eitskin.device.known_model import KnownModel, scanned_protocol
from eitskin.device.wire.explain import fault_text
from eitskin.device.wire.link_table import FaultCode
from eitskin.device.wire.packets import ELECTRODE_FAULTS, BoardInfo, BoardStats, Fault
from eitskin.frames.doctor.report import FAULT, NOTE, DoctorReport, Finding
from eitskin.frames.doctor.subject import AS_GIVEN, Reading, Subject
from eitskin.session.checks.raw_frames import RawRun, as_frames, collect
from eitskin.session.set_up import begin_scene
from eitskin.skin.skin import Skin

NOT_FOR_THE_SKIN = frozenset(
    (
        FaultCode.DEADLINE,
        FaultCode.WATCHDOG,
        FaultCode.CRASH,
        FaultCode.STALE_REFERENCE,
        FaultCode.UNLIKE_MODEL,
    )
)


@dataclass(frozen=True, eq=False)
class MeasuredBoard:
    """The data of a board: ``untouched`` and ``touched`` frames, its identity, and its counters
    (None for a recording)."""

    untouched: RawRun
    touched: RawRun
    info: BoardInfo
    stats: BoardStats | None


def measure(
    device: Device, frames: int, *, touched: bool, before_touches: Callable[[], None]
) -> MeasuredBoard:
    """``frames`` raw frames of the untouched skin, and where ``touched`` as many after
    ``before_touches`` was called. A recording gives its own untouched frames, where it has some."""
    first = collect(device, 0 if device.replays else frames)
    if device.replays:
        untouched = replace(first, frames=first.untouched or first.frames[:frames])
        after = replace(first, frames=first.frames if first.untouched else first.frames[frames:])
        return MeasuredBoard(untouched, after if touched else RawRun(), device.board, None)
    after = RawRun()
    if touched:
        before_touches()
        begin_scene(device)
        after = collect(device, frames)
    if device.link.ended:
        return MeasuredBoard(first, after, device.board, None)
    return MeasuredBoard(first, after, device.info(), device.stats())


def board_subject(
    device: Device, measured: MeasuredBoard, known: KnownModel | None, skin: Skin | None
) -> Subject:
    """For the doctor's checks; the skin is the model's own unless another is given."""
    protocol = scanned_protocol(measured.info, known, device.transport.name)
    if skin is None and known is not None:
        skin = known.model.skin
    untouched, touched = measured.untouched.frames, measured.touched.frames
    frames = as_frames(untouched, touched, protocol, measured.info, known, allow_nonfinite=True)
    remarks = () if measured.info.check_every == 1 else (
        "reciprocity of every row: the board measures one of each pair; scan fully with"
        "  eitskin stream --full",
    )  # fmt: skip
    able = device.transport.capabilities
    return Subject(
        device.transport.url,
        AS_GIVEN,
        (Reading(AS_GIVEN, frames),),
        skin,
        remarks,
        offset=able.offset,
        scale=able.scale,
    )


def board_findings(report: DoctorReport, measured: MeasuredBoard) -> DoctorReport:
    """``report`` with what the board itself reports. Remedies of ``eitskin import`` are taken out,
    because a board is repaired by hand."""
    raised = [
        fault for fault in (*measured.untouched.faults, *measured.touched.faults) if fault.raised
    ]
    reported = {
        (fault.code, fault.index if fault.code in ELECTRODE_FAULTS else 0): fault
        for fault in raised
    }
    own = [_finding(fault) for fault in reported.values()]
    codes = {fault.code for fault in raised}
    own += [_standing(code) for code in measured.info.fault_codes if code not in codes]
    missing = measured.untouched.missing + measured.touched.missing
    if missing:
        text = f"{missing} packets were lost between board and host"
        own.append(Finding("board-link", NOTE, text, {"missing": missing}))
    if measured.stats is not None and measured.stats.slots_repeated:
        count = measured.stats.slots_repeated
        text = f"{count} measurements were repeated because the multiplexers were switched too late"
        own.append(Finding("board-slots", NOTE, text, {"slots_repeated": count}))
    findings = tuple(replace(finding, repair="") for finding in (*report.findings, *own))
    counted: dict[str, object] = (
        {} if measured.stats is None else {"board_frames_scanned": measured.stats.frames_scanned}
    )
    return replace(report, findings=findings, repair="", measured={**report.measured, **counted})


def _severity(code: int) -> str:
    return NOTE if code in NOT_FOR_THE_SKIN else FAULT


def _name(code: int) -> str:
    return "board-" + (
        FaultCode(code).name.lower().replace("_", "-") if code in list(FaultCode) else str(code)
    )


def _finding(fault: Fault) -> Finding:
    evidence = {"frame": fault.frame, "index": fault.index, "value": fault.value}
    text = f"the board reports: {fault_text(fault)}"
    return Finding(_name(fault.code), _severity(fault.code), text, evidence)


def _standing(code: FaultCode) -> Finding:
    text = (
        f"the board has reported {code.name.lower().replace('_', ' ')} since before; reset it and"
        " look again"
    )
    return Finding(_name(code), _severity(code), text)
