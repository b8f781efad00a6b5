"""``eitskin teach record --plan PLAN -o PRESSES``: guide a person through the presses of a plan."""

import argparse
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.cli.arguments import Output, option
from eitskin.cli.device_options import add_device
from eitskin.cli.printing import say
from eitskin.config import first_few
from eitskin.device.known_model import scanned_protocol
from eitskin.device.wire.link_table import Stream
from eitskin.errors import FrameError, ProtocolError
from eitskin.fileio import read_bytes, refuse_unwritable
from eitskin.frames.frames import Frames, load_frames
from eitskin.session.frame import Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin, load_skin
from eitskin.teaching.guide import GuideEvent, PressGuide, guide_presses, scan_of_presses
from eitskin.teaching.plan import PressPlan, load_plan
from eitskin.teaching.practice import plan_of_scene
from eitskin.teaching.press_file import PressFile
from eitskin.truth import observe_scene

TimedFrames = Iterator[tuple[np.ndarray, float]]


def add_parser(actions: Any) -> None:
    parser = actions.add_parser(
        "record",
        help="guide through the presses of a plan; each good press is saved at once",
        description=(
            "Guide through the places of a plan: which is next, when to press, when to lift. The"
            " untouched frame just before each press is saved with it. A press that was not held,"
            " moved or slipped must be repeated. Stop with Ctrl-C, and continue later with the same"
            " command. On a terminal, b and Enter goes back to the previous press, s skips a place,"
            " and q quits."
        ),
    )
    option(
        parser,
        "--plan PLAN.csv",
        "from  teach plan, or with x_mm,y_mm by hand; or a scene that presses, such as  hydrogel",
        Path,
        required=True,
    )
    option(parser, "-o --output PRESSES.npz", None, Output, required=True)
    option(parser, "--overwrite", "start again if the output exists")
    option(parser, "--skin SKIN.toml", "stored in the output, for  teach fit", Path)
    option(
        parser,
        "--frames FRAMES.npz",
        "a frames file instead of a board, with the skin untouched and pressed by turns",
        Path,
    )
    each = parser.add_mutually_exclusive_group()
    for name, what in (("--depth-mm MM", "depth"), ("--force-n N", "force")):
        text = f"{what} of the presses for which the plan has none"
        option(each, name, text, float, within=(0, 1e6))
    add_device(parser, json=False)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    if options.plan.suffix == ".toml" or not (options.plan.suffix or options.plan.exists()):
        plan, text = plan_of_scene(str(options.plan))
    else:
        plan, text = load_plan(options.plan), ""
    plan = _with_given(plan, options)
    refuse_unwritable(options.output)
    skin = None if options.skin is None else load_skin(options.skin)[0]
    if skin is not None:
        _warn_outside(plan, skin)
        text = read_bytes(options.skin, "skin description", 1_000_000).decode("utf-8")
    if options.frames is not None:
        frames = load_frames(options.frames, allow_nonfinite=True)
        return _guide(options, plan, text, frames.protocol, _in_time(frames))
    return _before_a_board(options, plan, skin, text)


def _with_given(plan: PressPlan, options: argparse.Namespace) -> PressPlan:
    given = {"depth_mm": options.depth_mm, "force_n": options.force_n}
    for name, value in given.items():
        if value is None:
            continue
        old = getattr(plan, name)
        plan = replace(plan, **{name: np.where(np.isnan(old), value, old)})
    return plan


def _warn_outside(plan: PressPlan, skin: Skin) -> None:
    inside = skin.outline.contains(plan.place_mm)
    if not inside.all():
        names = first_few((np.flatnonzero(~inside) + 1).tolist(), 5)
        say(f"outside the skin {skin.name!r}: places {names} of {len(plan)}; are they in mm?")


def _in_time(frames: Frames) -> TimedFrames:
    for number, frame in enumerate(frames.voltage_v):
        yield frame, float(number if frames.time_s is None else frames.time_s[number])


def _before_a_board(
    options: argparse.Namespace, plan: PressPlan, skin: Skin | None, text: str
) -> int:
    with raw_session(options, options.model) as session:
        protocol = scanned_protocol(session.device.board, session.known, session.name)
        if skin is not None and skin.electrodes.count != protocol.n_electrodes:
            raise ProtocolError(
                f"{options.skin}: {skin.electrodes.count} electrodes, but the board scans"
                f" {protocol.n_electrodes}; build a model of this skin first:  eitskin model"
                f" build {options.skin} -o MODEL.eitm,  then --model MODEL.eitm"
            )
        return _guide(options, plan, text, protocol, _live(session))


@contextmanager
def raw_session(
    options: argparse.Namespace, model: Path | None, frames: int = 0
) -> Iterator[Session]:
    """Open a session with a board that sends raw frames for the guide; ``frames`` of them, or all
    if 0."""
    settings = SessionSettings(
        mode=Stream.RAW, every=1, frames=frames, model=model, firmware=options.firmware
    )
    with Session(options.device, settings, say=say, observe=observe_scene) as session:
        scan = scan_of_presses(session.device.board, session.replays)
        session.settings = replace(settings, scan=scan)
        yield session


def _live(session: Session) -> TimedFrames:
    for message in session.messages():
        if isinstance(message, Frame) and message.raw is not None and not message.untouched:
            yield message.raw.voltage_v, message.time_s


def _guide(
    options: argparse.Namespace, plan: PressPlan, text: str, protocol: Protocol, frames: TimedFrames
) -> int:
    file = PressFile(options.output, plan, protocol, text, start_again=options.overwrite)
    if file.numbers:
        say(f"{options.output}: has {len(file.numbers)} presses already; continuing")
    guide = PressGuide(plan, start=file.following)

    def shown(event: GuideEvent) -> None:
        if event.number >= len(plan):
            print(event.text, flush=True)
            return
        x, y = plan.place_mm[event.number]
        where = f"{event.number + 1:3d} of {len(plan)}, at ({x:.1f}, {y:.1f}) mm"
        print(f"{where}: {event.text}", flush=True)

    stopped, key = False, _keys()

    def pressed() -> str:
        nonlocal stopped
        typed = key()
        stopped = stopped or typed == "q"
        return typed

    try:
        guide_presses(frames, guide, file, shown, pressed)
    except KeyboardInterrupt:
        stopped = True
        print("eitskin: stopped", file=sys.stderr)
    finally:
        file.close()
    if not file.numbers and not stopped:
        raise FrameError(
            f"{options.output}: not written, because the frames ended before any press of the plan"
            " was held"
        )
    left = len(plan) - file.following
    print(f"{options.output}: {len(file.numbers)} presses" + (f", {left} places left" * (left > 0)))
    return 0


def _keys() -> Callable[[], str]:
    """Return a function that gives the first letter of the last typed line, or nothing if nobody
    can type."""
    if not sys.stdin or not sys.stdin.isatty():
        return lambda: ""

    typed: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            typed.put(line.strip()[:1].lower())

    threading.Thread(target=read, daemon=True).start()

    def key() -> str:
        return "" if typed.empty() else typed.get()

    return key
