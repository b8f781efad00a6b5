"""The fixtures that tests here take."""

from swipe_frames import drives, swipe

__all__ = ["drives", "swipe"]
