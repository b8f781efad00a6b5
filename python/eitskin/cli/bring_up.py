"""``eitskin board bring-up``: leads through the first measurements on an instrument."""

import argparse
import json
import sys

from eitskin.bringup.findings import StageReport
from eitskin.bringup.run import FIXTURES, bring_up
from eitskin.cli.device_options import open_named
from eitskin.cli.printing import say
from eitskin.config import plain_number

EXIT_WRONG = 1


class Person:
    """The person at the bench. They read standard error, and are asked if it is a terminal."""

    def __init__(self) -> None:
        self._there = sys.stdin.isatty() and sys.stderr.isatty()

    def number(self, question: str) -> float | None:
        """A number, or None if none is given."""
        text = self._ask(f"{question} (empty: not measured): ").strip()
        try:
            return plain_number(text) if text else None
        except ValueError:
            say(f"{text}: not a number; left out")
            return None

    def done(self, what: str) -> bool:
        """Return whether it was done."""
        return self._there and self._ask(f"{what}, then press Enter (s: skip): ").strip() != "s"

    def connect(self, what: str) -> None:
        """Wait until it is connected."""
        if self._there:
            self._ask(f"{what}, then press Enter: ")
        else:
            say(what)

    def _ask(self, text: str) -> str:
        if not self._there:
            return ""
        print(text, end="", file=sys.stderr, flush=True)
        return sys.stdin.readline()


def run_bring_up(options: argparse.Namespace) -> int:
    """Measure stage by stage; EXIT_WRONG where one is wrong."""
    person = Person()
    reports: list[StageReport] = []
    with open_named(options) as device:

        def connect(fixture: str) -> None:
            if not device.transport.connect(fixture):
                person.connect(FIXTURES[fixture])

        stages = bring_up(
            device,
            connect,
            person.number,
            person.done,
            first=options.first_stage,
            last=options.last_stage,
        )
        for report in stages:
            reports.append(report)
            if not options.json:
                print(f"{report.stage}: {'ok' if report.good else 'wrong'}")
                for finding in report.findings:
                    print("  " + finding.line().replace("\n", "\n  "))
    if options.json:
        print(json.dumps([report.as_dict() for report in reports]))
    return 0 if all(report.good for report in reports) else EXIT_WRONG
