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
from eitskin.session.session import Session
from eitskin.truth import observe_scene


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
    add_name(parser)
    add_scan(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    settings = session_settings(options, read_mode(options.mode), record=options.output)
    with Session(
        options.device, settings, say=say, progress=say_progress, observe=observe_scene
    ) as session:
        messages = session.messages()
        try:
            _show_progress(_until(messages, options.seconds), settings.frames)
        except KeyboardInterrupt:
            say("stopped")
        finally:
            messages.close()
        summary, recorder, source = session.finish(), session.recorder, session.source
    assert recorder is not None
    facts = {
        "recording": str(options.output),
        "source": source,
        "packets": recorder.packets,
        "bytes": recorder.bytes,
    }
    written = f"{options.output}: {recorder.packets} packets, {recorder.bytes} bytes"
    return answer(options, facts | summary.as_dict(), *summary.lines(), written)


def _until(messages: Iterator[Message], seconds: float | None) -> Iterator[Message]:
    for message in messages:
        yield message
        if isinstance(message, Frame) and seconds is not None and message.time_s >= seconds:
            return


def _show_progress(messages: Iterable[Message], frames: int) -> None:
    with tqdm(
        desc="frames", total=frames or None, unit="", leave=False, disable=not sys.stderr.isatty()
    ) as bar:
        for message in messages:
            if isinstance(message, Notice):
                bar.write(f"eitskin: {message.text}", file=sys.stderr)
            bar.update(isinstance(message, Frame))
