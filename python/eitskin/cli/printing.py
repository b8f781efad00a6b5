"""Printing of commands: lines for people, and results for people or, as JSON, for programs."""

import argparse
import json
import sys
from typing import Any

from eitskin.errors import printable


def say(text: str) -> None:
    """Print a line for people on stderr."""
    print(f"eitskin: {printable(text)}", file=sys.stderr, flush=True)


def say_progress(text: str) -> None:
    """Print a line on stderr if that is a terminal."""
    if sys.stderr.isatty():
        say(text)


def table(facts: dict[str, Any]) -> str:
    """Return names and values in two columns."""
    width = max(len(name) for name in facts) + 2
    return "\n".join(
        f"{name.replace('_', ' '):{width}}{printable(str(value))}" for name, value in facts.items()
    )


def print_json(facts: Any) -> None:
    """Print ``facts`` as JSON."""
    print(json.dumps(facts, indent=2))


def answer(options: argparse.Namespace, facts: Any, *lines: str) -> int:
    """End a command: print ``facts`` with ``--json``, otherwise ``lines``; return the exit code."""
    if options.json:
        print_json(facts)
    else:
        print("\n".join(printable(one) for line in lines for one in line.split("\n")))
    return 0
