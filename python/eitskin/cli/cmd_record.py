"""``eitskin record``: write every packet of a board to a file, for ``replay`` and for people
without a board."""

import argparse
import sys
from collections.abc import Iterable, Iterator

from tqdm import tqdm

from eitskin.cli.arguments import Output, above, option
from eitskin.cli.device_options import (
    add_device,
    add_name,
    add_scan,
    add_stream,
    read_mode,
    session_settings,
)
from eitskin.cli.printing import answer, say, say_progress
from eitskin.session.frame import Frame, Message, Notice
from eitskin.session.robot_session import open_session
from eitskin.truth import observe_scene


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Take the reference, then write every packet of a board to a file as it arrives, including"
        " the raw frames of the reference. An interrupted recording, even after kill -9, can be"
        " read up to its last complete packet. Stop with Ctrl-C."
    )
    add_device(parser)
    where = "the recording; a robot's is a folder with a file per skin"
    option(parser, "-o --output RUN.eits", where, Output, required=True)
    option(parser, "--overwrite", "overwrite an existing file")
    add_stream(parser, "raw,image,touches")
    seconds = "stop after S seconds of the board's time"
    option(parser, "--seconds S", seconds, float, within=(above(0), 1e6))
    add_name(parser)
    add_scan(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    settings = session_settings(options, read_mode(options.mode), record=options.output)
    with open_session(
        options.device, settings, say=say, progress=say_progress, observe=observe_scene
    ) as session:
        messages = session.messages()
        try:
            total = settings.frames * len(session.parts)
            _show_progress(_until(messages, options.seconds), total)
        except KeyboardInterrupt:
            say("stopped")
        finally:
            messages.close()
        summary, source = session.finish(), session.source
        recorders = [one.recorder for one in session.parts.values() if one.recorder is not None]
    packets, size = sum(one.packets for one in recorders), sum(one.bytes for one in recorders)
    facts = {"recording": str(options.output), "source": source, "packets": packets, "bytes": size}
    written = f"{options.output}: {packets} packets, {size} bytes"
    return answer(options, facts | summary.as_dict(), *summary.lines(), written)


def _until(messages: Iterator[Message], seconds: float | None) -> Iterator[Message]:
    for message in messages:
        yield message
        if isinstance(message, Frame) and seconds is not None and message.time_s >= seconds:
            return


def _show_progress(messages: Iterable[Message], total: int) -> None:
    with tqdm(
        desc="frames", total=total or None, unit="", leave=False, disable=not sys.stderr.isatty()
    ) as bar:
        for message in messages:
            if isinstance(message, Notice):
                bar.write(f"eitskin: {message.text}", file=sys.stderr)
            bar.update(isinstance(message, Frame))
