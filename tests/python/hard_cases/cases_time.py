"""The catalogue's group Time."""

from __future__ import annotations

from hard_case import Case

CASES: tuple[Case, ...] = ()
