"""Pictures of hard cases: one function a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

DRAWN: dict[str, Callable[[Path], None]] = {}


def draw(name: str, path: Path) -> None:
    """Make the picture ``name`` at ``path``."""
    DRAWN[name](path)
