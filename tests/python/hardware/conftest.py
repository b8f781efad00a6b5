"""The circuit as code, which these tests build several times."""

import sys
from collections.abc import Iterator
from types import FrameType, SimpleNamespace
from typing import NamedTuple

import pytest

from eitskin_hardware.circuit.instrument import _quiet_skidl


class Called(NamedTuple):
    """The three fields that SKiDL reads of a frame of ``inspect.stack()``."""

    frame: FrameType
    filename: str
    lineno: int


def stack() -> list[Called]:
    """The frames of the caller, the innermost first."""
    found: list[Called] = []
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        found.append(Called(frame, frame.f_code.co_filename, frame.f_lineno))
        frame = frame.f_back
    return found


@pytest.fixture(scope="session", autouse=True)
def the_stack_is_read_without_sources() -> Iterator[None]:
    """SKiDL notes the stack for each part and each net. ``inspect.stack`` searches all loaded
    modules for the source of each frame, which takes seconds per circuit in a process of tests."""
    _quiet_skidl()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("skidl.scriptinfo.inspect", SimpleNamespace(stack=stack))
        yield
