"""Files damaged as disks, lines and text editors damage them, for hypothesis; and what a reader may
do with them."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from eitskin.errors import EitskinError

Content = TypeVar("Content")

LONGEST_LINE = 4000
NAN, INFINITE, BYTE_ORDER_MARK, LINE_SEPARATOR = (
    b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xef\xbb\xbf", b"\xe2\x80\xa8",
)  # fmt: skip
ODD_BYTES = (
    b"\0", b"\xff", b"\n", b"\r\n", b"\0" * 16, b"\xff" * 4, NAN, INFINITE, BYTE_ORDER_MARK,
    LINE_SEPARATOR,
)  # fmt: skip
ODD_WORDS = (
    b"nan", b"inf", b"-inf", b"-1", b"0", b"1e999", b"1e-999", b"9" * 20, b"9" * 5000,
    b"0x7fffffffffffffff", b"1_0", b"true",
    b'""', b'"\\u0000"', b"'a'", b"[]", b"{}", b"[[", b"]]", b"{", b"}", b"=", b",", b";", b".",
    b"#", b"\\", b"1979-05-27",
    b"[" * 3000,
)  # fmt: skip


def bounded(examples: int) -> Callable[[Any], Any]:
    """Settings of a test that tries ``examples`` inputs, the same ones in every run."""
    health = [HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.data_too_large]
    return settings(
        max_examples=examples,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=health,
    )


@st.composite
def damaged(draw: st.DrawFn, wholes: list[bytes], words: tuple[bytes, ...] = ODD_BYTES) -> bytes:
    """One of ``wholes`` with up to four places cut, flipped, overwritten, doubled, or filled from
    another one."""
    content = bytearray(draw(st.sampled_from(wholes)))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        length = draw(st.one_of(st.integers(0, 16), st.integers(0, len(content))))
        kind = draw(st.sampled_from(("cut", "drop", "flip", "write", "insert", "double", "splice")))
        if kind == "cut":
            del content[at:]
        elif kind == "drop":
            del content[at : at + length]
        elif kind == "flip" and at < len(content):
            content[at] ^= draw(st.integers(1, 255))
        elif kind == "write":
            word = draw(st.sampled_from(words))
            content[at : at + len(word)] = word
        elif kind == "insert":
            content[at:at] = draw(st.one_of(st.sampled_from(words), st.binary(max_size=8)))
        elif kind == "double":
            content[at:at] = content[at : at + min(length, 4096)]
        elif kind == "splice":
            other = draw(st.sampled_from(wholes))
            start = draw(st.integers(0, len(other)))
            content[at : at + length] = other[start : start + min(length, 4096)]
    return bytes(content)


def any_bytes(
    wholes: list[bytes], words: tuple[bytes, ...] = ODD_BYTES
) -> st.SearchStrategy[bytes]:
    """Mostly damaged files, sometimes bytes of no kind at all."""
    mangled = damaged(wholes, words)
    return st.one_of(mangled, mangled, mangled, mangled, st.binary(max_size=300))


def read_or_refuse(read: Callable[..., Content], *given: Any, **named: Any) -> Content | None:
    """Return the result of ``read`` for ``given``, or None if it refuses. Fail if it warns, or
    raises anything but an EitskinError of one line."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return read(*given, **named)
        except EitskinError as error:
            text = str(error)
            assert text.strip() and len(text.splitlines()) == 1, f"not one line: {text!r}"
            assert len(text) <= LONGEST_LINE, f"{len(text)} characters: {text[:200]!r}"
            assert text.isprintable(), f"not printable: {text!r}"
            return None


def written(folder: Path, name: str, content: bytes) -> Path:
    """``content`` as the file ``name``."""
    path = folder / name
    path.write_bytes(content)
    return path
