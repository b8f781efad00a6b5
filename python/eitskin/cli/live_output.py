"""Printing a board's frames as they come, and their summary; ``stream`` and ``replay`` share it."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.errors import EitskinError, UsageError

if TYPE_CHECKING:
    from collections.abc import Generator

    from eitskin.device.client import Device
    from eitskin.device.known_model import KnownModel
    from eitskin.device.link import LinkEvent
    from eitskin.device.live import LiveFrame, LiveSummary
    from eitskin.device.wire.link_table import Stream
    from eitskin.device.wire.packets import Fault
    from eitskin.scoring.scene_truth import SceneTruth
    from eitskin.scoring.stream_check import Watcher


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


def show(
    options: argparse.Namespace,
    items: Generator[LiveFrame | Fault | LinkEvent, None, None],
    device: Device,
    known: KnownModel | None,
    truth: SceneTruth | None,
) -> LiveSummary:
    """Print every frame and all news of ``items``, draw ``--picture``, print the summary; Ctrl-C
    ends it in good order.

    Raises:
        EitskinError: what ended the stream, after everything up to then was summed up.
    """
    from eitskin.device.events import Events
    from eitskin.device.live import LiveFrame, LiveSummary, finish
    from eitskin.device.wire.packets import Fault
    from eitskin.scoring.stream_check import Watcher, line, table
    from eitskin.view.stream_picture import Album, draw_stream

    summary, watcher, album, events = LiveSummary(), Watcher(known, truth), Album(), Events()
    broken: EitskinError | None = None
    try:
        for item in items:
            for text in events.lines(item):
                print(f"eitskin: {text}", file=sys.stderr, flush=True)
            if isinstance(item, LiveFrame):
                summary.add(item)
                seen = watcher.see(item)
                if options.picture is not None:
                    album.add(seen)
                print(json.dumps(table(seen)) if options.json else line(seen), flush=True)
            elif isinstance(item, Fault):
                summary.faults += item.raised
    except KeyboardInterrupt:
        print("eitskin: stopped", file=sys.stderr)
    except EitskinError as error:
        broken = error
        summary.link = device.counters.as_dict()
    finally:
        items.close()  # the board gets its stop before it is asked what it counted
    if broken is None:
        finish(summary, device)
    if options.picture is not None and album.count and known is not None:
        draw_stream(
            options.picture,
            known.model,
            album,
            title=f"{device.board.board} {device.transport.url}",
        )
    if summary.frames or broken is None:
        _print_summary(summary, watcher, options)
    if broken is not None:
        raise broken
    return summary


def _print_summary(summary: LiveSummary, watcher: Watcher, options: argparse.Namespace) -> None:
    scored = watcher.score.frames > 0
    drawn = str(options.picture) if options.picture is not None and summary.frames else None
    if options.json:
        facts: dict[str, Any] = summary.as_dict()
        facts["truth"] = watcher.score.as_dict() if scored else None
        print(json.dumps({"summary": facts | ({} if drawn is None else {"picture": drawn})}))
        return
    lines = summary.lines()
    if scored:
        lines.append(watcher.score.text())
    if drawn is not None:
        lines.append(f"picture: {drawn}")
    print("\n".join(lines))
