"""Wrap texts of pictures to a width in inches, and draw the key of their marks."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from eitskin.view.pictures import FOUND, TRUE, Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def wrapped(text: str, width: float, size: float, weight: str = "normal") -> list[str]:
    """Split ``text`` into lines of at most ``width`` inches at ``size`` points; longer words are
    cut."""
    lines: list[str] = []
    for part in text.split("\n"):
        line = ""
        for word in part.split(" "):
            for piece in _pieces(word, width, size, weight):
                longer = f"{line} {piece}" if line else piece
                if line and _inches(longer, size, weight) > width:
                    lines.append(line)
                    line = piece
                else:
                    line = longer
        lines.append(line)
    return lines


def _pieces(word: str, width: float, size: float, weight: str) -> list[str]:
    if _inches(word, size, weight) <= width:
        return [word]
    pieces, piece = [], ""
    for letter in word:
        if piece and _inches(piece + letter, size, weight) > width:
            pieces.append(piece)
            piece = ""
        piece += letter
    return [*pieces, piece]


@lru_cache(4096)
def _inches(text: str, size: float, weight: str) -> float:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size, weight=weight)
    return float(text_to_path.get_text_width_height_descent(text, font, ismath=False)[0]) / 72


def plain(text: str) -> str:
    """Return ``text`` escaped so that matplotlib does not read it as a formula."""
    return text.replace("$", r"\$")


class Key:
    """The key of the marks in ``panels``, in as many lines as ``width`` inches need."""

    SAMPLE = 0.62  # width of a mark and the space around it, in inches

    def __init__(self, panels: Sequence[Panel], width: float) -> None:
        from matplotlib.lines import Line2D

        found = [mark for panel in panels for mark in panel.found]
        cross: dict[str, Any] = {"marker": "x", "markersize": 7, "markeredgewidth": 1.6}
        ring: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none"}
        kinds = (
            ("true touch", any(panel.truth for panel in panels), TRUE, ring),
            ("found touch", bool(found), FOUND, cross),
            ("its size", any(m.radius_mm for m in found), FOUND, {"linestyle": (0, (3, 2))}),
            ("its place, 90 %", any(m.place_mm2 for m in found), FOUND, {"linestyle": "-"}),
        )
        self.handles = [
            Line2D([], [], label=label, markeredgecolor=colour,
                   color=colour if "linestyle" in style else "none", **style)
            for label, there, colour, style in kinds if there
        ]  # fmt: skip
        widest = max(
            (_inches(str(one.get_label()), 8, "normal") for one in self.handles), default=0.0
        )
        self._columns = max(min(int(width / (widest + self.SAMPLE)), len(self.handles)), 1)
        rows = math.ceil(len(self.handles) / self._columns)
        self.height = 0.08 + 0.19 * rows if self.handles else 0.0

    def draw(self, figure: "Figure", top: float, middle: float = 0.5) -> None:
        """Draw the key centred at ``middle``, a fraction of the figure's width, with its upper edge
        at ``top``, a fraction of the height measured from above."""
        if self.handles:
            figure.legend(
                handles=self.handles, loc="upper center", bbox_to_anchor=(middle, 1 - top),
                ncols=self._columns, frameon=False, fontsize=8, borderaxespad=0.1,
                borderpad=0.1, columnspacing=1.0, handlelength=1.6, handletextpad=0.4,
            )  # fmt: skip
