"""The catalogue's group Physics."""

from __future__ import annotations

from hard_case import Case

CASES: tuple[Case, ...] = ()
