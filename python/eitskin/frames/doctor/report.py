"""The doctor's report: findings with evidence and remedies, the questions that stayed open, and the
measured numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from shlex import quote
from typing import Any

from eitskin.config import first_few

FAULT = "fault"
NOTE = "note"
EXIT_FAULT = 11
SHOWN = 8


@dataclass(frozen=True)
class Finding:
    """One finding. ``name`` is stable for programs. ``severity`` is FAULT if it must be repaired,
    otherwise NOTE.

    ``evidence`` holds the numbers that support it. ``repair`` holds the options of ``eitskin
    import`` that repair it, or is empty if only the hardware can be repaired.
    """

    name: str
    severity: str
    text: str
    evidence: Mapping[str, Any] = field(default_factory=dict)
    repair: str = ""


@dataclass(frozen=True)
class CheckOutcome:
    """The result of one check: its ``findings``; ``inconclusive``, the questions that it could not
    decide, with reasons; and ``measured``, numbers by name."""

    findings: tuple[Finding, ...] = ()
    inconclusive: tuple[str, ...] = ()
    measured: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class DoctorReport:
    """The report on ``source``; ``subject`` describes what was examined.

    ``repair`` holds the options of ``eitskin import`` that together repair everything that can be
    repaired, and ``command`` the whole command that applies them, if it is known.
    """

    source: str
    subject: str
    findings: tuple[Finding, ...]
    inconclusive: tuple[str, ...]
    measured: Mapping[str, Any]
    repair: str = ""
    command: str = ""

    @property
    def healthy(self) -> bool:
        """Return whether there is no fault."""
        return not any(finding.severity == FAULT for finding in self.findings)

    @property
    def exit_code(self) -> int:
        """The exit code of the command: 0 if healthy, otherwise EXIT_FAULT."""
        return 0 if self.healthy else EXIT_FAULT

    def as_table(self) -> dict[str, Any]:
        """Return the report as JSON values; a number that is not finite becomes null."""
        return {
            "source": self.source,
            "subject": self.subject,
            "healthy": self.healthy,
            "findings": [
                vars(finding) | {"evidence": _finite(finding.evidence)} for finding in self.findings
            ],
            "untold": list(self.inconclusive),
            "measured": _finite(self.measured),
            "repair": self.repair,
            "command": self.command,
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        lines = [f"{self.source}: {self.subject}"]
        for finding in self.findings:
            lines.append(f"  {finding.severity.upper():5} {finding.name}: {finding.text}")
            if finding.evidence:
                lines.append(
                    "        evidence: "
                    + ", ".join(f"{k} {_shown(v)}" for k, v in finding.evidence.items())
                )
            if finding.repair:
                lines.append(f"        repair: eitskin import ... {finding.repair}")
        lines.extend(f"  inconclusive: {text}" for text in self.inconclusive)
        if self.measured:
            lines.append(
                "  measured: " + ", ".join(f"{k} {_shown(v)}" for k, v in self.measured.items())
            )
        faults = sum(finding.severity == FAULT for finding in self.findings)
        notes = len(self.findings) - faults
        counted = f"{faults} fault{'s' * (faults != 1)}, {notes} note{'s' * (notes != 1)}"
        lines.append(
            f"  {counted}: "
            + ("nothing must be repaired" if self.healthy else "repair these before imaging")
        )
        if self.repair:
            known = f"eitskin import {quote(self.source)} -o OUT.npz ... {self.repair}"
            lines.append(f"  all in one: {self.command or known}")
        return lines


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return "(" + ", ".join(f"{k} {_shown(v)}" for k, v in list(value.items())[:SHOWN]) + ")"
    if isinstance(value, (list, tuple)):
        return f"[{first_few([_shown(entry) for entry in value], SHOWN)}]"
    return str(value)
