"""One entry of the catalogue of hard cases."""

from __future__ import annotations

from dataclasses import dataclass

GROUPS = ("Frames", "Physics", "Problem", "Time", "Bytes")


@dataclass(frozen=True)
class Case:
    """A case that makes an EIT skin's numbers go wrong.

    ``id`` is "group/name" in lower case. ``tests``: "FILE.py::test" below tests/python, or a path
    from the root for what is no Python test. ``picture``: a file's name in docs/results/pictures,
    made by the function of that name in ``pictures.py``.
    """

    id: str
    title: str
    happens: str
    hard: str
    promise: str
    tests: tuple[str, ...]
    picture: str | None = None

    @property
    def group(self) -> str:
        """One of ``GROUPS``."""
        return self.id.split("/")[0].capitalize()
