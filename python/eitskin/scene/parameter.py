"""How effects declare a parameter: its default, its unit, its range and what it is, in one line."""

from dataclasses import field
from typing import Any


def parameter(
    default: Any,
    unit: str,
    doc: str,
    *,
    low: float | None = None,
    high: float | None = None,
    open_low: bool = False,
    choices: tuple[str, ...] = (),
) -> Any:
    """A dataclass field whose metadata holds ``unit``, ``doc`` and the range [low, high], or (low,
    high]."""
    metadata: dict[str, Any] = {"unit": unit, "doc": doc}
    if low is not None:
        metadata["low"] = low
    if high is not None:
        metadata["high"] = high
    if open_low:
        metadata["open_low"] = True
    if choices:
        metadata["choices"] = choices
    return field(default=default, metadata=metadata)
