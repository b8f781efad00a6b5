"""Skins with random contacts and random places on them, and the scans that are measured while
touches land, move and lift: scenes."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.model.model import Model
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import Scene, scene_from_table
from eitskin.scene.runner import FrameMaker, simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.skin.protocol import Protocol, in_order
from eitskin.skin.skin import Skin
from eitskin_studies.experiments.fast_path.scans import ROW_S, STEP

Keyframes = Sequence[tuple[float, ...]]

ELEMENTS = 7000
REACH = 0.83  # of the skin's radius: where touches are
CONTACT_SPREAD = 0.3
SKINS = 4  # contacts are drawn again for each part of the touches
_MESHES = MeshCache()


@dataclass(frozen=True)
class Touched:
    """The changes of the sheet by touches."""

    radius_mm: float = 8.0
    contrast: float = 5.0
    law: str = "short_circuit"


class States:
    """``places`` (n, k, 2) of n presses, swipes (from, to) or pairs; ``v0`` (n, m) of their skins,
    ``skin`` or the paper's, of which ``protocol`` is measured."""

    def __init__(
        self,
        places: FloatArray,
        seeds: Sequence[int],
        protocol: Protocol,
        elements: int,
        touched: Touched | None = None,
        skin: Skin | None = None,
    ) -> None:
        self.places, self._seeds, self._elements = places, seeds, elements
        self._touched, self._skin, self._protocol = touched or Touched(), skin, protocol
        self._rate_hz = 1 / (ROW_S * protocol.n_rows)
        untouched = {seed: self._simulated(seed, (), 1)[0] for seed in set(seeds)}
        self.v0 = np.array([untouched[seed] for seed in seeds])

    def volts(self, k: int, paths: Sequence[Keyframes], frames: int) -> FloatArray:
        """Rows (t,) in V of ``frames`` scans of skin ``k`` in the order of their times; of each
        touch ``paths`` has keyframes (s, mm, mm, press, or also its radius in mm), the last held
        where it is at infinity."""
        return self._simulated(self._seeds[k], paths, frames)[1:].ravel()

    def rows_at(
        self, k: int, paths: Sequence[Keyframes], lasts_s: float
    ) -> Callable[[FloatArray], FloatArray]:
        """A function of instants (m,) in s that gives skin ``k``'s rows then, (m,) in V."""
        frames = int(np.ceil(self._rate_hz * lasts_s))
        scene = self._scene(self._seeds[k], paths, frames)
        maker = FrameMaker(compile_scene(scene, mesh_cache=_MESHES))
        return lambda times_s: maker.frame(1, times_s)

    def _simulated(self, seed: int, paths: Sequence[Keyframes], frames: int) -> FloatArray:
        """An untouched frame as the protocol stands, then ``frames`` scans in their order."""
        scene = self._scene(seed, paths, frames)
        volts = simulate_frames(compile_scene(scene, mesh_cache=_MESHES)).voltage_v
        volts[1:] = volts[1:, scene.protocol.scan_rows]
        return volts

    def _scene(self, seed: int, paths: Sequence[Keyframes], frames: int) -> Scene:
        head = {"seed": seed, "elements": self._elements, "quiet_frames": 1, "frames": frames,
                "rate_hz": self._rate_hz}  # fmt: skip
        touches = [_touch(path, self._touched) for path in paths]
        effects = {"contact_impedance": {"spread": CONTACT_SPREAD}}
        table = {"scene": head, "touch": touches, "effects": effects}
        scene = scene_from_table(table, "fast path", Path())
        return replace(scene, protocol=self._protocol, skin=self._skin or scene.skin)


def _touch(path: Keyframes, touched: Touched) -> dict[str, Any]:
    names = ("t_s", "x_mm", "y_mm", "press", "radius_mm")
    keys = [dict(zip(names, key, strict=False)) for key in path if np.isfinite(key[0])]
    return {**asdict(touched), "hold": len(keys) < len(path), "path": keys}


def place_on(skin: Skin, rng: np.random.Generator) -> FloatArray:
    """Anywhere where touches are, evenly."""
    x0, _, x1, _ = skin.outline.bounding_box_mm
    radius, angle = REACH * (x1 - x0) / 2 * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def _places(model: Model, rng: np.random.Generator, kind: str) -> FloatArray:
    least_mm = {"presses": 0.0, "pairs": 35.0, "swipes": 70.0}[kind]
    while True:
        places = np.array([place_on(model.skin, rng) for _ in range(1 if kind == "presses" else 2)])
        if np.hypot(*(places[0] - places[-1])) >= least_mm:
            return places


def draw_states(model: Model, kind: str, count: int, seed: int, elements: int) -> States:
    """``count`` "presses", "swipes" (at least 70 mm long) or "pairs" (at least 35 mm apart)."""
    rng = np.random.default_rng([seed, ("presses", "swipes", "pairs").index(kind)])
    places = np.array([_places(model, rng, kind) for _ in range(count)])
    skins = rng.integers(2**32, size=min(SKINS, count)).tolist()
    seeds = [skins[k * len(skins) // count] for k in range(count)]
    return States(places, seeds, in_order(model.protocol, f"by {STEP}"), elements)
