"""The fixture that every test here takes."""

from swipe_frames import swipe

__all__ = ["swipe"]
