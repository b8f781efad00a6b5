"""A mistake to put into the core."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutation:
    """``original``, which stands once in ``csrc/src/file``, becomes ``replacement``. ``first`` is
    the C test to ask first."""

    name: str
    file: str
    original: str
    replacement: str
    first: str


def of(file: str, *rows: tuple[str, str, str, str]) -> tuple[Mutation, ...]:
    """Of each row: name, original, replacement, first."""
    return tuple(
        Mutation(name, file, original, replacement, first)
        for name, original, replacement, first in rows
    )
