"""What the payloads of ``link_table`` are made of: the order of their fields on the wire."""

from __future__ import annotations

import struct
from dataclasses import fields
from typing import ClassVar


class Layout:
    """The struct of C that it is, and its fields in order, each as (name, letters of ``struct``,
    form in Python). They are written as "name:letters" or "name:letters:form", with spaces
    between."""

    def __init__(self, name: str, fields: str) -> None:
        self.name = name
        parts = [f"{field}:".split(":") for field in fields.split()]
        self.fields = [(field, letters, form) for field, letters, form, *_ in parts]
        self.struct = struct.Struct("<" + "".join(letters for _, letters, _ in self.fields))
        places = [struct.Struct("<" + letters) for _, letters, _ in self.fields]
        # how many values each field has, a text being one
        self.counts = [len(place.unpack(bytes(place.size))) for place in places]

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
    """A payload whose fields lie as its ``LAYOUT`` says."""

    LAYOUT: ClassVar[Layout]


class Command(Payload):
    """A command. The first word on the wire is its request number, which is no field here."""

    TYPE: ClassVar[int]

    def payload(self, request: int) -> bytes:
        """The bytes of its payload.

        Raises:
            struct.error: a field does not fit its width.
        """
        values = [getattr(self, one.name) for one in fields(self)]  # type: ignore[arg-type]
        follow = values.pop() if values and isinstance(values[-1], bytes) else b""
        return bytes(self.LAYOUT.struct.pack(request, *values) + follow)
