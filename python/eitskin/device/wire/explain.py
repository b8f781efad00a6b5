"""A board's numbers in words: replies, faults, statuses; each says what to do where something can
be done."""

from eitskin.core.engine import load_core
from eitskin.device.wire.layout import Command
from eitskin.device.wire.link_table import FaultCode, PacketType, Quality, ReplyStatus
from eitskin.device.wire.packets import FOUND_FAULTS, Fault, Reply

UPLOAD = "upload one with  eitskin model upload MODEL.eitm"


def status_text(status: int) -> str:
    """The C core's own line for an eits_status."""
    module = load_core("float32")
    return str(module.ffi.string(module.lib.eits_status_text(status)).decode())


def command_name(command: int) -> str:
    """ "TARE"."""
    return PacketType(command).name if command in list(PacketType) else f"command 0x{command:02x}"


def field_at(command: int, offset: int) -> str:
    """The name of the field at byte ``offset`` of a command's payload."""
    kind = Command.KNOWN.get(command)
    if kind is None:
        return f"byte {offset}"
    return kind.LAYOUT.field_at(offset) or f"byte {offset}"


def found_touched(reply: Reply) -> bool:
    """Return whether a tare was refused because something landed, moved or lifted meanwhile."""
    touched = int(load_core("float32").lib.EITS_E_REFERENCE_TOUCHED)
    return reply.status == ReplyStatus.CORE and reply.detail[0] == touched


def reply_text(reply: Reply) -> str:
    """Return the reason why a command was rejected, and what to do, for a reply that is not OK."""
    name, (first, second) = command_name(reply.command), reply.detail
    texts = {
        ReplyStatus.OK: "done",
        ReplyStatus.UNKNOWN_COMMAND: (
            "the firmware does not know this command; flash one of this version (eitskin flash)"
        ),
        ReplyStatus.LENGTH: (
            f"the firmware expects {first} bytes; flash one of this version (eitskin flash)"
        ),
        ReplyStatus.RANGE: (
            f"{field_at(reply.command, first)} is out of range, its limit is {second}"
        ),
        ReplyStatus.NO_MODEL: f"the board has no model; {UPLOAD}",
        ReplyStatus.NOT_TARED: (
            "the board does not keep the reference before the last tare; leave the skin untouched"
            " and take it again"
            if reply.command == PacketType.TARE
            else "the board has no reference frame; leave the skin untouched and run  eitskin tare"
        ),
        ReplyStatus.BUSY: f"the board is busy with {command_name(first)}; wait for it",
        ReplyStatus.MODEL_SIZE: (
            f"the board takes models of {first} bytes at most; build it with fewer pixels or a"
            " lower rank"
        ),
        ReplyStatus.MODEL_INVALID: (
            f"the board refuses the model: {status_text(first)}; the old one stays"
        ),
        ReplyStatus.MODEL_SCAN: (
            f"the model's protocol needs {first} electrodes and the board has {second}; the old"
            " model stays"
        ),
        ReplyStatus.MODEL_CRC: (
            "what arrived is not the model that was announced; the old one stays, upload again"
        ),
        ReplyStatus.OFFSET: f"the board expects the model's bytes from {first} on; upload again",
        ReplyStatus.FLASH: (
            f"erasing or programming the flash failed at byte {first}; the old model stays, try"
            " again"
        ),
        ReplyStatus.CORE: f"the core refuses: {status_text(first)}",
        ReplyStatus.PERIODS: (
            f"the samples are no whole number of excitation periods; the nearest that are: {first}"
        ),
        ReplyStatus.TOO_FAST: f"this scan needs a frame period of at least {first} us",
        ReplyStatus.SELF_TEST: (
            f"the golden frame's image differs from the model's by {first} parts in 1e9 of its peak"
        ),
        ReplyStatus.LOCKED: (
            "its owner has locked the board: hold the blue button on it and run this again"
        ),
        ReplyStatus.DRIVES: (
            "touches after each drive need a model with fields, which a taught one has not, full"
            " scans, every frame and a board that scans by itself; leave  --report drive  out, or"
            " use  --full  and a model of  eitskin model build"
        ),
        ReplyStatus.TRIPPED: (
            "the current was above its limit and is off; look for a short or a wrong part, then run"
            "  eitskin board --clear-faults"
        ),
    }
    known = reply.status in list(ReplyStatus)
    unknown = f"refused with the unknown status {reply.status}"
    return f"{name}: {texts[ReplyStatus(reply.status)] if known else unknown}"


def fault_text(fault: Fault) -> str:
    """Return a text that says what went wrong on the board, or that it is over, in which frame, and
    what to do."""
    if fault.code in FOUND_FAULTS:
        name, text = found_name(fault), _FOUND[FaultCode(fault.code)]
    elif fault.code in list(FaultCode):
        name, text = FaultCode(fault.code).name.lower().replace("_", " "), _text(fault)
    else:
        name, text = f"fault {fault.code}", f"value {fault.value}"
    return (
        f"{name}, frame {fault.frame}: {text}"
        if fault.raised
        else f"{name}: over, frame {fault.frame}"
    )


def found_name(fault: Fault) -> str:
    """Return the name of a frame's diagnostic, such as "electrode 5 open", for a code of
    ``FOUND_FAULTS``."""
    pair = fault.raised and fault.value >= 0
    names = {
        FaultCode.ELECTRODE_OPEN: f"electrode {fault.index} open",
        FaultCode.SATURATED: (
            f"{fault.value} rows saturated from row {fault.index} on"
            if fault.raised
            else "rows saturated"
        ),
        FaultCode.BRIDGED: (
            f"electrodes {fault.index} and {fault.value} bridged"
            if pair
            else f"electrode {fault.index} bridged"
        ),
        FaultCode.ELECTRODE_NOISY: f"electrode {fault.index} noisy",
        FaultCode.MODEL_MISMATCH: (
            f"model mismatch {fault.value / 10:.1f} %"
            if fault.raised and fault.value
            else "model mismatch"
        ),
        FaultCode.STALE_REFERENCE: "stale reference",
        FaultCode.UNLIKE_MODEL: "unlike the model",
    }
    return names[FaultCode(fault.code)]


_FOUND = {
    FaultCode.ELECTRODE_OPEN: "it makes no contact; wet or press it, then tare",
    FaultCode.SATURATED: "beyond the converter's range; lower the gain or the current",
    FaultCode.BRIDGED: "water, paste or a wire joins them; dry or separate them",
    FaultCode.ELECTRODE_NOISY: "a loose contact or wire; press it, or check its wire",
    FaultCode.MODEL_MISMATCH: (
        "no change of this skin gives such voltages; check order, signs and wiring (eitskin doctor)"
    ),
    FaultCode.STALE_REFERENCE: (
        "the skin was touched while it was taken, or has changed since; leave it untouched and run"
        "  eitskin tare"
    ),
    FaultCode.UNLIKE_MODEL: (
        "the reference is not this model's; check order, signs and skin (eitskin doctor), build the"
        " model with  --data normalised  or teach it from 20 presses (eitskin teach record)"
    ),
}


def _text(fault: Fault) -> str:
    pc, lr, cfsr, hfsr, address = fault.words
    texts = {
        FaultCode.NO_MODEL: f"no bank holds a valid model ({status_text(fault.value)}); {UPLOAD}",
        FaultCode.DEADLINE: (
            f"it took {fault.value} us longer than the frame period; make the period longer"
        ),
        FaultCode.RECIPROCITY: (
            f"row {fault.index} and its reciprocal differ by {fault.value} parts per thousand of"
            " the rms voltage; check the wiring (eitskin doctor)"
        ),
        FaultCode.SOLVER: f"the solver refused it: {status_text(fault.value)}",
        FaultCode.SCAN_STALLED: "the converter gave nothing in time; reset the board",
        FaultCode.CRASH: (
            f"the board restarted after a processor fault at pc 0x{pc:08x}, lr 0x{lr:08x}, cfsr"
            f" 0x{cfsr:08x}, hfsr 0x{hfsr:08x}, address 0x{address:08x}; please report it"
        ),
        FaultCode.WATCHDOG: "the board restarted because its program hung; please report it",
        FaultCode.BUS: "the generator or the multiplexers could not be written; check their wiring",
        FaultCode.CURRENT: (
            f"{fault.value} uA rms flowed, above the limit, and was switched off; look for a short"
            " or a wrong part, then run  eitskin board --clear-faults"
        ),
        FaultCode.CLOCK: (
            "the board restarted because the generator's 8 MHz failed; check the solder bridges"
        ),
        FaultCode.SUPPLY: (
            "the board restarted because its supply fell below 2.9 V; use a better cable or port"
        ),
        FaultCode.LOCKED: (
            f"the locked board refused {command_name(fault.index)}; its owner must hold the blue"
            " button"
        ),
        FaultCode.ANALOG_SUPPLY: (
            "the analog supply of +-15 V, or one half of it, is missing; switch it on, then measure"
            " it at the board"
        ),
    }
    return texts[FaultCode(fault.code)]


def quality_text(quality: int) -> str:
    """The names of a row's quality bits; "good" for none."""
    return ", ".join(bit.name.lower() for bit in Quality if quality & bit and bit.name) or "good"
