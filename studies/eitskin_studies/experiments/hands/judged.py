"""Streams of a scene judged: each frame and each report at its own instant."""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from eitskin.arrays import FloatArray
from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.device.client import Device
from eitskin.device.simulated import SimBoard, SimTransport
from eitskin.device.wire.link_table import Stream
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.description import Scene
from eitskin.session.assemble import read_frames
from eitskin.session.frame import DriveReport, Frame, Message
from eitskin_studies.experiments.hands.scenes import RATE_HZ, UNTOUCHED, Finger

GATE_MM = 12.0  # a touch farther from every finger is false
GRACE_S = 0.045  # a finger that landed so lately may be missing
LIFT_S = 0.06  # one that has lifted so lately may still be reported
NEAR_MM = 15.0  # the first report of a finger lies within so much of where it landed
CROWDED_MM, CROWDED = 34.0, 4  # two fingers as near as this, or so many of them, are crowded


@dataclass
class Judged:
    """The reports of a stream, judged; errors and delays are in mm and s.

    ``reports``, ``frames`` count them, ``*_false`` those with a false touch. ``untrue`` counts
    frames with a diagnostic that is not true. ``still``: errors of fingers that do not move while
    another one lands; ``moving`` of those that move. ``first``: contact to first report, for each
    finger that was reported.
    """

    reports: int = 0
    reports_false: int = 0
    confirmed_false: int = 0
    frames: int = 0
    frames_false: int = 0
    frames_exact: int = 0
    untrue: int = 0
    fingers: int = 0
    first: list[float] = field(default_factory=list)
    still: list[float] = field(default_factory=list)
    moving: list[float] = field(default_factory=list)
    named: list[str] = field(default_factory=list)


def stream(scene: Scene, blob: bytes) -> list[Message]:
    """Frames and reports of a simulated board with the model ``blob`` before ``scene``."""
    empty = bytes([ERASED]) * BANK_BYTES
    board = SimBoard(BoardFrames(scene), [bank_bytes(blob, 1), empty])
    what = Stream.TOUCHES | Stream.DRIVE_TOUCHES
    with Device(SimTransport("hands", board)) as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        return list(read_frames(device, what))


def judge(messages: list[Message], fingers: list[Finger]) -> Judged:
    """``messages`` of a scene with ``fingers``."""
    out = Judged(fingers=len(fingers))
    first: list[float | None] = [None] * len(fingers)
    for message in messages:
        if isinstance(message, DriveReport):
            _judge_report(message, fingers, out, first)
        elif isinstance(message, Frame):
            _judge_frame(message, fingers, out, first)
    out.first = [one for one in first if one is not None]
    return out


def _judge_report(
    report: DriveReport, fingers: list[Finger], out: Judged, first: list[float | None]
) -> None:
    here = np.array([(one.x_mm, one.y_mm) for one in report.touches]).reshape(-1, 2)
    hits, false, _ = _matched(fingers, here, report.time_s)
    out.reports += 1
    out.reports_false += bool(false)
    out.confirmed_false += any(report.touches[k].confirmed for k in false)
    _note(fingers, hits, report.time_s, out)
    _note_first(fingers, here, report.time_s, first)


def _judge_frame(
    frame: Frame, fingers: list[Finger], out: Judged, first: list[float | None]
) -> None:
    time_s = frame.time_s + 1 / RATE_HZ  # touches hold for the end of the scan
    here = np.array([(one.x_mm, one.y_mm) for one in frame.touches]).reshape(-1, 2)
    _, false, missing = _matched(fingers, here, time_s)
    out.frames += 1
    out.frames_false += bool(false)
    out.frames_exact += not false and not missing
    names = set(frame.diagnostics)
    if not false and not missing and not _crowded(fingers, time_s):
        names_untrue = names
    else:
        names_untrue = names - {"crowded"}
    out.untrue += bool(names_untrue)
    out.named += sorted(names_untrue)
    _note_first(fingers, here, time_s, first)


def _may_be(fingers: list[Finger], time_s: float) -> list[int]:
    return [k for k, one in enumerate(fingers) if one.from_s <= time_s <= one.gone_s + LIFT_S]


def _crowded(fingers: list[Finger], time_s: float) -> bool:
    places = [fingers[k].place(time_s) for k in _may_be(fingers, time_s)]
    wide = any(fingers[k].radius_mm > GATE_MM for k in _may_be(fingers, time_s))
    away = [np.hypot(*(a - b)) for i, a in enumerate(places) for b in places[:i]]
    return wide or len(places) >= CROWDED or min(away, default=np.inf) <= CROWDED_MM


def _matched(
    fingers: list[Finger], here: FloatArray, time_s: float
) -> tuple[dict[int, float], list[int], list[int]]:
    """Errors of the fingers that were found, which touches are false, and which fingers are
    missing."""
    may = _may_be(fingers, time_s)
    there = np.array([fingers[k].place(time_s) for k in may]).reshape(-1, 2)
    away = np.linalg.norm(there[:, None] - here[None], axis=2)
    pairs = zip(*linear_sum_assignment(np.where(away <= GATE_MM, away, 1e3)), strict=True)
    close = [(i, j) for i, j in pairs if away[i, j] <= GATE_MM]
    hits = {may[i]: float(away[i, j]) for i, j in close}
    false = sorted(set(range(len(here))) - {int(j) for _, j in close})
    must = [k for k in may if fingers[k].whole_s + GRACE_S <= time_s <= fingers[k].off_s]
    return hits, false, [k for k in must if k not in hits]


def _note(fingers: list[Finger], hits: dict[int, float], time_s: float, out: Judged) -> None:
    landing = [k for k, one in enumerate(fingers) if one.from_s <= time_s <= one.whole_s + GRACE_S]
    for k, error in hits.items():
        one = fingers[k]
        if not one.whole_s + GRACE_S <= time_s <= one.off_s:
            continue
        if one.begin is not one.end:
            out.moving.append(error)
        elif any(other != k for other in landing):
            out.still.append(error)


def _note_first(
    fingers: list[Finger], here: FloatArray, time_s: float, first: list[float | None]
) -> None:
    for k, one in enumerate(fingers):
        near = len(here) and np.linalg.norm(here - one.place(time_s), axis=1).min() < NEAR_MM
        if first[k] is None and one.from_s <= time_s <= one.gone_s and near:
            first[k] = time_s - one.from_s
