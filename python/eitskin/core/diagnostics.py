"""The diagnostics of a frame as names and as short texts (csrc/include/eitskin/diagnostics.h,
docs/reference/diagnostics.md)."""

from typing import Protocol

from eitskin.core.diagnostics_table import DIAGNOSTICS


class DiagnosticFields(Protocol):
    """The fields of eits_info that describe diagnostics."""

    @property
    def diagnostics(self) -> int:
        """The diagnostics that were made, one bit each."""

    @property
    def saturated(self) -> int:
        """The number of saturated rows."""

    @property
    def outliers(self) -> int:
        """The number of rows left out as outliers."""

    @property
    def model_mismatch(self) -> float:
        """The fraction of |d| beyond noise that lies outside the model's range."""

    @property
    def open_electrodes(self) -> tuple[int, ...]:
        """The open electrodes, counted from 0."""

    @property
    def bridged_electrodes(self) -> tuple[int, ...]:
        """The electrodes of all bridged pairs, counted from 0."""

    @property
    def noisy_electrodes(self) -> tuple[int, ...]:
        """The noisy electrodes, counted from 0."""


def names(diagnostics: int) -> tuple[str, ...]:
    """Return the names in ``DIAGNOSTICS`` whose bits are set."""
    return tuple(name for bit, name in enumerate(DIAGNOSTICS) if diagnostics >> bit & 1)


def words(found: DiagnosticFields) -> tuple[str, ...]:
    """Return each diagnostic as a short text: "electrode 5 open", "2 rows left out as
    outliers"..."""
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
        "stale reference": "stale reference: the skin was touched while it was taken, or has"
        " changed since; leave it untouched and tare again",
        "crowded": "crowded: more touches than can be separated",
        "unlike the model": "unlike the model: see  eitskin doctor",
    }
    return tuple(details[name] for name in names(found.diagnostics))


def with_diagnostics(text: str, found: DiagnosticFields) -> str:
    """Return ``text``, the reason why a frame is rejected, followed by the frame's diagnostics."""
    return "; ".join((text, *words(found)))


def plural(count: int, what: str) -> str:
    """Return "1 row", "2 rows", and so on."""
    return f"{count} {what}{'s' * (count != 1)}"


def _electrodes(numbers: tuple[int, ...]) -> str:
    """Return "electrode 5" or "electrodes 5 and 6", counted from 0."""
    if not numbers:
        return "electrode"
    *most, last = map(str, numbers)
    return f"electrodes {', '.join(most)} and {last}" if most else f"electrode {last}"
