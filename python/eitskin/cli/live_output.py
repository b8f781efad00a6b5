"""Printing a board's frames as they come, and their summary; ``stream`` and ``replay`` share it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.cli.device_options import say
from eitskin.errors import EitskinError, UsageError

if TYPE_CHECKING:
    from eitskin.device.wire.link_table import Stream
    from eitskin.live.session import Session


def check_picture(path: Path | None, what: Stream) -> None:
    """Refuse a picture of what cannot be drawn, before anything is done for it.

    Raises:
        UsageError: neither images nor touches are asked for.
        MissingExtraError: matplotlib is not installed.
    """
    from eitskin.device.wire.link_table import Stream
    from eitskin.view.pictures import load_matplotlib

    if path is None:
        return
    if not what & (Stream.IMAGE | Stream.TOUCHES):
        raise UsageError(
            "--picture draws images and touches; use  --mode image  or  --mode image,touches"
        )
    load_matplotlib()


def show(options: argparse.Namespace, session: Session) -> None:
    """Print every frame and all news of ``session``, draw ``--picture``, print the summary; Ctrl-C
    ends it in good order.

    Raises:
        EitskinError: what ended the stream, after everything up to then was summed up.
    """
    from eitskin.live.frame import Notice
    from eitskin.live.message import encoded
    from eitskin.scoring.stream_check import line
    from eitskin.view.stream_picture import Album, draw_stream

    album, broken = Album(), None
    frames = session.frames()
    try:
        for item in frames:
            if isinstance(item, Notice):
                say(item.text)
                continue
            if options.picture is not None:
                album.add(item.compared)
            print(encoded(item.message()) if options.json else line(item.compared), flush=True)
    except KeyboardInterrupt:
        say("stopped")
    except EitskinError as error:
        broken = error
        session.summary.link = session.device.counters.as_dict()
    finally:
        frames.close()  # the board gets its stop before it is asked what it counted
    if broken is None:
        session.finish()
    if options.picture is not None and album.count and session.known is not None:
        board, url = session.device.board.board, session.device.transport.url
        draw_stream(options.picture, session.known.model, album, title=f"{board} {url}")
    if session.summary.frames or broken is None:
        _print_summary(options, session)
    if broken is not None:
        raise broken


def _print_summary(options: argparse.Namespace, session: Session) -> None:
    from eitskin.live.message import encoded, summary_message

    summary, score = session.summary, session.score
    drawn = str(options.picture) if options.picture is not None and summary.frames else None
    if options.json:
        facts: dict[str, Any] = summary.as_dict()
        facts["truth"] = score.as_dict() if score.frames else None
        print(encoded(summary_message(facts | ({} if drawn is None else {"picture": drawn}))))
        return
    lines = summary.lines()
    if score.frames:
        lines.append(score.text())
    if drawn is not None:
        lines.append(f"picture: {drawn}")
    print("\n".join(lines))
