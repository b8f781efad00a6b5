"""Print a board's frames as they arrive, and their summary; shared by ``stream`` and ``replay``."""

import argparse

from eitskin.cli.frame_line import line
from eitskin.cli.printing import say
from eitskin.cli.progress import bar
from eitskin.device.wire.link_table import Stream
from eitskin.errors import EitskinError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.robot.description import is_robot
from eitskin.session.frame import DriveReport, Frame, Notice
from eitskin.session.message import encoded, summary_message
from eitskin.session.robot_session import AnySession
from eitskin.sinks.outputs import Outputs
from eitskin.view.film import check_film
from eitskin.view.panels import check_picture
from eitskin.view.stream_picture import Album, draw_stream, film_stream

HEADER = "  time s  touch    x mm    y mm  radius mm  force N"
SCORED = "  off mm"


def check_drawn(options: argparse.Namespace, what: Stream, device: str) -> None:
    """Check that ``--picture`` and ``--film`` can be drawn of ``device``, before anything else is
    done.

    Raises:
        UsageError: it is a robot, neither images nor touches are streamed, or a name has an unknown
            format.
        MissingExtraError: matplotlib is not installed.
    """
    if options.picture is None and options.film is None:
        return
    if is_robot(device):
        raise UsageError(
            f"--picture and --film draw one skin, and {device} is a robot; leave them out"
        )
    refuse_unwritable(options.picture, options.film)
    check_picture(options.picture)
    check_film(options.film)
    if not what & (Stream.IMAGE | Stream.TOUCHES):
        raise UsageError(
            "--picture and --film draw images and touches; use  --mode image  or  --mode"
            " image,touches"
        )


class Rows:
    """Formats frames as text: with ``verbose`` one line per frame with everything known about it;
    otherwise touches in a table, one row each, and other frames in brief. ``width`` of the skins'
    names, which begin the lines of a robot; 0: it is one skin."""

    def __init__(self, verbose: bool, scored: bool, width: int = 0) -> None:
        self._verbose, self._scored, self._begun = verbose, scored, False
        self._width = width

    def lines(self, message: Frame | DriveReport) -> list[str]:
        """Return the lines for the next frame, or for touches after a drive."""
        begun = self._begun
        if isinstance(message, DriveReport):
            lines = self.moving(message)
        else:
            lines = [*self._frame(message), *_happened(message)]
        if not self._width:
            return lines
        head = [f"{'skin':{self._width}}  {lines.pop(0)}"] if self._begun and not begun else []
        return head + [f"{message.source or '':{self._width}}  {line}" for line in lines]

    def _frame(self, frame: Frame) -> list[str]:
        if frame.info is None and frame.raw is None:
            return []
        more = frame.solver_image is not None or frame.raw is not None
        if self._verbose or more or not frame.has_touches:
            return [line(frame, solver=self._verbose)]
        rows = [] if self._begun else [HEADER + (SCORED if self._scored else "")]
        self._begun = True
        if frame.refused:
            return [*rows, f"{frame.time_s:8.3f}  refused: {frame.refused}"]
        if not frame.touches:
            rows.append(f"{frame.time_s:8.3f}      -")
        for number, touch in enumerate(frame.touches):
            time = f"{frame.time_s:8.3f}" if number == 0 else " " * 8
            force = f"{touch.force_n:.3f}" if touch.force_n else "-"
            rows.append(
                f"{time}  {touch.id:5d} {touch.x_mm:7.1f} {touch.y_mm:7.1f} {touch.radius_mm:10.1f}"
                f" {force:>8}{self._off(frame, number)}"
            )
        return rows

    def moving(self, report: DriveReport) -> list[str]:
        """Return the lines for touches after a drive: their places and velocities."""
        time = f"{report.time_s:8.4f}"
        return [
            f"{time}  drive {report.drive:2d}: touch {one.id} at {one.x_mm:.1f},"
            f" {one.y_mm:.1f} mm, {one.vx_mm_per_s:+.0f}, {one.vy_mm_per_s:+.0f} mm/s"
            for one in report.touches
        ] or [f"{time}  no touch"]

    def _off(self, frame: Frame, number: int) -> str:
        errors = frame.errors_mm
        if errors is None:
            return ""
        return f" {errors[number]:7.2f}" if number in errors else "   false"


def _happened(frame: Frame) -> list[str]:
    """Return a line for each gesture and each zone that is pressed; continuous changes appear only
    with --json."""
    return [f"{frame.time_s:8.3f}  {one.text()}" for one in frame.events if one.is_gesture]


def show(options: argparse.Namespace, session: AnySession, outputs: Outputs | None = None) -> None:
    """Print every message of ``session``, draw ``--picture`` and ``--film``, and print the summary
    with the counts of ``outputs``. Ctrl-C ends it cleanly."""
    album, broken = Album(), None
    several = session.source is None
    scored = any(one.observer is not None for one in session.parts.values())
    rows = Rows(options.verbose, scored, max(map(len, session.parts)) if several else 0)
    messages = session.messages()
    try:
        for message in messages:
            if isinstance(message, Notice):
                say(f"{message.source}: {message.text}" if several else message.text)
                continue
            if isinstance(message, Frame) and (options.picture or options.film):
                album.add(message)
            lines = [encoded(message.message())] if options.json else rows.lines(message)
            for text in lines:
                print(text, flush=True)
    except KeyboardInterrupt:
        say("stopped")
    except EitskinError as error:
        broken = error
        session.count_links()
    finally:
        messages.close()  # stops the board before it is asked for its counters
    if broken is None:
        session.finish()
    (one, *_) = session.parts.values()
    if album.count and one.known is not None:
        board, url, model = one.device.board.board, one.device.transport.url, one.known.model
        if options.picture is not None:
            draw_stream(options.picture, model, album, title=f"{board} {url}")
        if options.film is not None:
            film_stream(options.film, model, album, progress=bar("film"))
    if session.summary.frames or broken is None:
        _print_summary(options, session, outputs)
    if broken is not None:
        raise broken


def _print_summary(
    options: argparse.Namespace, session: AnySession, outputs: Outputs | None
) -> None:
    summary = session.summary
    drawn = str(options.picture) if options.picture is not None and summary.frames else None
    facts = session.facts()
    if drawn is not None:
        facts["picture"] = drawn
    if outputs is not None:
        counts = outputs.end(facts)
        if counts:
            facts["sinks"] = counts
    if options.json:
        print(encoded(summary_message(facts, session.source)))
        return
    lines = summary.lines() + ([] if outputs is None else outputs.lines)
    for name, part in session.parts.items():
        scores = [] if part.observer is None else part.observer.lines()
        lines += [f"{name}: {line}" for line in scores] if session.source is None else scores
    if drawn is not None:
        lines.append(f"picture: {drawn}")
    print("\n".join(lines))
