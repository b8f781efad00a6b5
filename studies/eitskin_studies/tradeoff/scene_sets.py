"""Scenes that configurations are judged on: what is touched, solved once without noise, then
measured as each would do it.

The sets "train" and "random" are those of ``eitskin compare``: the same scenes, contacts and noise
under the same seed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitskin.errors import GeometryError, UsageError
from eitskin.progress import Progress
from eitskin.scene.random_touches import (
    TouchRules,
    TouchScene,
    TouchSet,
    TrueTouch,
    random_touches,
    rim_distance_mm,
)
from eitskin.scene.streams import stream
from eitskin.skin.outline import Outline
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin_studies.harness.discs import spaced_touches
from eitskin_studies.harness.sessions import Drift, FrameSession, SceneSolver

TRAIN, HEADLINE = "train", "random"
HEADLINE_DB = 60.0
DRIFT = Drift(sheet=0.03, contact=0.1, amplitude=0.01)


@dataclass(frozen=True)
class SceneSet:
    """The touches of a set of scenes. ``draw`` takes outline, seed and count; ``drifts``: the
    skin has changed since the reference was taken. ``other_world``: touches are not what the model
    takes them for; such a set is measured where it is named."""

    text: str
    draw: Callable[[Outline, int, int], TouchSet]
    drifts: bool = False
    other_world: bool = False


def _random(role: str, rules: TouchRules | None = None) -> Callable[[Outline, int, int], TouchSet]:
    return lambda outline, seed, count: random_touches(outline, seed, count, role, rules)


def ring_touches(
    outline: Outline, seed: int, count: int, touches: int, spacing_mm: float, radius_mm: float = 9.0
) -> TouchSet:
    """``count`` scenes of ``touches`` equal touches of contrast 5 on a ring, neighbours
    ``spacing_mm`` apart, place and turn random.

    Raises:
        GeometryError: the ring does not fit on the skin.
    """
    role, ring_mm = (
        f"{touches} on a ring of {spacing_mm:g} mm",
        spacing_mm / (2 * math.sin(math.pi / touches)),
    )
    x0, y0, x1, y1 = outline.bounding_box_mm
    scenes = []
    for k in range(count):
        generator = stream(seed, f"touches {role}", k)
        for _ in range(2000):
            centre, turn = generator.uniform((x0, y0), (x1, y1)), generator.uniform(0, 2 * math.pi)
            angles = turn + 2 * math.pi * np.arange(touches) / touches
            places = centre + ring_mm * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            if rim_distance_mm(outline, places).min() >= radius_mm + 4.0:
                break
        else:
            raise GeometryError(
                f"{touches} touches of {radius_mm:g} mm, {spacing_mm:g} mm apart, do not fit on"
                " this skin"
            )
        scenes.append(
            TouchScene(
                f"{role}-s{seed}-{k}",
                tuple(TrueTouch(float(x), float(y), radius_mm, 5.0) for x, y in places),
            )
        )
    return TouchSet(role, seed, tuple(scenes))


SETS: dict[str, SceneSet] = {
    TRAIN: SceneSet(
        "1 to 3 random touches, for choosing t and the scale of force", _random("train")
    ),
    HEADLINE: SceneSet(
        "1 to 3 random touches, radius 6 to 12 mm, contrast 3 to 10", _random("test")
    ),
    "single": SceneSet("one such touch", _random("single", TouchRules(count=(1, 1)))),
    "pairs": SceneSet(
        "two touches of radius 9 mm, centres 27 mm apart",
        lambda o, s, n: ring_touches(o, s, n, 2, 27.0),
    ),
    "three": SceneSet("three random touches", _random("three", TouchRules(count=(3, 3)))),
    "six apart": SceneSet(
        "six touches of radius 9 mm, centres at least 45 mm apart",
        lambda o, s, n: spaced_touches(o, s, n, 6, 5.0),
    ),
    "six close": SceneSet(
        "six touches of radius 9 mm on a ring, neighbours 27 mm apart",
        lambda o, s, n: ring_touches(o, s, n, 6, 27.0),
    ),
    "light": SceneSet(
        "one or two light presses, radius 5 to 8 mm, contrast 1.3 to 2",
        _random("light", TouchRules(count=(1, 2), radius_mm=(5.0, 8.0), contrast=(1.3, 2.0))),
    ),
    "drift": SceneSet(
        "as random; since the reference the sheet changed by up to 3 %, each contact by 10 %, the"
        " amplitude by 1 %",
        _random("drift"),
        drifts=True,
    ),
    "ellipses": SceneSet(
        "1 to 3 flat ellipses, axes 1.4 to 2.2",
        _random("ellipses", TouchRules(shape="ellipse", aspect=(1.4, 2.2))),
        other_world=True,
    ),
    "fingers": SceneSet(
        "1 to 3 ellipses with the profile of Hertz, axes 1.4 to 2.2",
        _random("fingers", TouchRules(shape="finger", aspect=(1.4, 2.2))),
        other_world=True,
    ),
    "gauss": SceneSet(
        "1 to 3 Gaussian blobs, half height at 4 to 8 mm",
        _random("gauss", TouchRules(radius_mm=(4.0, 8.0), shape="gauss")),
        other_world=True,
    ),
}


class SceneFactory:
    """Solves the scenes of sets, once: kept in ``folder`` where one is given, so that a run that
    goes on need not solve again."""

    def __init__(
        self, skin: Skin, protocol: Protocol, seed: int, elements: int, folder: Path | None = None
    ) -> None:
        self.skin, self.seed = skin, seed
        self._solver = SceneSolver(skin, protocol, elements, folder)
        self._sessions: dict[tuple[str, int], FrameSession] = {}

    def session(self, name: str, count: int, progress: Progress) -> FrameSession:
        """``count`` scenes of the set ``name``.

        Raises:
            UsageError, GeometryError, MissingExtraError: from drawing, meshing and solving.
        """
        if name not in SETS:
            raise UsageError(f"no set of scenes is named {name!r}; known are {', '.join(SETS)}")
        if (name, count) not in self._sessions:
            drawn = SETS[name].draw(self.skin.outline, self.seed, count)
            drift = DRIFT if SETS[name].drifts else None
            self._sessions[name, count] = self._solver.session(drawn, progress, name, drift)
        return self._sessions[name, count]
