"""Who looks at a session from outside, such as the truth of a simulated scene
(``eitskin.scoring.observer``). A session knows nothing of scenes or scores."""

from typing import Any, Protocol

from eitskin.session.frame import Frame


class Observer(Protocol):
    """Adds to frames what it knows of them, and says when there is nothing more to see."""

    def began(self, board_us: int) -> None:
        """The scene has begun: the board's clock at its time 0. Not called where nobody knows: then
        it began with the first frame."""

    def look_for(self, sign: str) -> None:
        """The solver looks for such changes from now on: "increase", "decrease" or "both"."""

    def over(self, board_us: int) -> bool:
        """Whether there is nothing more to see in a frame whose scan began then."""

    def see(self, frame: Frame) -> Frame:
        """``frame`` with what is known of it."""

    def facts(self) -> dict[str, Any] | None:
        """Return the summary for JSON; None if nothing was seen."""

    def lines(self) -> list[str]:
        """Return the summary as lines of text."""
