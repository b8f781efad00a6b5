"""What commands print: lines for whoever looks on, tables, and JSON for programs."""

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


def print_table(facts: dict[str, Any]) -> None:
    """Names and values in two columns."""
    width = max(len(name) for name in facts) + 2
    for name, value in facts.items():
        print(f"{name.replace('_', ' '):{width}}{value}")


def print_json(facts: Any) -> None:
    print(json.dumps(facts, indent=2))
