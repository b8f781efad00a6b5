"""Random scenes of one to three touches on the paper's skin, and the same with something wrong;
simulated once a session."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import scene_from_table
from eitskin.scene.random_touches import TouchScene, random_touches
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scoring import metrics
from eitskin.scoring.score import Scorer, scorer_for
from eitskin.skin.protocol import Protocol, adjacent, table
from eitskin.skin.skin import paper_skin
from small_models import prebuilt

SEED, COUNT, UNTOUCHED = 9, 6, 16
SNR = 1e3  # rms(V0) / sigma: 60 dB
ELECTRODES = 16
ROWS = adjacent(ELECTRODES).drive_measure.astype(np.int64)
CONTACTS = {"contact_impedance": {"spread": 0.2}}


@cache
def scenes() -> tuple[TouchScene, ...]:
    return random_touches(paper_skin().outline, SEED, COUNT, "frames").scenes


@cache
def mesh_cache() -> MeshCache:
    return MeshCache()


def frames_of(
    k: int,
    effects: dict[str, Any],
    protocol: Protocol | None = None,
    rate_hz: float = 20.0,
    frames: int = 1,
) -> np.ndarray:
    """One untouched frame of scene k, then ``frames`` touched ones (frames + 1, m) V, without
    noise."""
    touches = [
        {"radius_mm": t.radius_mm, "x_mm": t.x_mm, "y_mm": t.y_mm, "contrast": t.contrast}
        for t in scenes()[k].touches
    ]
    head = {
        "name": "fault", "skin": "paper", "seed": 1000 * SEED + k, "frames": frames,
        "rate_hz": rate_hz, "quiet_frames": 1,
    }  # fmt: skip
    text = {"scene": head, "touch": touches, "effects": CONTACTS | effects}
    scene = scene_from_table(text, "fault", Path())
    if protocol is not None:
        scene = replace(scene, protocol=protocol)
    return simulate_frames(compile_scene(scene, mesh_cache=mesh_cache())).voltage_v


def swapped(i: int, j: int) -> Protocol:
    rows = ROWS.copy()
    rows[i == ROWS], rows[j == ROWS] = j, i
    return table(ELECTRODES, rows)


@cache
def simulated() -> list[dict[str, np.ndarray]]:
    """By scene: "quiet" and "touched" (m,), and what is wrong, with electrode k or those from k
    on."""
    found = []
    for k in range(COUNT):
        untouched, touched = frames_of(k, {})
        pair, apart = ([k % ELECTRODES, (k + by) % ELECTRODES] for by in (1, 4))
        off = {"detached": {"electrodes": pair[:1]}}
        one = {"quiet": untouched, "touched": touched, "detached": frames_of(k, off)[-1]}
        for name, of in (("", pair), (" apart", apart)):
            bridge = {"bridged": {"electrodes": of, "resistance_ohm": 10.0}}
            one[f"bridged{name}"] = frames_of(k, bridge)[-1]
            one[f"swapped{name}"] = frames_of(k, {}, swapped(*of))[-1]
        found.append(one)
    return found


def rms_v(k: int) -> float:
    return float(np.sqrt(np.mean(simulated()[k]["quiet"] ** 2)))


def noisy(k: int, frame: np.ndarray, stream: int) -> np.ndarray:
    generator = np.random.default_rng([SEED, k, stream])
    return np.asarray(frame + rms_v(k) / SNR * generator.standard_normal(frame.shape))


def quiet_frames(k: int) -> np.ndarray:
    return noisy(k, np.tile(simulated()[k]["quiet"], (UNTOUCHED, 1)), 0)


def touched(k: int) -> np.ndarray:
    return noisy(k, simulated()[k]["touched"], 1)


def played(
    frames: Callable[[int], Sequence[np.ndarray] | np.ndarray],
) -> list[tuple[np.ndarray, np.ndarray]]:
    """By scene: its untouched frames, and what ``frames`` gives for it."""
    return [(quiet_frames(k), np.array(frames(k))) for k in range(COUNT)]


def half(frames: np.ndarray) -> np.ndarray:
    """As a scan of one row of each reciprocal pair, copied to the other."""
    fold, done = adjacent(ELECTRODES).reciprocal_pairs(), frames.copy()
    done[..., fold.second] = fold.sign * frames[..., fold.first]
    return done


@cache
def scorer() -> Scorer:
    """The model's, which takes a second to make."""
    return scorer_for(prebuilt()[0])


def miou(image: np.ndarray, k: int) -> float:
    """Return the MIoU of an image (n,) with scene k, at the model's own threshold."""
    image_scorer, scene = scorer().image_scorer, scenes()[k]
    truth = metrics.disc_mask(image_scorer.raster.points_mm, scene.centres_mm(), scene.radii_mm())
    shown = image_scorer.lookup.show(np.asarray(image, dtype=np.float64))
    seen = metrics.touch_mask(shown, prebuilt()[0].defaults.mask_threshold)
    return float(metrics.miou(seen, truth))
