"""Observers look at a session from outside, such as the truth of a simulated scene
(``eitskin.scoring.observer``). A session itself does not use scenes or scores."""

from typing import Any, Protocol

from eitskin.session.frame import Frame


class Observer(Protocol):
    """Adds its knowledge to frames, and reports when there is nothing more to see."""

    def began(self, board_us: int) -> None:
        """The scene has begun: the board's clock at its time 0. Not called where nobody knows: then
        it began with the first frame."""

    def look_for(self, sign: str) -> None:
        """The solver looks for such changes from now on: "increase", "decrease" or "both"."""

    def over(self, board_us: int) -> bool:
        """Return whether there is nothing more to see in a frame whose scan began then."""

    def see(self, frame: Frame) -> Frame:
        """Return ``frame`` with the observer's knowledge about it."""

    def facts(self) -> dict[str, Any] | None:
        """Return the summary for JSON; None if nothing was seen."""

    def lines(self) -> list[str]:
        """Return the summary as lines of text."""
