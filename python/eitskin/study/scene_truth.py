"""Where a simulated or emulated board's touches truly are, and how far off the found ones were."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from eitskin.device.open import find_device_scene
from eitskin.scene.description import Scene
from eitskin.scene.random_touches import Touch
from eitskin.scene.touch_path import touches_at
from eitskin.skin.skin import size_to_paper
from eitskin.study.matching import GATE_MM, Matching, match

FloatArray = npt.NDArray[np.float64]
WRAP_US = 2**32
LOOKED_FOR = {"increase": (1,), "decrease": (-1,), "both": (1, -1)}


class SceneTruth:
    """The touches of ``scene`` at the board's times; ``sign`` is which changes the board looks for."""

    def __init__(self, scene: Scene, sign: str = "increase") -> None:
        self.scene = scene
        self.gate_mm = GATE_MM * size_to_paper(scene.skin.outline)
        self._samples, self._wanted = scene.samples(), LOOKED_FOR[sign]
        self._began_us: int | None = None

    def begin(self, time_us: int) -> None:
        """The scene's time 0 is ``time_us`` of the board's clock; where nobody said so, the first frame's that is asked for."""
        self._began_us = time_us

    def touches(self, time_us: int) -> tuple[Touch, ...]:
        """What was there when the scan of a frame began at ``time_us``."""
        if self._began_us is None:
            self._began_us = time_us
        elapsed_s = ((time_us - self._began_us) % WRAP_US) / 1e6
        frame = min(int(elapsed_s * self.scene.rate_hz + 0.5), self.scene.frames - 1)
        return tuple(t for t in touches_at(self._samples, frame) if int(np.sign(t.contrast - 1)) in self._wanted)

    def judge(self, true: Sequence[Touch], found_mm: npt.ArrayLike) -> Matching:
        """Which of the found places (k, 2) in mm is which true touch; within 10 mm on the paper's skin, else in proportion."""
        return match([(t.x_mm, t.y_mm) for t in true], found_mm, self.gate_mm)


def scene_of(url: str) -> Scene | None:
    """The scene that a device URL names; None for boards and recordings.

    Raises:
        FileError, ConfigError, GeometryError, ProtocolError: it cannot be read.
    """
    scheme, _, rest = url.partition(":")
    return find_device_scene(rest) if scheme in ("sim", "emu") else None


@dataclass
class TruthScore:
    """Matchings of many frames, added up: touches found and not, false ones, and every position error in mm."""

    frames: int = 0
    found: int = 0
    missed: int = 0
    false_touches: int = 0
    errors_mm: list[float] = field(default_factory=list)

    def add(self, matching: Matching) -> None:
        """One frame's."""
        self.frames += 1
        self.found += matching.hits
        self.missed += matching.misses
        self.false_touches += matching.false_touches
        self.errors_mm += matching.distances_mm

    def as_dict(self) -> dict[str, float | int | None]:
        """For JSON; None for an error where nothing was found."""
        some = bool(self.errors_mm)
        return {
            "frames": self.frames,
            "true": self.found + self.missed,
            "found": self.found,
            "false": self.false_touches,
            "position_median_mm": float(np.median(self.errors_mm)) if some else None,
            "position_worst_mm": max(self.errors_mm) if some else None,
        }

    def text(self) -> str:
        """In a line."""
        facts = self.as_dict()
        line = f"against the scene's truth: {facts['found']} of {facts['true']} touches found, {facts['false']} false"
        if self.errors_mm:
            line += f"; position error median {facts['position_median_mm']:.2f} mm, worst {facts['position_worst_mm']:.2f} mm"
        return line
