"""Raw frames off a board, and frames for everything that reads frames files."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from eitskin import __version__
from eitskin.device.client import Device
from eitskin.device.known_model import KnownModel, find_model, scanned_protocol
from eitskin.device.recordings.recording import FileTransport
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import BoardInfo, Fault, RawFrame
from eitskin.errors import DeviceError, FrameError
from eitskin.frames.frames import Frames
from eitskin.session.assemble import read_frames
from eitskin.session.frame import Frame, Message, Notice
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import skin_to_table


@dataclass
class RawRun:
    """Raw frames in the order in which they were scanned, ``untouched`` ones apart, with the faults
    that were reported meanwhile and the packets that were lost. ``left_out``: frames before the
    tare that ``untouched`` is of."""

    untouched: list[RawFrame] = field(default_factory=list)
    frames: list[RawFrame] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    missing: int = 0
    left_out: int = 0


def collect(device: Device, frames: int) -> RawRun:
    """The next ``frames`` raw frames of a board."""
    run = gather(read_frames(device, Stream.RAW, frames=frames))
    if not run.frames:
        raise DeviceError(
            f"{device.transport.name}: no raw frame came; its scene or recording is over"
        )
    return run


def gather(messages: Iterable[Message]) -> RawRun:
    """The raw frames of a stream or recording. Of several tares the last counts, and the frames
    after it."""
    run = RawRun()
    taring = False
    for message in messages:
        if isinstance(message, Notice):
            if isinstance(message.cause, Fault):
                run.faults.append(message.cause)
            elif isinstance(message.cause, LinkEvent):
                run.missing += message.cause.missing
        elif isinstance(message, Frame) and message.raw is not None:
            if message.untouched and not taring:
                run.left_out += len(run.frames) + len(run.untouched)
                run.untouched, run.frames = [], []
            taring = message.untouched
            (run.untouched if taring else run.frames).append(message.raw)
    return run


def finite_only(frames: Frames, where: str) -> tuple[Frames, int]:
    """``frames`` without those that have a row which could not be measured, and how many these
    were."""
    good = np.asarray(np.isfinite(frames.voltage_v).all(axis=1))
    untouched = np.asarray(np.isfinite(frames.reference_voltage_v).all(axis=1))
    if not good.any() or not untouched.any():
        which = "untouched frame" if good.any() else "frame"
        bad = frames.reference_voltage_v if good.any() else frames.voltage_v
        row = int(np.argmax((~np.isfinite(bad)).sum(axis=0)))
        raise FrameError(
            f"{where}: no {which} has all its rows measured; row {row} is missing most often; see "
            " eitskin doctor"
        )
    assert frames.time_s is not None
    kept = replace(
        frames,
        voltage_v=frames.voltage_v[good],
        reference_voltage_v=frames.reference_voltage_v[untouched],
        frame_name=tuple(
            name for name, keep in zip(frames.frame_name, good.tolist(), strict=True) if keep
        ),
        time_s=frames.time_s[good],
        allow_nonfinite=False,
    )
    return kept, int((~good).sum())


def as_frames(
    untouched: Sequence[RawFrame],
    frames: Sequence[RawFrame],
    protocol: Protocol,
    info: BoardInfo,
    known: KnownModel | None,
    *,
    allow_nonfinite: bool = False,
) -> Frames:
    """The frames, named by their numbers on the board and timed by its clock."""
    if not untouched:
        raise FrameError("there is no untouched frame, and images show the differences from these")
    rows = protocol.n_rows
    start = (frames[0] if frames else untouched[0]).time_us
    skin = {} if known is None else {"skin": skin_to_table(known.model.skin)}
    row_time_s = np.zeros(rows)
    row_time_s[protocol.scan_rows] = 1e-6 * info.slot_us * np.arange(rows)
    row_time_s += info.samples / info.sample_rate_hz / 2
    result = Frames(
        protocol=protocol,
        voltage_v=np.array([raw.voltage_v for raw in frames], dtype=np.float64).reshape(-1, rows),
        reference_voltage_v=np.array([raw.voltage_v for raw in untouched], dtype=np.float64),
        frame_name=tuple(str(raw.frame) for raw in frames),
        time_s=np.array([((raw.time_us - start) % 2**32) / 1e6 for raw in frames]),
        row_time_s=row_time_s if info.check_every == 1 else None,
        meta={
            "made_by": f"eitskin {__version__}, board {info.board} {info.serial}",
            "board": info.as_dict(),
            **skin,
        },
        allow_nonfinite=True,
    )
    return result if allow_nonfinite else replace(result, allow_nonfinite=False)


def frames_of(path: str | Path, model: Path | None = None) -> Frames:
    """The raw frames of a recording as frames, the untouched ones of its last tare as their
    reference; rows that were masked or could not be measured are NaN. ``model``: the board's, where
    its protocol is none of the usual.

    Raises:
        FileError, DeviceError: it cannot be read, or the model is another.
        FrameError: no raw frames were recorded, or no untouched ones.
    """
    with Device(FileTransport(path)) as device:
        name = str(path)
        known = find_model(device.board, model, name)
        protocol = scanned_protocol(device.board, known, name)
        run = gather(read_frames(device, Stream.RAW))
        if not run.frames:
            raise FrameError(
                f"{name}: holds no raw frames; record them, as  eitskin record  does by default; in"
                ' Python  stream(..., mode="raw,touches", record=...)'
            )
        return as_frames(
            run.untouched, run.frames, protocol, device.board, known, allow_nonfinite=True
        )
