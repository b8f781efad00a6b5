"""What was found wrong with a frame, by name and in a few words
(csrc/include/eitskin/diagnostics.h, docs/reference/diagnostics.md)."""

from typing import Protocol

from eitskin.core.diagnostics_table import DIAGNOSTICS


class DiagnosticFields(Protocol):
    """What eits_info says of diagnostics."""

    @property
    def diagnostics(self) -> int:
        """Bits."""

    @property
    def saturated(self) -> int:
        """Rows."""

    @property
    def outliers(self) -> int:
        """Rows left out."""

    @property
    def model_mismatch(self) -> float:
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


def names(diagnostics: int) -> tuple[str, ...]:
    """Those of ``DIAGNOSTICS`` whose bits are set."""
    return tuple(name for bit, name in enumerate(DIAGNOSTICS) if diagnostics >> bit & 1)


def words(found: DiagnosticFields) -> tuple[str, ...]:
    """Each diagnostic in a few words: "electrode 5 open", "2 rows left out as outliers"..."""
    details = {
        "saturated": f"{plural(found.saturated, 'row')} saturated",
        "electrode open": f"{_electrodes(found.open_electrodes)} open",
        "electrodes bridged": f"{_electrodes(found.bridged_electrodes)} bridged",
        "outlier": (
            f"{plural(found.outliers, 'row')} left out as"
            f" {'outliers' if found.outliers > 1 else 'an outlier'}"
        ),
        "electrode noisy": f"{_electrodes(found.noisy_electrodes)} noisy",
        "model mismatch": f"model mismatch {100 * found.model_mismatch:.1f} %"
        if found.model_mismatch > 0
        else "model mismatch",
        "stale reference": "stale reference: tare again",
        "crowded": "crowded: more touches than can be separated",
        "unlike the model": "unlike the model: see  eitskin doctor",
    }
    return tuple(details[name] for name in names(found.diagnostics))


def with_diagnostics(text: str, found: DiagnosticFields) -> str:
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
