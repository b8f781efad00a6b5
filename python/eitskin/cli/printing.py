"""What commands print: lines for whoever looks on, and what they found, as JSON for programs."""

import argparse
import json
import sys
from typing import Any


def say(text: str) -> None:
    """A line on stderr for whoever looks on."""
    print(f"eitskin: {text}", file=sys.stderr, flush=True)


def say_progress(text: str) -> None:
    """The same where somebody sits before a terminal."""
    if sys.stderr.isatty():
        say(text)


def table(facts: dict[str, Any]) -> str:
    """Names and values in two columns."""
    width = max(len(name) for name in facts) + 2
    return "\n".join(f"{name.replace('_', ' '):{width}}{value}" for name, value in facts.items())


def print_json(facts: Any) -> None:
    print(json.dumps(facts, indent=2))


def answer(options: argparse.Namespace, facts: Any, *lines: str) -> int:
    """End a command: ``facts`` with ``--json``, else ``lines``; returns its exit code."""
    if options.json:
        print_json(facts)
    else:
        print("\n".join(lines))
    return 0
