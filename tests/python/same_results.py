"""What calls gave when their results were last judged right: another number, word or error shows,
also where no rule says what must come out.

A change that is meant to change results writes them anew: EITSKIN_SAME_RESULTS=write pytest
-k same_results; the difference of the JSON files then says what has changed.
"""

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin import __version__
from eitskin.errors import EitskinError

RELATIVE = 1e-6  # what libraries of linear algebra may differ by
SHOWN = 12  # of longer arrays sums stand for the numbers


def summary(value: Any) -> Any:
    """JSON that changes wherever ``value`` does; arrays by their shape, sum, sum of squares, and
    sum with growing weights."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: summary(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biufc":
            return summary(value.tolist())
        given = np.ascontiguousarray(value).ravel()
        numbers = given.view(float) if np.iscomplexobj(given) else given.astype(float)
        if len(numbers) <= SHOWN:
            return [list(value.shape), *map(summary, numbers.tolist())]
        known = np.where(np.isfinite(numbers), numbers, 7.0)
        weighted = (1 + np.arange(len(known)) % 1009 / 1009) @ np.abs(known)
        sums = known.sum(), known @ known, weighted
        return [list(value.shape), int(np.isnan(numbers).sum()), *map(summary, sums)]
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, np.generic):
        return summary(value.item())
    if isinstance(value, float):
        return float(f"{value:.10g}") if math.isfinite(value) else repr(value)
    if isinstance(value, Mapping):
        return {str(key): summary(each) for key, each in value.items()}
    if isinstance(value, (str, int)) or value is None:
        return value
    if isinstance(value, (bytes, bytearray)):
        return summary(np.frombuffer(bytes(value), np.uint8))
    if isinstance(value, (set, frozenset)):
        value = sorted(value)
    if isinstance(value, Sequence):
        if len(value) > SHOWN and all(type(each) in (int, float) for each in value):
            return summary(np.array(value))
        return [summary(each) for each in value]
    return type(value).__name__


def outcome(call: Callable[[], Any]) -> Any:
    """What it returns, or says on raising."""
    try:
        return summary(call())
    except EitskinError as error:
        return f"{type(error).__name__}: {error}".replace(__version__, "VERSION")


def differences(found: Any, stored: Any, where: str = "") -> list[str]:
    """Places at which the two are not the same."""
    if isinstance(found, dict) and isinstance(stored, dict) and found.keys() == stored.keys():
        return [d for key in found for d in differences(found[key], stored[key], f"{where}.{key}")]
    if isinstance(found, list) and isinstance(stored, list) and len(found) == len(stored):
        pairs = enumerate(zip(found, stored, strict=True))
        return [d for k, (a, b) in pairs for d in differences(a, b, f"{where}[{k}]")]
    numbers = type(found) in (int, float) and type(stored) in (int, float)
    if numbers and math.isclose(found, stored, rel_tol=RELATIVE, abs_tol=1e-12):
        return []
    return [] if found == stored else [f"{where}: {found!r}, was {stored!r}"]


def check_same(store: Path, name: str, call: Callable[[], Any]) -> None:
    """That ``call`` gives what ``store`` has under ``name``."""
    kept = json.loads(store.read_text()) if store.is_file() else {}
    found = json.loads(json.dumps(outcome(call)))
    if os.environ.get("EITSKIN_SAME_RESULTS") == "write":
        kept[name] = found
        lines = (f" {json.dumps(key)}: {json.dumps(kept[key])}" for key in sorted(kept))
        store.write_text("{\n" + ",\n".join(lines) + "\n}\n")
        return
    if name not in kept:
        pytest.fail(f"{store.name} has no {name!r}; write it (same_results.py says how)")
    assert differences(found, kept[name]) == []
