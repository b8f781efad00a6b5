"""The catalogue's group Frames."""

from __future__ import annotations

from hard_case import Case

CASES: tuple[Case, ...] = ()
