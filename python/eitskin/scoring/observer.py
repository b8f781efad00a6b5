"""Compare a session with the truth of a simulated scene: each frame gets its true touches and the
errors of the found ones, and all frames together a score."""

from dataclasses import replace
from typing import Any

from eitskin.scoring.scene_truth import SceneTruth, TruthScore
from eitskin.session.frame import Frame


class TruthObserver:
    """Compares frames with ``truth``, and sums the errors in ``score``. It is an ``Observer`` of
    ``eitskin.session``."""

    def __init__(self, truth: SceneTruth) -> None:
        self._truth, self.score = truth, TruthScore()

    def began(self, board_us: int) -> None:
        self._truth.began_us = board_us

    def look_for(self, sign: str) -> None:
        self._truth.look_for(sign)

    def over(self, board_us: int) -> bool:
        return self._truth.over(board_us)

    def see(self, frame: Frame) -> Frame:
        found = frame.found_mm
        if found is None or frame.refused:
            return frame
        true = self._truth.touches(frame.board_us)
        matching = self._truth.matching(true, found)
        self.score.add(matching)
        numbers = (number for _, number in matching.pairs)
        errors = dict(zip(numbers, matching.distances_mm, strict=True))
        return replace(frame, true=true, errors_mm=errors)

    def facts(self) -> dict[str, Any] | None:
        return self.score.as_dict() if self.score.frames else None

    def lines(self) -> list[str]:
        return [self.score.text()] if self.score.frames else []
