"""``eitskin view``: show a board live on a page in a browser."""

import argparse
import ipaddress
import secrets
import webbrowser
from dataclasses import replace
from functools import partial
from pathlib import Path
from urllib.parse import quote

from eitskin.cli.arguments import option
from eitskin.cli.device_options import (
    add_device,
    add_every,
    add_name,
    add_outputs,
    add_report,
    add_scan,
    add_zones,
    named_outputs,
    read_mode,
    session_settings,
)
from eitskin.cli.printing import say
from eitskin.errors import FileError, UsageError
from eitskin.fileio import read_bytes, refuse_unwritable
from eitskin.page.server import MIN_TOKEN, PageServer, listen, load_server
from eitskin.page.teacher import Teacher
from eitskin.robot.description import is_robot
from eitskin.skin.skin import load_skin
from eitskin.teaching.plan import load_plan

PORT = 8470


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Serve a page that shows a board live, and print its address. Simulated and recorded"
        " frames run at the speed of their scan; add ?speed=2 or ?speed=max to the device to"
        " change that, and ?loop=1 to repeat them. Stop with Ctrl-C."
    )
    add_device(parser, json=False)
    option(
        parser,
        "--mode KIND[,KIND]",
        "raw, image, touches, or several (default: all; for a real board image,touches)",
    )
    add_report(parser)
    add_every(parser)
    option(parser, "--port PORT", "port to listen on; 0: any", default=PORT, within=(0, 65535))
    option(
        parser,
        "--host ADDRESS",
        "address to listen on, such as 0.0.0.0; access from other machines needs --token",
        default="127.0.0.1",
    )
    option(
        parser,
        "--token WORD",
        "password for commands (default: a random one, in the address)",
    )
    option(parser, "--folder FOLDER", "folder for the page's recordings", Path, default=Path())
    option(
        parser, "--teach PLAN.csv", "guide through the presses of  teach plan  on the page", Path
    )
    option(
        parser,
        "--presses PRESSES.npz",
        "file for these presses, continued if it exists (default: presses.npz in --folder); the"
        " model is written beside it",
        Path,
    )
    option(parser, "--skin SKIN.toml", "skin for --teach (default: the board model's)", Path)
    add_outputs(parser)
    add_name(parser)
    add_zones(parser)
    option(parser, "--overwrite", "overwrite existing files of --to")
    option(parser, "--open", "open the page in this machine's browser")
    add_scan(parser)
    parser.set_defaults(run=run, extras=("view",))


def run(options: argparse.Namespace) -> int:
    load_server()
    if options.token is not None and len(options.token) < MIN_TOKEN:
        raise UsageError(f"--token: a word of at least {MIN_TOKEN} characters")
    remote = not _this_machine(options.host)
    if remote and options.token is None:
        raise UsageError(
            f"--host {options.host}: access from other machines needs a password; set it with"
            f"  --token WORD, at least {MIN_TOKEN} characters"
        )
    if options.teach is not None and is_robot(options.device):
        raise UsageError(
            f"--teach teaches one skin, and {options.device} is a robot; name the skin's board"
        )
    if not options.folder.is_dir():
        raise FileError(f"--folder {options.folder}: no such folder; make it, or name another")
    options.frames = None
    named = options.mode or ("raw,touches" if options.teach is not None else None)
    mode = None if named is None else read_mode(named)  # None: chosen by the kind of device
    settings = replace(session_settings(options, mode), quiet_frames=True)
    token = options.token or secrets.token_urlsafe(16)
    server = PageServer(
        options.device,
        settings,
        listen(options.host, options.port),
        token=token,
        host=options.host,
        remote=remote,
        folder=options.folder,
        say=say,
        outputs=partial(named_outputs, options) if options.to else None,
        teacher=_teacher(options),
    )
    address = f"{server.address}#token={quote(token, safe='')}"
    print(f"open {address}", flush=True)
    if options.open:
        webbrowser.open(address)
    server.serve()
    return 0


def _teacher(options: argparse.Namespace) -> Teacher | None:
    if options.teach is None:
        return None

    presses = options.presses or options.folder / "presses.npz"
    if options.presses is None and presses.exists():
        say(f"--teach continues {presses}; name another file with  --presses FILE")
    try:
        refuse_unwritable(presses)
    except FileError as error:
        hint = "" if options.presses else "; the presses go there unless you say  --presses FILE"
        raise FileError(f"{error}{hint}") from None
    skin, text = None, ""
    if options.skin is not None:
        skin = load_skin(options.skin)[0]
        text = read_bytes(options.skin, "skin description", 1_000_000).decode("utf-8")
    return Teacher(load_plan(options.teach), presses, skin, text)


def _this_machine(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
