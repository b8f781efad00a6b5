"""``eitskin completion SHELL``: print the script with which a shell completes commands and
options."""

import argparse

from eitskin.cli.arguments import option
from eitskin.errors import missing_extra


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Print the completion script for your shell, for example with  eitskin completion bash >"
        " ~/.local/share/bash-completion/completions/eitskin ; zsh needs it as a file _eitskin"
        " in a folder of $fpath."
    )
    option(parser, "shell", None, choices=("bash", "zsh", "tcsh"))
    parser.set_defaults(run=run, extras=("completion",))


def run(options: argparse.Namespace) -> int:
    try:
        import shtab
    except ImportError:
        raise missing_extra("completion", "shtab") from None
    from eitskin.cli.main import build_parser

    print(shtab.complete(build_parser(), options.shell))
    return 0
