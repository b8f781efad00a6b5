"""Run the demo's touches on the emulated board, and compare the firmware's results with this
host's, bit for bit."""

from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

from eitskin.core.diagnostics_table import Touch
from eitskin.device.bandwidth import carried_every
from eitskin.device.known_model import need_model
from eitskin.device.open import open_device
from eitskin.device.settings import ScanSettings, SolverSettings
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import BoardInfo
from eitskin.errors import DeviceError
from eitskin.scene.random_touches import TrueTouch
from eitskin.scoring.matching import Matching
from eitskin.scoring.scene_truth import truth_of
from eitskin.session.assemble import read_frames
from eitskin.session.checks.host_check import HostCheck, HostTwin
from eitskin.session.checks.packet_log import PacketLog
from eitskin.session.frame import Frame, Notice
from eitskin.session.set_up import begin_scene, set_up, take_reference
from eitskin.session.summary import Summary

TARE_FRAMES = 8
FRAMES = 3
TRACKED_FRAMES = 6  # the first are not solved: touches land during their scans
EVERYTHING = Stream.RAW | Stream.IMAGE | Stream.TOUCHES


@dataclass(frozen=True, eq=False)
class BoardDemo:
    """The touches that the board found in its last frame, those that this host found in the same
    raw frame, and the comparison of all frames."""

    url: str
    info: BoardInfo
    frame: Frame
    board: tuple[Touch, ...]
    host: tuple[Touch, ...]
    true: tuple[TrueTouch, ...]
    matching: Matching
    check: HostCheck
    summary: Summary
    seconds: float


def run_board_demo(url: str) -> BoardDemo:
    """Tare the board behind ``url`` (sim: or emu:) and let it solve a few frames of its scene.

    Raises:
        DeviceError: it solves no frame.
        MissingExtraError: the emulator is not installed.
    """
    start = perf_counter()
    summary, host = Summary(), None
    with open_device(url) as device:
        scene = device.transport.capabilities.scene
        assert scene is not None
        truth = truth_of(scene)
        known = need_model(device.board, None, device.transport.name, "the comparison")
        options = set_up(device, ScanSettings(), SolverSettings(), known)
        assert options is not None
        log = PacketLog(device)
        take_reference(device, TARE_FRAMES, streamed=True)
        began_us, _ = begin_scene(device)
        if began_us is not None:
            truth.began_us = began_us
        every = carried_every(device, EVERYTHING)
        frames = FRAMES if every > 1 else TRACKED_FRAMES
        for message in read_frames(device, EVERYTHING, every=every, frames=frames):
            if isinstance(message, Frame):
                summary.add(message)
        log.stop()
        info = device.board
    twin, last = HostTwin(known, options, info), None
    for message in log.frames(EVERYTHING):
        if isinstance(message, Frame):
            result = twin.take(message)
            if result is not None:
                last, host = message, result
        elif isinstance(message, Notice) and isinstance(message.cause, LinkEvent):
            twin.lost()
    if last is None or host is None or not last.has_touches:
        raise DeviceError(f"{url}: the board solved no frame")
    true, found = truth.touches(last.board_us), last.touches
    matching = truth.matching(true, [(t.x_mm, t.y_mm) for t in found])
    touches = (found, host.touches, true)
    seconds = perf_counter() - start
    return BoardDemo(url, info, last, *touches, matching, twin.check, summary, seconds)


def to_json(demo: BoardDemo) -> dict[str, Any]:
    """Return everything that the text says, unrounded, as JSON values."""
    quantiles = demo.summary.solve_quantiles_us
    return {
        "device": demo.url,
        "board": demo.info.board,
        "firmware": demo.info.firmware_text,
        "frame": demo.frame.number,
        "true": [[t.x_mm, t.y_mm, t.radius_mm] for t in demo.true],
        "board_touches": [asdict(touch) for touch in demo.board],
        "host_touches": [asdict(touch) for touch in demo.host],
        "position_errors_mm": list(demo.matching.distances_mm),
        "false": demo.matching.false_touches,
        "check": demo.check.as_dict(),
        "solve_us_p50": None if quantiles is None else quantiles[0],
        "seconds": demo.seconds,
    }


def to_text(demo: BoardDemo) -> str:
    """Return a table of the board's, this host's and the true touches, and whether all bits
    agree."""
    solved = demo.summary.solve_quantiles_us
    time = "" if solved is None else f", {solved[0] / 1e3:.1f} ms per solve in the board's time"
    lines = [
        (
            f"the same three touches through {demo.url}: {demo.info.board}, firmware"
            f" {demo.info.firmware_text}{time}"
        ),
        "        board x      y  radius |   host x      y  radius | error mm",
    ]
    error_mm = dict(zip(demo.matching.pairs, demo.matching.distances_mm, strict=True))
    place = {found: true for true, found in demo.matching.pairs}
    in_order = sorted(range(len(demo.board)), key=lambda k: place.get(k, len(demo.true)))
    for n, k in enumerate(in_order):
        touch = demo.board[k]
        row = f"touch {n + 1} {touch.x_mm:7.2f} {touch.y_mm:6.2f} {touch.radius_mm:7.2f} |"
        if k < len(demo.host):
            other = demo.host[k]
            row += f" {other.x_mm:8.2f} {other.y_mm:6.2f} {other.radius_mm:7.2f} |"
        else:
            row += "      none               |"
        lines.append(row + (f" {error_mm[place[k], k]:8.2f}" if k in place else "    false"))
    if demo.matching.misses:
        lines.append(f"{demo.matching.misses} touches not found")
    lines.append(f"{demo.check.text()} ({demo.seconds:.1f} s)")
    return "\n".join(lines)
