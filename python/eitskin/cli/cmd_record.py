"""``eitskin record``: write every packet of a board to a file, for ``replay`` and for people
without a board."""

import argparse
import sys
from collections.abc import Iterable, Iterator

from tqdm import tqdm

from eitskin.cli.arguments import Output, above, option
from eitskin.cli.device_options import add_device, add_scan, add_stream, read_mode, session_settings
from eitskin.cli.printing import answer, say, say_progress
from eitskin.device.events import Events
from eitskin.device.live_frames import Item, LiveDrive, LiveFrame, LiveSummary
from eitskin.device.wire.packets import Fault
from eitskin.live.session import Session


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Take the reference, then write every packet of a board to a file as it arrives, including"
        " the raw frames of the reference. An interrupted recording, even after kill -9, can be"
        " read up to its last complete packet. Stop with Ctrl-C."
    )
    add_device(parser)
    option(parser, "-o --output RUN.eits", None, Output, required=True)
    option(parser, "--overwrite", "overwrite an existing file")
    add_stream(parser, "raw,image,touches")
    seconds = "stop after S seconds of the board's time"
    option(parser, "--seconds S", seconds, float, within=(above(0), 1e6))
    add_scan(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    settings = session_settings(options, read_mode(options.mode), record=options.output)
    with Session(options.device, settings, say=say, progress=say_progress) as session:
        items = session.items()
        try:
            _count(_until(items, options.seconds), session.summary, settings.frames)
        except KeyboardInterrupt:
            say("stopped")
        finally:
            items.close()
        summary, recorder = session.finish(), session.recorder
    assert recorder is not None
    facts = {"recording": str(options.output), "packets": recorder.packets, "bytes": recorder.bytes}
    written = f"{options.output}: {recorder.packets} packets, {recorder.bytes} bytes"
    return answer(options, facts | summary.as_dict(), *summary.lines(), written)


def _until(items: Iterator[Item], seconds: float | None) -> Iterator[Item]:
    for item in items:
        yield item
        if seconds is not None and isinstance(item, LiveFrame) and item.time_us >= 1e6 * seconds:
            return


def _count(items: Iterable[Item], summary: LiveSummary, frames: int) -> None:
    events = Events()
    with tqdm(
        desc="frames", total=frames or None, unit="", leave=False, disable=not sys.stderr.isatty()
    ) as bar:
        for item in items:
            for text in events.lines(item):
                bar.write(f"eitskin: {text}", file=sys.stderr)
            if isinstance(item, LiveFrame):
                summary.add(item)
                bar.update()
            else:
                summary.drives += isinstance(item, LiveDrive)
                summary.faults += isinstance(item, Fault) and item.raised
