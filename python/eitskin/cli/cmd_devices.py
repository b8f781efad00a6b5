"""``eitskin devices``: list the serial ports, the boards that answer on them, and the names of all
other devices."""

import argparse

from eitskin.cli.arguments import option
from eitskin.cli.printing import answer
from eitskin.device.open import FoundPort, discover
from eitskin.device.source import source_schemes

URLS = {
    "auto": "the one board that is plugged in",
    "serial:PORT": "a serial port; serial:PORT?baud=N for other than 1000000 baud",
    "text:PORT": "an instrument that sends lines: text:PORT?layout=FILE (docs/guide/your-board.md)",
    "sim:SCENE": "a simulated board that sees a scene: a file, or a name of  eitskin scene list",
    "emu:SCENE": "the firmware on an emulated board (a checkout: pip install ./firmware/emulator)",
    "file:RUN.eits": "a recording, made by  eitskin record",
}


NO_PORT = "no serial port; without a board, try  --device sim:two_touch"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "List the serial ports of this computer, and ask those that look like a board's what they"
        " are. Other ports are left alone; ask one of them with  eitskin info --device"
        " serial:PORT."
    )
    option(parser, "--quiet", "do not ask any board")
    option(parser, "--json", "print for programs")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    found = discover(ask=not options.quiet)
    added = {f"{scheme}:...": "a source from another package" for scheme in source_schemes()}
    return answer(
        options,
        {"ports": [port.as_dict() for port in found], "urls": URLS},
        *(map(_line, found) if found else [NO_PORT]),
        "--device takes:",
        *(f"  {url:14} {meaning}" for url, meaning in (URLS | added).items()),
    )


def _line(found: FoundPort) -> str:
    port = found.port
    usb = "" if port.vendor is None else f", USB {port.vendor:04x}:{port.product or 0:04x}"
    described = "" if port.description in ("", "n/a") else f"  {port.description}"
    line = f"serial:{port.path}{described}{usb}: "
    if found.board is not None:
        named = f", name {found.board.name}" if found.board.name else ""
        return (
            f"{line}{found.board.board}, firmware {found.board.firmware_text}, serial"
            f" {found.board.serial}{named}"
        )
    if found.why is not None:
        return f"{line}{found.why}"
    return line + ("a board, not asked" if port.is_board else "not a board")
