"""The findings of a stage of the bring-up: what was measured, and what it means."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

STAGES = (
    "supplies", "converter", "generator", "source", "amplifier", "multiplexers", "ring", "dish",
    "gel",
)  # fmt: skip
# Puts the fixture on the electrodes (an emulated board does it itself), or asks the maker to.
Connect = Callable[[str], None]
# Asks the maker for a number that only a voltmeter or an oscilloscope has; None: not measured.
AskNumber = Callable[[str], float | None]
AskDone = Callable[[str], bool]


@dataclass(frozen=True)
class Finding:
    """``what`` was measured: ``seen``, where ``expected`` is predicted. ``wrong`` names the
    mistake and where to look; empty: it is right."""

    what: str
    seen: str
    expected: str
    wrong: str = ""

    def line(self) -> str:
        mark = "wrong" if self.wrong else "ok"
        return f"{mark:5}  {self.what}: {self.seen} (predicted {self.expected})" + (
            f"\n       {self.wrong}" if self.wrong else ""
        )


@dataclass(frozen=True)
class StageReport:
    """All of a stage. A stage that is wrong ends the bring-up: the next ones build on it."""

    stage: str
    findings: list[Finding] = field(default_factory=list)

    @property
    def good(self) -> bool:
        return not any(one.wrong for one in self.findings)

    def as_dict(self) -> dict[str, Any]:
        return {"stage": self.stage, "ok": self.good, "findings": [vars(f) for f in self.findings]}
