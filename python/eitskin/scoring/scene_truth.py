"""Compute the true touches of a simulated or emulated board, and the errors of the found ones."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from eitskin.device.transport import SimulatedScene
from eitskin.scene.description import Scene
from eitskin.scene.library_scenes import find_scene
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_path import touches_at, touches_of
from eitskin.scoring.matching import GATE_MM, WANTED_SIGNS, Matching, match
from eitskin.session.sample import Sample
from eitskin.skin.skin import size_to_paper

WRAP_US = 2**32


class SceneTruth:
    """The true touches of ``scene`` at the board's times.

    Only touches with conductivity changes of ``sign`` count. The truth of a frame is that at the
    end of its scan. In a frozen scene, a simulated board shows the frame of the scene that is
    nearest to the beginning of a scan, and an emulated one (``held``) the last frame that has begun
    by then. With ``loop`` the scene starts again at its end: with the next scan on a simulated
    board, immediately on an emulated one.
    """

    def __init__(
        self, scene: Scene, sign: str = "increase", *, held: bool = False, loop: bool = False
    ) -> None:
        self.scene, self._held, self._loop = scene, held, loop
        self._ahead = 1e-9 if held else 0.5
        self.gate_mm = GATE_MM * size_to_paper(scene.skin.outline)
        self._samples, self._wanted = scene.samples(), WANTED_SIGNS[sign]
        # the board's clock at the scene's time 0; unless it is set, that of the first frame
        self.began_us: int | None = None

    def look_for(self, sign: str) -> None:
        """Count touches of another sign from now on, as the board does."""
        self._wanted = WANTED_SIGNS[sign]

    def touches(self, time_us: int) -> tuple[TrueTouch, ...]:
        """Return the true touches of a frame whose scan began at ``time_us``."""
        if self.began_us is None:
            self.began_us = time_us
        if self._loop:
            self._begin_again(time_us)
        scene, last = self.scene, self.scene.frames - 1
        if scene.frozen:
            there = touches_at(self._samples, min(self._frame(time_us), last))
        else:
            time_s = min(self._elapsed_s(time_us), last / scene.rate_hz) + scene.truth_delay_s
            there = touches_of(scene.touches, time_s)
        return tuple(t for t in there if int(np.sign(t.contrast - 1)) in self._wanted)

    def over(self, time_us: int) -> bool:
        """Return whether the scene has ended when the scan of a frame begins at ``time_us``."""
        began = self.began_us is not None
        return began and not self._loop and self._frame(time_us) >= self.scene.frames

    def _begin_again(self, time_us: int) -> None:
        """Move time 0 to the loop in which a scan begins at ``time_us``."""
        scene, late = self.scene, self._frame(time_us) - self.scene.frames
        if late < 0 or self.began_us is None:
            return
        if late == 0 and not self._held:
            self.began_us = time_us
        else:
            loops = 1 + late // scene.frames
            self.began_us += round(1e6 * loops * scene.frames / scene.rate_hz)

    def _frame(self, time_us: int) -> int:
        return int(self._elapsed_s(time_us) * self.scene.rate_hz + self._ahead)

    def _elapsed_s(self, time_us: int) -> float:
        return float((time_us - (self.began_us or 0)) % WRAP_US) / 1e6

    def matching(self, true: Sequence[TrueTouch], found_mm: npt.ArrayLike) -> Matching:
        """Match true touches with found places (k, 2) in mm, within 10 mm on the paper's skin and
        in proportion to the size of other skins."""
        return match([(t.x_mm, t.y_mm) for t in true], found_mm, self.gate_mm)


def truth_of(scene: SimulatedScene, sign: str = "increase") -> SceneTruth:
    """Return the truth of the scene of a simulated skin, for a board that looks for changes of
    ``sign``. Raises the errors of ``find_scene``."""
    return SceneTruth(find_scene(scene.name), sign, held=scene.held, loop=scene.loop)


@dataclass
class TruthScore:
    """The sums over the matchings of many frames: touches found, missed and false, and position
    errors in mm."""

    frames: int = 0
    found: int = 0
    missed: int = 0
    false_touches: int = 0
    errors_mm: Sample = field(default_factory=Sample)

    def add(self, matching: Matching) -> None:
        self.frames += 1
        self.found += matching.hits
        self.missed += matching.misses
        self.false_touches += matching.false_touches
        for distance in matching.distances_mm:
            self.errors_mm.add(distance)

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the score as JSON values; errors are None if nothing was found."""
        some = self.errors_mm.count > 0
        return {
            "frames": self.frames,
            "true": self.found + self.missed,
            "found": self.found,
            "false": self.false_touches,
            "position_median_mm": self.errors_mm.quantile(0.5) if some else None,
            "position_worst_mm": self.errors_mm.largest if some else None,
        }

    def text(self) -> str:
        facts = self.as_dict()
        line = (
            f"compared with the scene's truth: {facts['found']} of {facts['true']} touches found,"
            f" {facts['false']} false"
        )
        if self.errors_mm.count:
            line += (
                f"; position error median {facts['position_median_mm']:.2f} mm, worst"
                f" {facts['position_worst_mm']:.2f} mm"
            )
        return line
