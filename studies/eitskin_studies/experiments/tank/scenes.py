"""Simulated touches in a tank of that geometry: all parameters and thresholds are chosen on
these."""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.scene.random_touches import TouchRules, TouchScene, TouchSet, random_touches
from eitskin.scene.streams import stream
from eitskin.scoring.metrics import Raster, disc_mask
from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.tank.tanks import tank
from eitskin_studies.harness.sessions import FrameSession

# 0.1 to 0.29 of the tank's radius; metal conducts all but infinitely beside water
RULES = TouchRules(
    count=(1, 3), radius_mm=(14.0, 40.0), contrast=(50.0, 500.0), gap_mm=14.0, rim_margin_mm=6.0
)


@dataclass(frozen=True, eq=False)
class Set:
    """Frames with their truth: ``untouched_v`` (q, m), ``frames_v`` (k, m); ``conductive`` and
    ``resistive`` (k, p) on a raster, and the objects' places, (t, 2) mm a frame."""

    name: str
    untouched_v: FloatArray
    frames_v: FloatArray
    conductive: BoolArray
    resistive: BoolArray
    conductive_mm: tuple[FloatArray, ...]
    resistive_mm: tuple[FloatArray, ...]


def with_signs(drawn: TouchSet) -> TouchSet:
    """Each object conducts, or with probability 1/2 insulates as much: contrast c becomes 1 / c."""
    scenes = []
    for k, scene in enumerate(drawn.scenes):
        turned = stream(drawn.seed, f"signs {drawn.role}", k).random(len(scene.touches)) < 0.5
        pairs = zip(scene.touches, turned, strict=True)
        touches = tuple(
            replace(touch, contrast=1 / touch.contrast) if turn else touch for touch, turn in pairs
        )
        scenes.append(TouchScene(scene.name, touches))
    return TouchSet(drawn.role, drawn.seed, tuple(scenes))


def simulated(
    workspace: Workspace, seed: int, count: int, mixed: bool, raster: Raster, share: float
) -> Set:
    """``count`` scenes of one to three objects, metal, or where ``mixed`` of both kinds. The noise
    of a frame is ``share`` of the rms of its change, as reciprocal readings of the measured frames
    have it; the reference has none.
    """
    skin, protocol = tank()
    role = "tank mixed" if mixed else "tank metal"
    drawn = random_touches(skin.outline, seed, count, role, RULES)
    session = workspace.scenes(skin, protocol).session(
        with_signs(drawn) if mixed else drawn, workspace.progress
    )
    parts = [[_discs(scene, sign) for scene in session.touches.scenes] for sign in (1, -1)]
    masks = [
        np.array([disc_mask(raster.points_mm, xy, radius) for xy, radius in part]) for part in parts
    ]
    return Set(
        f"{role}, seed {seed}",
        session.exact_untouched_v[None],
        noisy(session, share),
        masks[0],
        masks[1],
        tuple(xy for xy, _ in parts[0]),
        tuple(xy for xy, _ in parts[1]),
    )


def noisy(session: FrameSession, share: float) -> FloatArray:
    """The session's frames (k, m) with white noise of ``share`` of the rms of each one's change."""
    change = session.exact_v - session.exact_untouched_v
    names = [
        stream(session.touches.seed, f"noise {session.touches.role}", k) for k in range(len(change))
    ]
    unit = np.array([generator.standard_normal(change.shape[1]) for generator in names])
    return np.asarray(
        session.exact_v + share * np.sqrt((change**2).mean(axis=1, keepdims=True)) * unit
    )


def _discs(scene: TouchScene, sign: int) -> tuple[FloatArray, FloatArray]:
    chosen = [touch for touch in scene.touches if (touch.contrast > 1) == (sign > 0)]
    centres = np.array([(touch.x_mm, touch.y_mm) for touch in chosen]).reshape(-1, 2)
    return centres, np.array([touch.radius_mm for touch in chosen])
