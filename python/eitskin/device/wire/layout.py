"""The layout of the payloads of ``link_table``: the order of their fields on the wire."""

from __future__ import annotations

import struct
from dataclasses import fields
from typing import ClassVar, get_type_hints


class PayloadLayout:
    """The struct of C that it is, and its fields in order, each as (name, letters of ``struct``,
    form in Python)."""

    def __init__(self, name: str, fields: list[tuple[str, str, str]]) -> None:
        self.name, self.fields = name, fields
        self.struct = struct.Struct("<" + "".join(letters for _, letters, _ in self.fields))
        # of each field: name, form, and where its values begin and end among all, a text being one
        self.places: list[tuple[str, str, int, int]] = []
        start = 0
        for name, letters, form in self.fields:
            one = struct.Struct("<" + letters)
            end = start + len(one.unpack(bytes(one.size)))
            self.places.append((name, form, start, end))
            start = end
        values = self.struct.unpack(bytes(self.struct.size))
        self.reals = [place for place, value in enumerate(values) if isinstance(value, float)]

    @property
    def size(self) -> int:
        """Bytes, without what follows the fields."""
        return self.struct.size

    def field_at(self, offset: int) -> str | None:
        """The name of the field that begins at byte ``offset``."""
        place = 0
        for name, letters, _ in self.fields:
            if place == offset:
                return name
            place += struct.calcsize("<" + letters)
        return None


class Payload:
    """A payload whose fields lie on the wire as their types say, ``Annotated`` with letters of
    ``struct`` and form; ``c``: the struct of C that it is."""

    LAYOUT: ClassVar[PayloadLayout]
    BEFORE: ClassVar[list[tuple[str, str, str]]] = []

    def __init_subclass__(cls, c: str = "") -> None:
        if c:
            hints = get_type_hints(cls, include_extras=True)
            own = {name: getattr(hint, "__metadata__", ()) for name, hint in hints.items()}
            fields = [(name, at[0], at[1]) for name, at in own.items() if at]
            cls.LAYOUT = PayloadLayout(c, [*cls.BEFORE, *fields])


class Command(Payload):
    """A command of the packet ``kind``. The first word on the wire is its request number, which is
    no field here."""

    TYPE: ClassVar[int]
    BEFORE = [("request", "I", "")]  # noqa: RUF012
    KNOWN: ClassVar[dict[int, type[Command]]] = {}

    def __init_subclass__(cls, c: str, kind: int) -> None:
        super().__init_subclass__(c)
        cls.TYPE, cls.KNOWN[kind] = kind, cls

    def payload(self, request: int) -> bytes:
        """The bytes of its payload.

        Raises:
            struct.error: a number does not fit its width.
        """
        values = [getattr(self, one.name) for one in fields(self)]  # type: ignore[arg-type]
        follow = values.pop() if values and isinstance(values[-1], bytes) else b""
        values = [one.encode("ascii") if isinstance(one, str) else one for one in values]
        return bytes(self.LAYOUT.struct.pack(request, *values) + follow)
