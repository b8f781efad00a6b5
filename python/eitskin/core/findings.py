"""What was found wrong with a frame, by name and in a few words (csrc/include/eitskin/findings.h,
docs/reference/diagnostics.md)."""

from __future__ import annotations

from typing import Protocol

# bit k of eits_info.findings, as eits_finding_text names it
FINDINGS = (
    "saturated",
    "electrode open",
    "electrodes bridged",
    "glitch",
    "electrode noisy",
    "misfit",
    "stale reference",
    "crowded",
)
ALL_FINDINGS = 2 ** len(FINDINGS) - 1


class Found(Protocol):
    """What eits_info says of findings."""

    @property
    def findings(self) -> int:
        """Bits."""

    @property
    def saturated(self) -> int:
        """Rows."""

    @property
    def glitches(self) -> int:
        """Rows left out."""

    @property
    def misfit(self) -> float:
        """Share of |d|."""

    @property
    def open_electrodes(self) -> tuple[int, ...]:
        """From 0."""

    @property
    def bridged_electrodes(self) -> tuple[int, ...]:
        """Of one or more pairs."""

    @property
    def noisy_electrodes(self) -> tuple[int, ...]:
        """From 0."""


def names(findings: int) -> tuple[str, ...]:
    """Those of ``FINDINGS`` whose bits are set."""
    return tuple(name for bit, name in enumerate(FINDINGS) if findings >> bit & 1)


def words(found: Found) -> tuple[str, ...]:
    """Each finding in a few words: "electrode 5 open", "2 rows left out as glitches"..."""
    details = {
        "saturated": f"{plural(found.saturated, 'row')} saturated",
        "electrode open": f"{_electrodes(found.open_electrodes)} open",
        "electrodes bridged": f"{_electrodes(found.bridged_electrodes)} bridged",
        "glitch": (
            f"{plural(found.glitches, 'row')} left out as"
            f" {'glitches' if found.glitches > 1 else 'a glitch'}"
        ),
        "electrode noisy": f"{_electrodes(found.noisy_electrodes)} noisy",
        "misfit": f"misfit {100 * found.misfit:.1f} %" if found.misfit > 0 else "misfit",
        "stale reference": "stale reference: tare again",
        "crowded": "crowded: more touches than can be told apart",
    }
    return tuple(details[name] for name in names(found.findings))


def with_findings(text: str, found: Found) -> str:
    """``text``, why a frame is refused, and what was found wrong with it."""
    return "; ".join((text, *words(found)))


def plural(count: int, what: str) -> str:
    """ "1 row", "2 rows"."""
    return f"{count} {what}{'s' * (count != 1)}"


def _electrodes(numbers: tuple[int, ...]) -> str:
    """ "electrode 5", "electrodes 5 and 6"; from 0."""
    if not numbers:
        return "electrode"
    *most, last = map(str, numbers)
    return f"electrodes {', '.join(most)} and {last}" if most else f"electrode {last}"
